"""Rig files: the cameras of a vehicle in YAML."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import fields as dataclass_fields
from pathlib import Path
from typing import Any

from appocc.ego_vehicle import EgoVehicle
from appocc.errors import DataError, ShapeError
from appocc.rigs.calibration import read_calibration
from appocc.rigs.cutting import cut_rig
from appocc.rigs.fields import Fields
from appocc.rigs.mounting import check_degrees, read_mounting
from appocc.rigs.optics import OPTICS_KEYS, read_lens
from appocc.rigs.poses import MATRIX_KEYS, POSE_KEYS
from appocc.rigs.source_camera import SourceCamera
from appocc.rigs.source_rig import SourceRig

ROLES = ("front", "front_left", "front_right", "left", "right", "back", "back_left", "back_right")
_CAMERA_KEYS = ("role", "size_px", "calibration", *OPTICS_KEYS, *POSE_KEYS)
_LEAST_PX, _MOST_PX = 8, 8192
_NAME = re.compile(r"[^/\\\0]{1,60}")
_EXAMPLE_CAMERA = "{size_px: [1920, 1080], fov_deg: 70, position_m: [1.7, 0, 1.5], yaw_deg: 0}"
_EXAMPLE = f"cameras: {{front: {_EXAMPLE_CAMERA}}}"


def read_rig_file(path: Path, values: Any) -> SourceRig:
    """Return the source rig of a rig file.

    Args:
        path: the file, for messages.
        values: its parsed YAML.

    Raises:
        DataError: if it is not a valid rig.
    """
    top = Fields(values, path, "", ("cameras", "ego_vehicle"), _EXAMPLE)
    if "cameras" not in top:
        raise top.refusal("cameras", "the cameras by name", _EXAMPLE)
    listed = top.inside("cameras", (), _EXAMPLE.removeprefix("cameras: "))
    cameras = tuple(_camera(listed, name, path.parent) for name in listed.keys)
    check_degrees(listed)
    _check_channels(top, cameras)
    try:
        return cut_rig(cameras, _ego_vehicle(top))
    except (ShapeError, DataError) as error:
        raise DataError(f"{path}: {str(error).removeprefix(f'{path}: ')}") from error


def _camera(listed: Fields, key: Any, folder: Path) -> SourceCamera:
    name = str(key)
    if not isinstance(key, str | int) or isinstance(key, bool) or not _NAME.fullmatch(name) or name.startswith("."):
        raise DataError(f"{listed.where}: expected a name that its pictures can have, such as front, got {key!r}")
    fields = _with_calibration(listed.inside(key, _CAMERA_KEYS, _EXAMPLE_CAMERA), folder)
    try:
        size = _size_px(fields)
        channel = _channel(fields, name)
        return SourceCamera(name, channel, *size, read_lens(fields, size), read_mounting(fields))
    except ShapeError as error:
        raise DataError(f"{fields.where}: {error}") from error
    except DataError as error:
        if "calibration" not in fields:
            raise
        raise DataError(f"{error}; its calibration file is {_file_of(fields)}") from error


def _file_of(fields: Fields) -> Any:
    asked = fields["calibration"]
    return asked.get("file") if isinstance(asked, dict) else asked


def _with_calibration(fields: Fields, folder: Path) -> Fields:
    """Return the keys of a camera with those of its calibration file."""
    if "calibration" not in fields:
        return fields
    found = read_calibration(fields, folder)
    for key in fields.keys:
        if key in OPTICS_KEYS:
            raise fields.refusal(key, "nothing, as the calibration file has it")
    if "size_px" in fields and "size_px" in found and _size_px(fields) != (size := _size_px(fields.having(**found))):
        raise fields.refusal("size_px", f"nothing, or the size in the calibration file, {size[0]}x{size[1]}")
    if "size_px" not in fields and "size_px" not in found:
        raise fields.refusal("size_px", "the width and height of the picture, which the file lacks", "[1920, 1080]")
    # A pose in the rig file is meant, whatever the calibration file has.
    if any(key in fields for key in ("position_m", *MATRIX_KEYS)):
        found.pop("ego_from_cam", None)
    return fields.having(**found)


def _size_px(fields: Fields) -> tuple[int, int]:
    expected, example = f"width and height of a picture, {_LEAST_PX} to {_MOST_PX} pixels", "[1920, 1080]"
    size = fields.numbers("size_px", [2], expected, example)
    if (size != size.round()).any() or not ((size >= _LEAST_PX) & (size <= _MOST_PX)).all():
        raise fields.refusal("size_px", expected, example)
    return int(size[0]), int(size[1])


def _channel(fields: Fields, name: str) -> str:
    """Return the nuScenes channel of a camera: of its role, else of its name."""
    word = fields.text("role", ROLES) if "role" in fields else name.removeprefix("CAM_")
    return f"CAM_{re.sub('[^A-Z0-9]', '_', word.upper())}"


def _check_channels(top: Fields, cameras: tuple[SourceCamera, ...]) -> None:
    times = Counter(camera.channel for camera in cameras)
    if twice := [camera.name for camera in cameras if times[camera.channel] > 1]:
        names = " and ".join(twice)
        raise DataError(f"{top.name('cameras')}: expected a role or name of its own for each camera, got {names}")


def _ego_vehicle(top: Fields) -> EgoVehicle:
    if "ego_vehicle" not in top:
        return EgoVehicle()
    names = tuple(each.name for each in dataclass_fields(EgoVehicle))
    fields = top.inside("ego_vehicle", names, "{length_m: 4.6, width_m: 1.9}")
    sizes = {
        name: fields.number(name, "metres", 0, 100, getattr(EgoVehicle, name)) for name in names if name in fields
    }
    try:
        return EgoVehicle(**sizes)
    except ShapeError as error:
        raise DataError(f"{fields.where}.{str(error).removeprefix('EgoVehicle: ')}") from error
