"""KITTI's tracking benchmark: a folder `training` or `testing` with a folder or file of each sensor and sequence."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np

from appocc.checks import FloatArray
from appocc.errors import DataError
from appocc.geometry import inverse, transform
from appocc.importers.kitti.geometry import CHANNELS, EGO_FROM_IMU, annotation, left_out, pinhole_rig
from appocc.importers.kitti.log import Recording
from appocc.kitti_files import CAM_FROM_LIDAR, LIDAR_FROM_IMU, RECTIFY, oxts_poses, read_calibration, read_labels
from appocc.nuscenes.writer import Annotation
from appocc.text_tables import read_rows

FRAME_US = 100_000
_NO_TIMES = "no times are published: frames are 0.1 s apart, from 1970"
# Type, bottom centre x, y, z, rotation about y, and width, length, height of the objects of a frame, by name.
Labels = dict[int, list[tuple[str, str, FloatArray, tuple[float, float, float]]]]


def read_sequence(folder: Path, name: str) -> Recording:
    """Read a sequence.

    Raises:
        DataError: if a file is missing or damaged.
    """
    calibration = read_calibration(folder / "calib" / f"{name}.txt")
    rectify = transform(calibration.numbers(RECTIFY, 3, 3), [0, 0, 0])
    rect_from_velo = rectify @ calibration.pose(CAM_FROM_LIDAR)
    ego_from_velo = EGO_FROM_IMU @ inverse(calibration.pose(LIDAR_FROM_IMU))
    ego_from_rect = ego_from_velo @ inverse(rect_from_velo)
    found = {camera: min((folder / camera / name).glob("*.png"), default=None) for camera in CHANNELS}
    pictures = {camera: path for camera, path in found.items() if path is not None}
    if not pictures:
        raise DataError(f"{folder / 'image_02' / name}: expected pictures *.png, got none")
    projections = {camera: calibration.numbers(f"P{int(camera[-2:])}", 3, 4) for camera in pictures}
    poses = oxts_poses(read_rows(folder / "oxts" / f"{name}.txt")) @ inverse(EGO_FROM_IMU)
    if not len(poses):
        raise DataError(f"{folder / 'oxts' / f'{name}.txt'}: expected poses, got an empty file")
    path = folder / "label_02" / f"{name}.txt"
    labels, kinds = _labels(path) if path.is_file() else ({}, set())
    return Recording(
        numbers=np.arange(len(poses)),
        times_us=np.arange(len(poses)) * FRAME_US,
        world_from_ego=np.asarray(poses),
        rig=pinhole_rig(ego_from_rect, projections, pictures),
        ego_from_velo=ego_from_velo if (folder / "velodyne" / name).is_dir() else None,
        picture=partial(_picture, folder, name),
        sweep=partial(_sweep, folder, name),
        boxes=partial(_boxes, labels, ego_from_rect),
        notes=(_NO_TIMES, *(left_out(kinds) if path.is_file() else (f"no label_02/{name}.txt: no boxes",))),
    )


def _labels(path: Path) -> tuple[Labels, set[str]]:
    """Return the objects by frame, and all types."""
    labels: Labels = {}
    kinds = set()
    for frame, kind, row in read_labels(path):
        kinds.add(kind)
        height, width, length = row[9:12]
        labels.setdefault(frame, []).append((f"{row[1]:.0f}", kind, np.array(row[12:16]), (width, length, height)))
    return labels, kinds


def _boxes(
    labels: Labels, ego_from_rect: FloatArray, number: int, world_from_ego: FloatArray
) -> tuple[Annotation, ...]:
    """Return the boxes of a frame: they are in the rectified reference camera's frame, as all its projections are."""
    found = []
    for instance, kind, (x, y, z, turn), size in labels.get(number, []):
        cos, sin = np.cos(turn), np.sin(turn)
        # Columns: along the length, to its left, up (the camera's -y).
        pose = transform(np.array([[cos, sin, 0.0], [0, 0, -1], [-sin, cos, 0]]), [x, y, z])
        found.append(annotation(instance, kind, world_from_ego @ ego_from_rect @ pose, size))
    return tuple(box for box in found if box is not None)


def _picture(folder: Path, sequence: str, camera: str, number: int) -> Path:
    return folder / camera / sequence / f"{number:06d}.png"


def _sweep(folder: Path, sequence: str, number: int) -> Path:
    return folder / "velodyne" / sequence / f"{number:06d}.bin"
