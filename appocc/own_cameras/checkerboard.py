"""Intrinsics of a camera from pictures of a printed checkerboard."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from appocc.checks import FloatArray
from appocc.errors import AppoccError, DataError
from appocc.files import read_image
from appocc.lenses import DistortedLens, Lens, kannala_brandt
from appocc.own_cameras.fisheye_fit import fit_fisheye

# Fewer views leave the focal length and the distortion open.
_FEWEST = 4


@dataclass(frozen=True, eq=False)
class Intrinsics:
    """Lens of a camera, fitted to checkerboards.

    Attributes:
        lens: the lens.
        size_px: width and height of the pictures.
        intrinsic: (3, 3) K in pixels.
        coefficients: distortion k1, k2, p1, p2, k3, or k1 to k4 of a fisheye.
        fisheye: whether the lens is a fisheye.
        boards: number of pictures with a checkerboard.
        pictures: number of pictures.
        error_px: root mean square of the reprojection error.
    """

    lens: Lens
    size_px: tuple[int, int]
    intrinsic: FloatArray
    coefficients: tuple[float, ...]
    fisheye: bool
    boards: int
    pictures: int
    error_px: float


def fit_intrinsics(
    paths: Sequence[Path],
    corners: tuple[int, int],
    fisheye: bool,
    advance: Callable[[int], None] = lambda count: None,
) -> Intrinsics:
    """Fit the lens of a camera. The size of the squares does not matter.

    Args:
        paths: pictures of the board, from different sides; some should reach the corners of the picture.
        corners: inner corners of the board, across and down.
        fisheye: fit the fisheye of Kannala and Brandt instead of the plumb-bob model.
        advance: progress callback.

    Raises:
        DataError: if a picture is damaged, sizes differ, too few show the board, or the fit fails.
    """
    found: list[FloatArray] = []
    size: tuple[int, int] | None = None
    for path in paths:
        image = read_image(path)
        own = (image.shape[1], image.shape[0])
        if size is not None and own != size:
            raise DataError(
                f"{path}: expected {size[0]}x{size[1]} pixels, as the other pictures, got {own[0]}x{own[1]}"
            )
        size = own
        grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
        seen, places = cv2.findChessboardCornersSB(grey, corners, flags=cv2.CALIB_CB_ACCURACY)
        if seen:
            found.append(np.asarray(places, np.float64).reshape(-1, 2))
        advance(1)
    folder = paths[0].parent if paths else Path()
    if size is None or len(found) < _FEWEST:
        board = f"a board with {corners[0]}x{corners[1]} inner corners"
        raise DataError(f"{folder}: expected at least {_FEWEST} pictures that show {board}, got {len(found)}")
    try:
        return _fit(found, corners, size, fisheye, len(paths))
    except (cv2.error, AppoccError) as error:
        reason = " ".join(str(error).split())[:200]
        raise DataError(f"{folder}: the lens cannot be fitted; add pictures from other sides ({reason})") from error


def _fit(
    found: Sequence[FloatArray], corners: tuple[int, int], size: tuple[int, int], fisheye: bool, pictures: int
) -> Intrinsics:
    columns, rows = corners
    board = np.zeros((rows * columns, 3))
    board[:, :2] = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2)
    lens: Lens
    if fisheye:
        intrinsic, coefficients, error = fit_fisheye(board, found, size)
        lens = kannala_brandt(intrinsic, coefficients.tolist())
    else:
        objects = [board.astype(np.float32) for _ in found]
        images = [each.astype(np.float32)[:, None] for each in found]
        guess = np.array([[size[0], 0, (size[0] - 1) / 2], [0, size[0], (size[1] - 1) / 2], [0, 0, 1]], np.float64)
        rms, k, d, _, _ = cv2.calibrateCamera(objects, images, size, guess, np.zeros(5))
        intrinsic, coefficients = np.array(k, np.float64), np.ravel(d).astype(np.float64)[:5]
        lens, error = DistortedLens(intrinsic, coefficients), float(rms)
    values = tuple(float(value) for value in coefficients)
    return Intrinsics(lens, size, intrinsic, values, fisheye, len(found), pictures, error)
