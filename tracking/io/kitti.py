"""KITTI tracking sequences: a detector's boxes, poses and labels from a folder, moment by moment for the tracker.

The folder holds, for each sequence NNNN:

- `detection_*/NNNN.txt` (one such folder): rows `frame,type,x1,y1,x2,y2,score,h,w,l,x,y,z,ry,alpha`; type 1 is a
  pedestrian, 2 a car, 3 a cyclist. If all scores of the folder lie in 0..1 they are taken as probabilities, else as
  log-odds.
- `calib/NNNN.txt`: the row `P2:` with the 3x4 projection of the left colour camera.
- `pose/NNNN.txt`: a row of 12 numbers for each frame of the sequence, the upper 3x4 of world_from_camera.
- `label/NNNN.txt`, if there is truth: KITTI's label rows.

KITTI's camera looks along z, x right and y down. The ego frame here is the same camera turned: x ahead, y left, z up,
the origin in the camera; the world is turned alike.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from appocc.boxes import LARGEST_M
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
from appocc.geometry import transform, wrap_angle
from tracking.detections import Detections, TakesDetections, View, boxes_as_detections, lead, log_odds_of
from tracking.io.text_tables import lines, numbers, whole
from tracking.tracks import Track

EGO_FROM_CAM = transform([[0, 0, 1], [-1, 0, 0], [0, -1, 0]], [0, 0, 0])
FRAME_US = 100_000
# No file says it; the pictures of a few drives are some pixels smaller.
WIDTH_PX, HEIGHT_PX = 1242, 375
KINDS = {1: "pedestrian", 2: "car", 3: "bicycle"}
_NEAREST_M, _HALF_CAR_M = 2.0, 1.5
_DETECTION = ("frame", "type", "x1", "y1", "x2", "y2", "score", "h", "w", "l", "x", "y", "z", "ry", "alpha")
_LABEL = ("frame", "id", "type", "truncated", "occluded", "alpha", *_DETECTION[2:6], *_DETECTION[7:14])


@dataclass(frozen=True)
class KittiView(View):
    """What a detector of the camera can find: vehicles ahead that are wholly within the picture's width.

    Attributes:
        projection: (3, 4) pixels from camera coordinates.
    """

    projection: FloatArray

    def sees(self, xy_ego_m: FloatArray) -> BoolArray:
        """See `tracking.detections.View`."""
        ahead = np.maximum(xy_ego_m[:, 0], _NEAREST_M)
        # To the left and to the right; the height does not tell where in the width a place is.
        sides = -xy_ego_m[:, 1, None] + np.array([-_HALF_CAR_M, _HALF_CAR_M])
        p = self.projection
        depth = (p[2, 2] * ahead + p[2, 3])[:, None]
        column_px = (p[0, 0] * sides + (p[0, 2] * ahead + p[0, 3])[:, None]) / depth
        within = ((column_px > 0) & (column_px < WIDTH_PX - 1)).all(axis=1)
        return np.asarray(within & (xy_ego_m[:, 0] > _NEAREST_M))


@dataclass(frozen=True)
class KittiLabels:
    """The truth of one frame: N objects, and regions of the picture in which objects were not marked.

    Attributes:
        ids: (N,) whole numbers, the same over time.
        types: N names as KITTI has them, such as Car and Van.
        truncated: (N,) 0: wholly in the picture.
        occluded: (N,) 0 visible, 1 partly, 2 largely hidden, 3 unknown.
        ground_m: (N, 3) bottom centres, ego frame.
        yaw_rad: (N,) headings, ego frame.
        size_m: (N, 3) width, length, height.
        image_boxes_px: (N, 4) left, top, right, bottom.
        dont_care_px: (K, 4) the regions, alike.
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


@dataclass(frozen=True)
class KittiFrame:
    """One frame.

    Attributes:
        detections: N boxes of the detector.
        image_boxes_px: (N, 4) left, top, right, bottom of the same in the picture.
        timestamp_us: its time, 10 frames a second.
        world_from_ego: (4, 4) pose.
    """

    detections: Detections
    image_boxes_px: FloatArray
    timestamp_us: int
    world_from_ego: FloatArray

    def __post_init__(self) -> None:
        """Check shapes.

        Raises:
            ShapeError: if one does not fit.
        """
        check_shape("frame image_boxes_px", self.image_boxes_px, (len(self.detections), 4))
        check_transform("frame world_from_ego", self.world_from_ego)
        frozen(self.image_boxes_px)
        frozen(self.world_from_ego)


@dataclass(frozen=True)
class KittiSequence:
    """One sequence.

    Attributes:
        name: such as 0003.
        frames: T frames.
        projection: (3, 4) pixels from camera coordinates.
        labels: the truth of the T frames; None where there is none.
    """

    name: str
    frames: tuple[KittiFrame, ...]
    projection: FloatArray
    labels: tuple[KittiLabels, ...] | None


def track_sequence(
    sequence: KittiSequence, tracker: TakesDetections, advance: Callable[[int], None] = lambda _: None
) -> tuple[tuple[Track, ...], ...]:
    """Lead a fresh tracker through a sequence; the tracks of each frame. `advance` as in `lead`."""
    return lead(tracker, sequence.frames, advance)


