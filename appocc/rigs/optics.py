"""Lenses of cameras in rig files: intrinsics as a matrix, a focal length or a field of view, and the distortion."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from appocc.checks import FloatArray, check_intrinsic
from appocc.errors import DataError, ShapeError
from appocc.lenses import DistortedLens, FisheyeLens, Lens, kannala_brandt, ocamcalib, polynomial_fisheye
from appocc.lenses.distorted import COUNTS
from appocc.lenses.fisheye import WIDEST_DEG
from appocc.rigs.fields import Fields

INTRINSIC_KEYS = ("fov_deg", "focal_px", "intrinsic")
OPTICS_KEYS = (*INTRINSIC_KEYS, "centre_px", "distortion", "fisheye")
# Keys of a fisheye's model beside those of all.
_MODEL_KEYS = {"kannala_brandt": (), "polynomial": ("aspect",), "ocamcalib": ("affine",)}
_FISHEYE_KEYS = ("model", "coefficients", "aspect", "affine", "circle_deg")
_MATRIX = "[[1000, 0, 959.5], [0, 1000, 539.5], [0, 0, 1]]"
_ONE_FOCAL = "fov_deg: 70, or focal_px: [1000, 1000] with centre_px: [959.5, 539.5]"
_FISHEYE = "fisheye: {model: kannala_brandt, coefficients: [0.05, -0.01, 0.003, -0.001]}"
# Numbers of coefficients of a polynomial.
_POLYNOMIAL = range(1, 17)
_WIDEST_PINHOLE_DEG, _WIDEST_FISHEYE_DEG = 175.0, 280.0


def read_lens(fields: Fields, size_px: tuple[int, int]) -> Lens:
    """Return the lens of a camera of a rig file.

    Args:
        fields: the camera's keys.
        size_px: width and height of its picture.

    Raises:
        DataError: if the file has none, several, or an invalid one.
    """
    if "fisheye" in fields and "distortion" in fields:
        raise fields.refusal("distortion", "either distortion or fisheye, not both")
    try:
        if "fisheye" in fields:
            return _fisheye(fields, size_px)
        return _distorted(fields, size_px)
    except ShapeError as error:
        raise DataError(f"{fields.where}: {error}") from error


def _distorted(fields: Fields, size_px: tuple[int, int]) -> DistortedLens:
    k = np.zeros(COUNTS[0])
    if "distortion" in fields:
        expected = "4, 5 or 8 coefficients of OpenCV: k1, k2, p1, p2, then k3, then k4, k5, k6"
        k = fields.numbers("distortion", COUNTS, expected, "[-0.3, 0.1, 0.001, -0.002, -0.02]")
    unit = DistortedLens(np.eye(3), k)

    def reach(half_rad: float) -> float:
        return float(unit.project(np.array([[np.tan(half_rad), 0.0, 1.0]]))[0, 0])

    return DistortedLens(_intrinsic(fields, size_px, reach, _WIDEST_PINHOLE_DEG), k)


def _fisheye(fields: Fields, size_px: tuple[int, int]) -> FisheyeLens:
    if isinstance(fields["fisheye"], list):
        fields = fields.having(fisheye={"coefficients": fields["fisheye"]})
    parts = fields.inside("fisheye", _FISHEYE_KEYS, _FISHEYE)
    model = parts.text("model", tuple(_MODEL_KEYS), "kannala_brandt")
    for key in ("aspect", "affine"):
        if key in parts and key not in _MODEL_KEYS[model]:
            raise parts.refusal(key, f"nothing for the model {model}")
    wide = parts.number("circle_deg", "how wide the lens sees, in degrees,", 10, _WIDEST_FISHEYE_DEG, 190, WIDEST_DEG)
    if model == "kannala_brandt":
        k = parts.numbers("coefficients", [4], "k1, k2, k3, k4 of cv2.fisheye", "[0.05, -0.01, 0.003, -0.001]")

        def reach(half_rad: float) -> float:
            ray = np.array([[np.sin(half_rad), 0.0, np.cos(half_rad)]])
            return float(kannala_brandt(np.eye(3), k.tolist(), _WIDEST_FISHEYE_DEG).project(ray)[0, 0])

        return kannala_brandt(_intrinsic(fields, size_px, reach, _WIDEST_FISHEYE_DEG), k.tolist(), wide)
    for key in INTRINSIC_KEYS:
        if key in fields:
            raise fields.refusal(key, f"nothing beside fisheye, whose model {model} is in pixels")
    centre = _centre(fields, size_px)
    if model == "polynomial":
        k = parts.numbers(
            "coefficients", _POLYNOMIAL, "c1, c2, ... in pixels per power of the angle", "[340, -32, 48, -7]"
        )
        return polynomial_fisheye(k.tolist(), centre, parts.number("aspect", "a ratio", 0.5, 2, 1.0, 1.0), wide)
    k = parts.numbers(
        "coefficients", _POLYNOMIAL, "a0, a1, ... of the direct mapping", "[-200, 0, 1.7e-3, -1.0e-6, 2.0e-9]"
    )
    affine = np.array([1.0, 0.0, 0.0])
    if "affine" in parts:
        affine = parts.numbers("affine", [3], "c, d, e", "[0.9999, 0.0003, -0.0002]")
    return ocamcalib(k.tolist(), centre, affine.tolist(), wide)


def _intrinsic(
    fields: Fields, size_px: tuple[int, int], reach: Callable[[float], float], most_deg: float
) -> FloatArray:
    """Return K (3, 3).

    Args:
        fields: the camera's keys.
        size_px: width and height of its picture.
        reach: distance from the centre, over the focal length, at an angle from the axis in radians.
        most_deg: largest field of view.

    Raises:
        DataError: if it is not given, given twice, or invalid.
    """
    key = fields.one_of(*INTRINSIC_KEYS, example=_ONE_FOCAL)
    if key == "intrinsic":
        if "centre_px" in fields:
            raise fields.refusal("centre_px", "nothing beside intrinsic, which has the principal point")
        intrinsic = fields.matrix(key, [(3, 3)], "3 rows of 3 numbers in pixels", _MATRIX)
        try:
            check_intrinsic(key, intrinsic)
        except ShapeError as error:
            raise DataError(f"{fields.name(key)}{str(error).removeprefix(key)}, such as {_MATRIX}") from error
        return intrinsic
    if key == "focal_px":
        if not isinstance(fields[key], list):
            fields = fields.having(focal_px=[fields[key]])
        focal = fields.numbers(key, [1, 2], "fx, or fx and fy in pixels", "[1000, 1000]")
        if not (focal > 0).all():
            raise fields.refusal(key, "focal lengths above 0", "[1000, 1000]")
        fx, fy = focal[0], focal[-1]
    else:
        wide_deg = fields.number(key, "the horizontal field of view in degrees,", 1, most_deg, 70)
        slope = reach(np.radians(wide_deg) / 2)
        if not slope > 0:
            raise fields.refusal(key, "a field of view that the lens reaches before its distortion folds the picture")
        fx = fy = size_px[0] / 2 / slope
    across, down = _centre(fields, size_px)
    return np.array([[fx, 0.0, across], [0.0, fy, down], [0.0, 0.0, 1.0]])


def _centre(fields: Fields, size_px: tuple[int, int]) -> tuple[float, float]:
    if "centre_px" not in fields:
        return (size_px[0] - 1) / 2, (size_px[1] - 1) / 2
    across, down = fields.numbers("centre_px", [2], "the pixel on the axis, [u, v]", "[959.5, 539.5]")
    return float(across), float(down)
