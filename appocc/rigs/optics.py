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
# Radians, millimetres and shares of the width are below.
_NARROWEST_DEG, _WIDEST_PINHOLE_DEG, _WIDEST_FISHEYE_DEG = 5.0, 175.0, 280.0
_FOCAL_PER_WIDTH = (0.02, 12.0)
# Share of the middle row and column of its picture that a distorting lens must see.
_LEAST_SEEN = 0.6


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

    lens = DistortedLens(_intrinsic(fields, size_px, reach, _WIDEST_PINHOLE_DEG), k)
    if k.any() and (seen := _seen_share(lens, size_px)) < _LEAST_SEEN:
        expected = "k1, k2, p1, p2, ... of OpenCV, with which the lens sees its whole picture"
        got = f"a lens that folds it: {1 - seen:.0%} of a middle row or column is not seen"
        raise DataError(f"{fields.name('distortion')}: expected {expected}, such as [-0.3, 0.1, 0, 0], got {got}")
    return lens


def _seen_share(lens: Lens, size_px: tuple[int, int]) -> float:
    """Return the share of the middle row or column, whichever is less, that a lens sees."""
    across, down = (np.arange(n, dtype=np.float64) for n in size_px)
    row = np.stack([across, np.full_like(across, size_px[1] / 2)], axis=1)
    column = np.stack([np.full_like(down, size_px[0] / 2), down], axis=1)
    return min(float(np.isfinite(lens.unproject(pixels)[:, 2]).mean()) for pixels in (row, column))


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
        _check_pixels(fields, key, intrinsic, size_px)
        return intrinsic
    if key == "focal_px":
        if not isinstance(fields[key], list):
            fields = fields.having(focal_px=[fields[key]])
        focal = fields.numbers(key, [1, 2], "fx, or fx and fy in pixels", "[1000, 1000]")
        if not (focal > 0).all():
            raise fields.refusal(key, "focal lengths above 0", "[1000, 1000]")
        fx, fy = focal[0], focal[-1]
    else:
        wide_deg = fields.number(key, "the horizontal field of view in degrees,", _NARROWEST_DEG, most_deg, 70)
        slope = reach(np.radians(wide_deg) / 2)
        if not slope > 0:
            raise fields.refusal(key, "a field of view that the lens reaches before its distortion folds the picture")
        fx = fy = size_px[0] / 2 / slope
    across, down = _centre(fields, size_px)
    intrinsic = np.array([[fx, 0.0, across], [0.0, fy, down], [0.0, 0.0, 1.0]])
    _check_pixels(fields, key, intrinsic, size_px)
    return intrinsic


def _check_pixels(fields: Fields, key: str, intrinsic: FloatArray, size_px: tuple[int, int]) -> None:
    """Check that intrinsics are in pixels of the picture.

    Raises:
        DataError: if they are not.
    """
    least, most = (share * size_px[0] for share in _FOCAL_PER_WIDTH)
    focal, centre = intrinsic[[0, 1], [0, 1]], intrinsic[:2, 2]
    if not ((focal >= least) & (focal <= most)).all():
        expected = f"focal lengths in pixels, {least:.0f} to {most:.0f} for a picture {size_px[0]} wide"
        got = f"{focal[0]:g} and {focal[1]:g}"
        raise DataError(f"{fields.name(key)}: expected {expected}, such as {_MATRIX}, got {got}")
    # Pictures that were cut out of larger ones may lie beside their axis.
    if (np.abs(centre / size_px - 0.5) > 1.5).any():
        expected = f"a principal point in pixels of a picture of {size_px[0]}x{size_px[1]}"
        got = f"{centre[0]:g}, {centre[1]:g}"
        raise DataError(f"{fields.name(key)}: expected {expected}, such as {_MATRIX}, got {got}")


def _centre(fields: Fields, size_px: tuple[int, int]) -> tuple[float, float]:
    if "centre_px" not in fields:
        return (size_px[0] - 1) / 2, (size_px[1] - 1) / 2
    across, down = fields.numbers("centre_px", [2], "the pixel on the axis, [u, v]", "[959.5, 539.5]")
    return float(across), float(down)