def read_sequences(root: Path) -> tuple[KittiSequence, ...]:
    """All sequences that have a file of detections, by name.

    Raises:
        DataError: if there are none, or not one folder of detections, or a file is missing, damaged or does not fit
            the others.
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
            table[:, 6] = log_odds_of(table[:, 6])
    return tuple(_sequence(root, path, rows[path.stem]) for path in paths)


def _sequence(root: Path, path: Path, rows: FloatArray) -> KittiSequence:
    """The sequence of a file of detections, which are rows (R, 15) with scores in log-odds."""
    poses_path, label_path = root / "pose" / path.name, root / "label" / path.name
    poses = _poses(poses_path)
    last = int(rows[:, 0].max(initial=-1))
    if last >= len(poses):
        raise DataError(f"{path}: expected frames below {len(poses)}, the number of poses, got {last}")
    projection = _projection(root / "calib" / path.name)
    view = KittiView(projection)
    frames = tuple(_frame(i, rows[rows[:, 0] == i], poses[i], view) for i in range(len(poses)))
    return KittiSequence(
        path.stem, frames, projection, _labels(label_path, len(poses)) if label_path.exists() else None
    )


def _frame(number: int, rows: FloatArray, world_from_ego: FloatArray, view: KittiView) -> KittiFrame:
    detections = boxes_as_detections(
        rows[:, 10:13] @ EGO_FROM_CAM[:3, :3].T,
        ego_yaw(rows[:, 13]),
        rows[:, [8, 9, 7]],
        rows[:, 6].copy(),
        tuple(KINDS[int(kind)] for kind in rows[:, 1]),
        view,
    )
    return KittiFrame(detections, rows[:, 2:6], number * FRAME_US, world_from_ego)


def ego_yaw(rotation_y_rad: FloatArray) -> FloatArray:
    """Headings in the ego frame, [-pi, pi), of KITTI's turns about the camera's y axis; it is its own inverse."""
    return wrap_angle(-rotation_y_rad - np.pi / 2)


# Files ------------------------------------------------------------------------------------------------------------


def _counted(place: str, columns: list[str], names: Sequence[str]) -> list[str]:
    if len(columns) != len(names):
        raise DataError(f"{place}: expected {len(names)} columns ({' '.join(names)}), got {len(columns)}")
    return columns


def _sized(place: str, h_w_l: Sequence[float]) -> None:
    if min(h_w_l) <= 0:
        raise DataError(f"{place}: expected positive h, w and l, got {min(h_w_l):g} m")
    if max(h_w_l) > LARGEST_M:
        raise DataError(f"{place}: expected h, w and l up to {LARGEST_M:g} m, got {max(h_w_l):g} m")


def _detections(path: Path) -> FloatArray:
    """(R, 15) rows."""
    rows = []
    for place, columns in lines(path, ","):
        row = numbers(place, _counted(place, columns, _DETECTION))
        whole(place, "frame", row[0], 0)
        if row[1] not in KINDS:
            raise DataError(f"{place}: expected type 1, 2 or 3, got {row[1]:g}")
        _sized(place, row[7:10])
        rows.append(row)
    return np.array(rows, dtype=np.float64).reshape(-1, len(_DETECTION))


def _poses(path: Path) -> list[FloatArray]:
    """world_from_ego (4, 4) of each line."""
    poses = []
    for place, columns in lines(path):
        if len(columns) != 12:
            raise DataError(f"{place}: expected 12 numbers, got {len(columns)}")
        pose = np.vstack([np.array(numbers(place, columns)).reshape(3, 4), [0, 0, 0, 1]])
        try:
            check_transform(place, pose)
        except ShapeError as error:
            raise DataError(str(error)) from error
        poses.append(EGO_FROM_CAM @ pose @ EGO_FROM_CAM.T)
    if not poses:
        raise DataError(f"{path}: expected poses, got an empty file")
    return poses


def _projection(path: Path) -> FloatArray:
    """P2 (3, 4)."""
    for place, columns in lines(path):
        if columns[0].rstrip(":") != "P2":
            continue
        if len(columns) != 13:
            raise DataError(f"{place}: expected 12 numbers after P2, got {len(columns) - 1}")
        projection = np.array(numbers(place, columns[1:])).reshape(3, 4)
        try:
            check_intrinsic(place, projection[:, :3])
        except ShapeError as error:
            raise DataError(str(error)) from error
        return projection
    raise DataError(f"{path}: expected a line P2, got none")


def _labels(path: Path, count: int) -> tuple[KittiLabels, ...]:
    """The truth of the first `count` frames."""
    frames: list[list[tuple[str, list[float]]]] = [[] for _ in range(count)]
    taken: set[tuple[int, int]] = set()
    for place, columns in lines(path):
        name = _counted(place, columns, _LABEL).pop(2)
        row = numbers(place, columns)
        frame = whole(place, "frame", row[0], 0)
        if name != "DontCare":
            key = frame, whole(place, "id", row[1], 0)
            if key in taken:
                raise DataError(f"{place}: expected one label of object {key[1]} in frame {frame}, got two")
            taken.add(key)
            for state, number in zip(("truncated", "occluded"), row[2:4], strict=True):
                whole(place, state, number, -1)
            _sized(place, row[9:12])
        if frame < count:
            frames[frame].append((name, row))
    return tuple(_labels_of(rows) for rows in frames)


def _labels_of(rows: Sequence[tuple[str, list[float]]]) -> KittiLabels:
    objects = [(name, row) for name, row in rows if name != "DontCare"]
    table = np.array([row for _, row in objects]).reshape(-1, len(_LABEL) - 1)
    regions = np.array([row[5:9] for name, row in rows if name == "DontCare"]).reshape(-1, 4)
    ids, truncated, occluded = table[:, [1, 2, 3]].T.astype(np.int64)
    return KittiLabels(
        ids,
        tuple(name for name, _ in objects),
        truncated,
        occluded,
        table[:, 12:15] @ EGO_FROM_CAM[:3, :3].T,
        ego_yaw(table[:, 15]),
        table[:, [10, 11, 9]],
        table[:, 5:9],
        regions,
    )
