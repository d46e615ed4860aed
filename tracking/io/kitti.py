"""KITTI tracking sequences: detections, poses and labels of each frame, from a folder.

The folder contains, for each sequence NNNN:

- `detection_*/NNNN.txt` (one such folder): rows `frame,type,x1,y1,x2,y2,score,h,w,l,x,y,z,ry,alpha`; type 1 is a
  pedestrian, 2 a car, 3 a cyclist; the words Pedestrian, Car and Cyclist are taken, too. If all scores of the folder
  are in 0..1, they are probabilities, otherwise log-odds.
- `calib/NNNN.txt`: the row `P2:` with the 3x4 projection of the left colour camera.
- `pose/NNNN.txt`: a row of 12 numbers for each frame of the sequence, the upper 3x4 of world_from_camera; or KITTI's
  own `oxts/NNNN.txt`, see `tracking.io.kitti_oxts`.
- `label/NNNN.txt` or `label_02/NNNN.txt`, optional ground truth: KITTI's label rows.

KITTI's camera frame has x right, y down and z ahead. The ego frame is the rotated camera frame: x ahead, y left, z
up, with its origin at the camera; the world frame is rotated in the same way.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from appocc.checks import (
    BoolArray,
    FloatArray,
    IntArray,
    check_intrinsic,
    check_shape,
    check_transform,
    frozen,
)
from appocc.errors import DataError, ShapeError
from appocc.geometry import wrap_angle
from appocc.kitti_files import LABEL, check_columns, check_size, read_labels
from appocc.text_tables import parse_integer, parse_numbers, read_rows
from tracking.detections import Detections, log_odds_from_probability
from tracking.field_of_view import FieldOfView
from tracking.io.kitti_oxts import EGO_FROM_CAM, read_oxts

LABEL_FOLDERS = ("label", "label_02")
FRAME_US = 100_000
# The files do not contain the image size; a few drives have slightly smaller images.
WIDTH_PX, HEIGHT_PX = 1242, 375
KINDS = {1: "pedestrian", 2: "car", 3: "bicycle"}
# KITTI's own names of the types.
_WORDS = {"pedestrian": "1", "car": "2", "cyclist": "3"}
_NEAREST_M, _HALF_CAR_M = 2.0, 1.5
_DETECTION = ("frame", "type", "x1", "y1", "x2", "y2", "score", "h", "w", "l", "x", "y", "z", "ry", "alpha")


@dataclass(frozen=True, eq=False)
class KittiView(FieldOfView):
    """Field of view of the camera: vehicles ahead that are completely within the image width.

    Attributes:
        projection: (3, 4) pixels from camera coordinates.
    """

    projection: FloatArray

    def sees(self, xy_ego_m: FloatArray) -> BoolArray:
        """See `FieldOfView`."""
        ahead = np.maximum(xy_ego_m[:, 0], _NEAREST_M)
        # Left and right side of a car; the column in the image does not depend on the height.
        sides = -xy_ego_m[:, 1, None] + np.array([-_HALF_CAR_M, _HALF_CAR_M])
        p = self.projection
        depth = (p[2, 2] * ahead + p[2, 3])[:, None]
        column_px = (p[0, 0] * sides + (p[0, 2] * ahead + p[0, 3])[:, None]) / depth
        within = ((column_px > 0) & (column_px < WIDTH_PX - 1)).all(axis=1)
        return np.asarray(within & (xy_ego_m[:, 0] > _NEAREST_M))


@dataclass(frozen=True, kw_only=True, eq=False)
class KittiLabels:
    """Ground truth of one frame: N objects and K DontCare regions.

    Attributes:
        ids: (N,) integers, constant over time.
        types: N type names of KITTI, such as Car and Van.
        truncated: (N,) 0 if completely inside the image.
        occluded: (N,) 0 visible, 1 partly occluded, 2 largely occluded, 3 unknown.
        ground_m: (N, 3) bottom centres, ego frame.
        yaw_rad: (N,) headings, ego frame.
        size_m: (N, 3) width, length, height.
        image_boxes_px: (N, 4) left, top, right, bottom.
        dont_care_px: (K, 4) DontCare regions: left, top, right, bottom.
    """

    ids: IntArray
    types: tuple[str, ...]
    truncated: IntArray
    occluded: IntArray
    ground_m: FloatArray
    yaw_rad: FloatArray
    size_m: FloatArray
    image_boxes_px: FloatArray
    dont_care_px: FloatArray


@dataclass(frozen=True, eq=False)
class KittiFrame:
    """Detections and ego pose of one frame.

    Attributes:
        detections: N detections.
        image_boxes_px: (N, 4) their image boxes: left, top, right, bottom.
        timestamp_us: time at 10 frames per second.
        world_from_ego: (4, 4) ego pose.
    """

    detections: Detections
    image_boxes_px: FloatArray
    timestamp_us: int
    world_from_ego: FloatArray

    def __post_init__(self) -> None:
        """Check shapes.

        Raises:
            ShapeError: if a shape differs or the pose is not a rigid transform.
        """
        check_shape("frame image_boxes_px", self.image_boxes_px, (len(self.detections), 4))
        check_transform("frame world_from_ego", self.world_from_ego)
        for name in ("image_boxes_px", "world_from_ego"):
            copy = getattr(self, name).copy()
            frozen(copy)
            object.__setattr__(self, name, copy)


@dataclass(frozen=True, eq=False)
class KittiSequence:
    """A KITTI tracking sequence.

    Attributes:
        name: name, such as 0003.
        frames: T frames.
        projection: (3, 4) pixels from camera coordinates.
        labels: ground truth of the T frames; None if there is none.
    """

    name: str
    frames: tuple[KittiFrame, ...]
    projection: FloatArray
    labels: tuple[KittiLabels, ...] | None


def input_folders(root: Path) -> list[Path]:
    """Return the folders, there or not, that hold the files of sequences."""
    return [*root.glob("detection_*"), *(root / name for name in ("calib", "pose", "oxts", *LABEL_FOLDERS))]


def read_sequences(root: Path) -> tuple[KittiSequence, ...]:
    """Read all sequences with a detection file, ordered by name.

    Raises:
        DataError: if there are none, there is not exactly one detection folder, or a file is missing, damaged or
            inconsistent with the others.
    """
    folders = [path for path in sorted(root.glob("detection_*")) if path.is_dir()]
    if len(folders) != 1:
        names = ", ".join(path.name for path in folders) or "none"
        raise DataError(f"{root}: expected one folder 'detection_*', got {names}")
    paths = sorted(folders[0].glob("*.txt"))
    if not paths:
        raise DataError(f"{folders[0]}: expected files NNNN.txt, got none")
    rows = {path.stem: _detections(path) for path in paths}
    scores = np.concatenate([table[:, 6] for table in rows.values()])
    if ((scores >= 0) & (scores <= 1)).all():
        for table in rows.values():
            table[:, 6] = log_odds_from_probability(table[:, 6])
    return tuple(_sequence(root, path, rows[path.stem]) for path in paths)


def _sequence(root: Path, path: Path, rows: FloatArray) -> KittiSequence:
    """Return the sequence of a detection file, given its rows (R, 15) with scores in log-odds."""
    calib_path = root / "calib" / path.name
    label_path = next(
        (own for own in (root / name / path.name for name in LABEL_FOLDERS) if own.exists()),
        root / "label" / path.name,
    )
    pose_path, oxts_path = root / "pose" / path.name, root / "oxts" / path.name
    poses = read_oxts(oxts_path, calib_path) if oxts_path.exists() and not pose_path.exists() else _poses(pose_path)
    last = int(rows[:, 0].max(initial=-1))
    if last >= len(poses):
        raise DataError(f"{path}: expected frames below {len(poses)}, the number of poses, got {last}")
    projection = _projection(calib_path)
    view = KittiView(projection)
    frames = tuple(_frame(i, rows[rows[:, 0] == i], poses[i], view) for i in range(len(poses)))
    return KittiSequence(
        path.stem, frames, projection, _labels(label_path, len(poses)) if label_path.exists() else None
    )


def _frame(number: int, rows: FloatArray, world_from_ego: FloatArray, view: KittiView) -> KittiFrame:
    detections = Detections.from_boxes(
        ground_m=rows[:, 10:13] @ EGO_FROM_CAM[:3, :3].T,
        yaw_rad=convert_yaw(rows[:, 13]),
        size_m=rows[:, [8, 9, 7]],
        log_odds=rows[:, 6],
        kind=tuple(KINDS[int(kind)] for kind in rows[:, 1]),
        view=view,
    )
    return KittiFrame(detections, rows[:, 2:6], number * FRAME_US, world_from_ego)


def convert_yaw(rotation_y_rad: FloatArray) -> FloatArray:
    """Convert KITTI's rotations about the camera's y axis to headings in the ego frame, [-pi, pi), or back."""
    return wrap_angle(-rotation_y_rad - np.pi / 2)


# Files ------------------------------------------------------------------------------------------------------------


def _detections(path: Path) -> FloatArray:
    """Return the detection rows (R, 15) of a file."""
    rows = []
    for place, columns in read_rows(path, ","):
        frame, kind, *others = check_columns(place, columns, _DETECTION)
        row = parse_numbers(place, [frame, _WORDS.get(kind.strip().lower(), kind), *others])
        parse_integer(place, "frame", row[0], 0)
        if row[1] not in KINDS:
            raise DataError(f"{place}: expected type 1, 2 or 3, got {row[1]:g}")
        check_size(place, row[7:10])
        rows.append(row)
    return np.array(rows, dtype=np.float64).reshape(-1, len(_DETECTION))


def _poses(path: Path) -> list[FloatArray]:
    """Return world_from_ego (4, 4) of each line."""
    poses = []
    for place, columns in read_rows(path):
        if len(columns) != 12:
            raise DataError(f"{place}: expected 12 numbers, got {len(columns)}")
        pose = np.vstack([np.array(parse_numbers(place, columns)).reshape(3, 4), [0, 0, 0, 1]])
        try:
            check_transform(place, pose)
        except ShapeError as error:
            raise DataError(str(error)) from error
        poses.append(EGO_FROM_CAM @ pose @ EGO_FROM_CAM.T)
    if not poses:
        raise DataError(f"{path}: expected poses, got an empty file")
    return poses


def _projection(path: Path) -> FloatArray:
    """Return the projection P2 (3, 4)."""
    for place, columns in read_rows(path):
        if columns[0].rstrip(":") != "P2":
            continue
        if len(columns) != 13:
            raise DataError(f"{place}: expected 12 numbers after P2, got {len(columns) - 1}")
        projection = np.array(parse_numbers(place, columns[1:])).reshape(3, 4)
        try:
            check_intrinsic(place, projection[:, :3])
        except ShapeError as error:
            raise DataError(str(error)) from error
        return projection
    raise DataError(f"{path}: expected a line P2, got none")


def _labels(path: Path, count: int) -> tuple[KittiLabels, ...]:
    """Return the labels of the first `count` frames."""
    frames: list[list[tuple[str, list[float]]]] = [[] for _ in range(count)]
    for frame, name, row in read_labels(path):
        if frame < count:
            frames[frame].append((name, row))
    return tuple(_frame_labels(rows) for rows in frames)


def _frame_labels(rows: Sequence[tuple[str, list[float]]]) -> KittiLabels:
    objects = [(name, row) for name, row in rows if name != "DontCare"]
    table = np.array([row for _, row in objects]).reshape(-1, len(LABEL) - 1)
    regions = np.array([row[5:9] for name, row in rows if name == "DontCare"]).reshape(-1, 4)
    ids, truncated, occluded = table[:, [1, 2, 3]].T.astype(np.int64)
    return KittiLabels(
        ids=ids,
        types=tuple(name for name, _ in objects),
        truncated=truncated,
        occluded=occluded,
        ground_m=table[:, 12:15] @ EGO_FROM_CAM[:3, :3].T,
        yaw_rad=convert_yaw(table[:, 15]),
        size_m=table[:, [10, 11, 9]],
        image_boxes_px=table[:, 5:9],
        dont_care_px=regions,
    )
