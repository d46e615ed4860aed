"""KITTI-360: folders of calibration, pictures, sweeps, poses and boxes, each with a part for every drive.

Two rectified cameras look ahead, two fisheyes to the sides; the poses are those of the IMU, whose z axis points down.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from appocc.checks import FloatArray, IntArray
from appocc.errors import DataError, ShapeError
from appocc.files import read_text
from appocc.geometry import inverse, transform
from appocc.importers.kitti.boxes360 import boxes_near, read_boxes
from appocc.importers.kitti.geometry import left_out, pinhole, read_times, rising, size_of
from appocc.importers.kitti.log import EGO_VEHICLE, Recording
from appocc.kitti_files import CalibrationFile, read_calibration, rigid
from appocc.lenses import unified_sphere
from appocc.rigs import SourceRig
from appocc.rigs.cutting import cut_rig
from appocc.rigs.source_camera import SourceCamera
from appocc.text_tables import parse_integer, parse_numbers, read_rows
from appocc.yaml_file import parse_yaml, plain_yaml

# Its drawing of the sensors has the IMU as in KITTI, but 0.90 m high; x ahead, y right, z down.
EGO_FROM_POSE = transform(np.diag([1.0, -1.0, -1.0]), [-0.05, 0.32, 0.90])
_PINHOLES = {"image_00": "CAM_FRONT", "image_01": "CAM_STEREO_RIGHT"}
_FISHEYES = {"image_02": "CAM_SIDE_LEFT", "image_03": "CAM_SIDE_RIGHT"}
_FOLDERS = {**dict.fromkeys(_PINHOLES, "data_rect"), **dict.fromkeys(_FISHEYES, "data_rgb")}
_MOST_YAML = 100_000


def read_drive(root: Path, name: str) -> Recording:
    """Read a drive, such as 2013_05_28_drive_0000_sync.

    Raises:
        DataError: if a file is missing or damaged.
    """
    calibration = root / "calibration"
    poses = read_calibration(calibration / "calib_cam_to_pose.txt")
    found = {camera: min((_folder(root, name, camera)).glob("*.png"), default=None) for camera in _FOLDERS}
    pictures = {camera: path for camera, path in found.items() if path is not None}
    if not pictures:
        raise DataError(f"{root / 'data_2d_raw' / name}: expected pictures image_00/data_rect/*.png, got none")
    numbers, times, world_from_ego = _frames(root, name, next(iter(pictures)))
    swept = (root / "data_3d_raw" / name / "velodyne_points" / "data").is_dir()
    path = root / "data_3d_bboxes" / "train" / f"{name}.xml"
    boxes = read_boxes(path) if path.is_file() else ()
    notes = left_out({box.kind for box in boxes}) if path.is_file() else (f"no {path.name}: no boxes",)
    return Recording(
        numbers=numbers,
        times_us=times,
        world_from_ego=world_from_ego,
        rig=_rig(calibration, poses, pictures),
        ego_from_velo=_ego_from_velo(calibration, poses) if swept else None,
        picture=partial(_picture, root, name),
        sweep=partial(_sweep, root, name),
        boxes=partial(boxes_near, boxes),
        notes=notes,
    )


def _frames(root: Path, name: str, camera: str) -> tuple[IntArray, IntArray, FloatArray]:
    """Return the numbers (N,), times (N,) and ego poses (N, 4, 4) of the frames with a pose: those that moved."""
    path = root / "data_poses" / name / "poses.txt"
    numbers, poses = [], []
    for place, columns in read_rows(path):
        row = parse_numbers(place, columns)
        if len(row) != 13:
            raise DataError(f"{place}: expected a frame and 12 numbers, got {len(row)} columns")
        numbers.append(parse_integer(place, "frame", row[0], 0))
        poses.append(rigid(place, np.array(row[1:]).reshape(3, 4)))
    if not numbers:
        raise DataError(f"{path}: expected poses, got an empty file")
    clock_path = root / "data_2d_raw" / name / camera / "timestamps.txt"
    clock = read_times(clock_path)
    if max(numbers) >= len(clock):
        raise DataError(f"{clock_path}: expected {max(numbers) + 1} times, as frames with poses, got {len(clock)}")
    times = clock[numbers]
    kept = rising(times)
    return np.array(numbers)[kept], times[kept], (np.array(poses) @ inverse(EGO_FROM_POSE))[kept]


def _rig(calibration: Path, poses: CalibrationFile, pictures: Mapping[str, Path]) -> SourceRig:
    """Return the rig of the cameras with pictures.

    Raises:
        DataError: if a calibration is missing or damaged.
    """
    cameras = []
    for name, picture in pictures.items():
        ego_from_cam = EGO_FROM_POSE @ poses.pose(name)
        if name in _PINHOLES:
            rows = read_calibration(calibration / "perspective.txt")
            rectified_from_cam = transform(rows.numbers(f"R_rect_{name[-2:]}", 3, 3), [0, 0, 0])
            intrinsic = rows.numbers(f"P_rect_{name[-2:]}", 3, 4)[:, :3]
            pose = ego_from_cam @ inverse(rectified_from_cam)
            cameras.append(pinhole(name, _PINHOLES[name], intrinsic, picture, pose))
        else:
            cameras.append(_fisheye(calibration / f"{name}.yaml", name, picture, ego_from_cam))
    return cut_rig(tuple(cameras), EGO_VEHICLE)


def _fisheye(path: Path, name: str, picture: Path, ego_from_cam: FloatArray) -> SourceCamera:
    """Return a fisheye camera from its OpenCV YAML."""
    values: Any = None
    try:
        values = parse_yaml(plain_yaml(read_text(path, _MOST_YAML)))
        mirror, bent, focal = (values[f"{part}_parameters"] for part in ("mirror", "distortion", "projection"))
        numbers = {key: float(value) for part in (mirror, bent, focal) for key, value in part.items()}
        size = int(values["image_width"]), int(values["image_height"])
        lens = unified_sphere(
            numbers["xi"],
            (numbers["k1"], numbers["k2"]),
            (numbers["gamma1"], numbers["gamma2"]),
            (numbers["u0"], numbers["v0"]),
        )
    except (ValueError, TypeError, KeyError, AttributeError, ShapeError) as error:
        raise DataError(
            f"{path}: expected a MEI model with xi, k1, k2, gamma1, gamma2, u0, v0 ({error!r})"
        ) from error
    if size != (taken := size_of(picture)):
        raise DataError(f"{path}: expected the size of {picture}, {taken[0]}x{taken[1]}, got {size[0]}x{size[1]}")
    return SourceCamera(name, _FISHEYES[name], *size, lens, ego_from_cam)


def _ego_from_velo(calibration: Path, poses: CalibrationFile) -> FloatArray:
    """Return the pose of the Velodyne: its calibration is against the unrectified camera 0."""
    path = calibration / "calib_cam_to_velo.txt"
    words = [number for place, columns in read_rows(path) for number in parse_numbers(place, columns)]
    if len(words) != 12:
        raise DataError(f"{path}: expected 12 numbers, got {len(words)}")
    velo_from_cam = rigid(path, np.array(words).reshape(3, 4))
    return np.asarray(EGO_FROM_POSE @ poses.pose("image_00") @ inverse(velo_from_cam))


def _folder(root: Path, name: str, camera: str) -> Path:
    return root / "data_2d_raw" / name / camera / _FOLDERS[camera]


def _picture(root: Path, name: str, camera: str, number: int) -> Path:
    return _folder(root, name, camera) / f"{number:010d}.png"


def _sweep(root: Path, name: str, number: int) -> Path:
    return root / "data_3d_raw" / name / "velodyne_points" / "data" / f"{number:010d}.bin"
