"""Calibration files with a camera matrix and distortion coefficients: OpenCV's FileStorage and ROS' camera_info."""

from __future__ import annotations

from typing import Any
from xml.etree.ElementTree import Element

from appocc.errors import DataError
from appocc.rigs.calibration.wanted import Wanted
from appocc.rigs.fields import Fields

# Names in OpenCV's samples, in ROS' files and messages, and those that are usual.
_MATRIX = ("camera_matrix", "Camera_Matrix", "cameraMatrix", "K", "k", "mtx", "intrinsic_matrix", "M")
_DISTORTION = (
    "distortion_coefficients", "Distortion_Coefficients", "distCoeffs", "dist_coeffs", "D", "d", "dist",
)  # fmt: skip
_WIDTH = ("image_width", "image_Width", "width")
_HEIGHT = ("image_height", "image_Height", "height")
_SIZE = ("image_size", "imageSize", "image_Size", "img_size", "resolution", "size")
_FISHEYE_MODELS = ("equidistant", "fisheye", "kannala_brandt", "kannala_brandt4")
_PINHOLE_MODELS = ("plumb_bob", "rational_polynomial", "radtan", "pinhole", "none", "")
# Coefficients that OpenCV writes for lenses; the further ones, of thin prisms and tilted sensors, must be zero.
_LENGTHS = (4, 5, 8)
_ALL_LENGTHS = (4, 5, 8, 14)


def xml_values(root: Element) -> dict[str, Any]:
    """Return the values of OpenCV's FileStorage in XML, numbers as texts, by name."""
    return {each.tag: (each.findtext("data") or each.text or "").split() for each in root}


def is_camera(values: Any) -> bool:
    """Whether parsed YAML has a camera matrix."""
    return isinstance(values, dict) and _first(values, _MATRIX) is not None


def camera_keys(values: dict[str, Any], wanted: Wanted) -> dict[str, Any]:
    """Return the keys of a camera, as in a rig file.

    Raises:
        DataError: if the lens cannot be read.
    """
    if wanted.camera is not None:
        raise DataError(f"{wanted.path}: expected no name of a camera, as there is one only, got '{wanted.camera}'")
    wanted.refuse_poses()
    name = _first(values, _MATRIX) or ""
    flat = _flat(values[name])
    if len(flat) != 9:
        raise DataError(f"{wanted.path}: {name}: expected 3x3 numbers, got {len(flat)}")
    keys: dict[str, Any] = {"intrinsic": [flat[0:3], flat[3:6], flat[6:9]]}
    if (width := _first(values, _WIDTH)) and (height := _first(values, _HEIGHT)):
        keys["size_px"] = [_one(values[width]), _one(values[height])]
    elif (size := _first(values, _SIZE)) and len(_flat(values[size])) == 2:
        keys["size_px"] = _flat(values[size])
    distortion = _distortion_name(values, wanted)
    named = Fields({distortion: _flat(values.get(distortion)) or [0.0]}, wanted.path)
    coefficients = named.numbers(distortion, (), "coefficients", "[-0.3, 0.1, 0.001, -0.002, 0.0]").tolist()
    if _is_fisheye(values, len(coefficients), wanted):
        if len(coefficients) != 4:
            raise DataError(f"{wanted.path}: {distortion}: expected k1 to k4 of a fisheye, got {len(coefficients)}")
        return keys | {"fisheye": {"coefficients": coefficients}}
    if any(coefficients[max(_LENGTHS) :]):
        raise DataError(f"{wanted.path}: {distortion}: expected no thin prism and no tilt, got such a lens")
    if not any(coefficients):
        return keys
    length = next((n for n in _LENGTHS if n >= len(coefficients)), max(_LENGTHS))
    return keys | {"distortion": (coefficients + [0.0] * length)[:length]}


def _distortion_name(values: dict[str, Any], wanted: Wanted) -> str:
    """Return the key of the distortion; a usual one if the file has none.

    Raises:
        DataError: if it has none of a usual name, but another list that may be it: a lens must not be ignored.
    """
    if name := _first(values, _DISTORTION):
        return name
    for key, value in values.items():
        if len(_flat(value)) in _ALL_LENGTHS:
            raise DataError(f"{wanted.path}: expected distortion_coefficients, got none; is it '{key}'? Rename it")
    return _DISTORTION[0]


def _is_fisheye(values: dict[str, Any], count: int, wanted: Wanted) -> bool:
    """Whether the model is cv2.fisheye's, as the file says, or else the rig file.

    Raises:
        DataError: if the file names another model, or neither tells what four coefficients are.
    """
    said = values.get("distortion_model", values.get("camera_model"))
    if said is None and isinstance(values.get("fisheye_model"), int):
        said = "fisheye" if values["fisheye_model"] else "pinhole"
    if said is None and wanted.model is None and count == _LENGTHS[0]:
        example = f"calibration: {{file: {wanted.path.name}, model: fisheye}}"
        raise DataError(
            f"{wanted.path}: expected model: pinhole or model: fisheye, such as {example}, got 4 coefficients"
        )
    if said is None:
        return wanted.model == "fisheye"
    name = str(said).strip().lower()
    if name not in (*_FISHEYE_MODELS, *_PINHOLE_MODELS):
        known = ", ".join(each for each in (*_PINHOLE_MODELS[:2], _FISHEYE_MODELS[0]))
        raise DataError(f"{wanted.path}: distortion_model: expected {known}, got '{name[:60]}'")
    return name in _FISHEYE_MODELS


def _first(values: dict[str, Any], names: tuple[str, ...]) -> str | None:
    return next((name for name in names if values.get(name) is not None), None)


def _one(value: Any) -> Any:
    """Return a number, alone or in a list of XML."""
    return value[0] if isinstance(value, list) and len(value) == 1 else value


def _flat(value: Any) -> list[Any]:
    """Return the numbers of a matrix: rows, a flat list, or `data` with its numbers of rows and columns."""
    value = value.get("data") if isinstance(value, dict) else value
    if not isinstance(value, list):
        return []
    return [each for row in value for each in (row if isinstance(row, list) else [row])]
