"""COLMAP's list of cameras, cameras.txt: CAMERA_ID MODEL WIDTH HEIGHT PARAMS..., a line for each camera."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from appocc.errors import DataError
from appocc.rigs.calibration.wanted import Wanted
from appocc.rigs.fields import Fields

_LINE = re.compile(r"^\s*(\S+)\s+([A-Z_]+)\s+(\d+)\s+(\d+)((?:\s+\S+)+)\s*$")
# Parameters of each model: f is fx and fy; k1, ... are coefficients.
_MODELS = {
    "SIMPLE_PINHOLE": "f cx cy",
    "PINHOLE": "fx fy cx cy",
    "SIMPLE_RADIAL": "f cx cy k1",
    "RADIAL": "f cx cy k1 k2",
    "OPENCV": "fx fy cx cy k1 k2 p1 p2",
    "FULL_OPENCV": "fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6",
    "SIMPLE_RADIAL_FISHEYE": "f cx cy k1",
    "RADIAL_FISHEYE": "f cx cy k1 k2",
    "OPENCV_FISHEYE": "fx fy cx cy k1 k2 k3 k4",
}


def is_list(text: str) -> bool:
    """Whether a text is a list of cameras."""
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    return bool(lines) and all(_LINE.match(line) for line in lines)


def refuse_images(text: str, path: Path) -> None:
    """Check that a text is not COLMAP's list of images, images.txt.

    Raises:
        DataError: if it is.
    """
    if re.match(r"#.*image list", text, re.IGNORECASE):
        poses = "its poses are in a frame and a scale of COLMAP's own; write position_m and yaw_deg, or ego_from_cam"
        raise DataError(f"{path}: expected COLMAP's cameras.txt, got its images.txt: {poses}")


def camera_keys(text: str, wanted: Wanted) -> dict[str, Any]:
    """Return the keys of a camera, as in a rig file.

    Raises:
        DataError: if there is no such camera, or its lens cannot be read.
    """
    wanted.refuse_poses()
    lines = {match[1]: match for line in text.splitlines() if "#" not in line and (match := _LINE.match(line))}
    name = wanted.choose(list(lines))
    _, model, width, height, rest = lines[name].groups()
    if model not in _MODELS:
        raise DataError(f"{wanted.path}: camera {name}: expected a model of {', '.join(_MODELS)}, got {model}")
    names = _MODELS[model].split()
    read = Fields({name: rest.split()}, wanted.path, "camera")
    values = dict(zip(names, read.numbers(name, [len(names)], f"{_MODELS[model]}", "").tolist(), strict=True))
    fx, fy = values.get("fx", values.get("f", 0.0)), values.get("fy", values.get("f", 0.0))
    # COLMAP counts from the corner of the first pixel, not from its centre.
    cx, cy = values["cx"] - 0.5, values["cy"] - 0.5
    keys: dict[str, Any] = {
        "size_px": [int(width), int(height)],
        "intrinsic": [[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]],
    }
    if model.endswith("FISHEYE"):
        return keys | {"fisheye": {"coefficients": [values.get(f"k{i}", 0.0) for i in range(1, 5)]}}
    order = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
    coefficients = [values.get(each, 0.0) for each in (order if "k6" in values else order[:4])]
    return keys | ({"distortion": coefficients} if any(coefficients) else {})
