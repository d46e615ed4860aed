"""The ground of the demo as a picture: surfaces, markings and grain, read at any fineness."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike

from appocc.checks import ByteArray, Float32Array, FloatArray
from appocc.demo.street import (
    HIGH_M,
    LINE_WIDTH_M,
    LOW_M,
    PAVEMENT_M,
    centre_lines,
    drivable_areas,
    lane_lines,
    parking_lanes,
    stop_lines,
)
from appocc.groundtruth.colouring import colour_at

_PX_PER_M = 20
_GRASS, _PAVEMENT, _KERB = (104, 128, 72), (168, 163, 154), (140, 138, 134)
_ASPHALT, _PARKING, _WHITE, _YELLOW = (92, 92, 95), (104, 102, 101), (226, 226, 222), (214, 172, 44)
# Standard deviation of the ground's grain, in parts of its brightness, by size of grain in pixels.
_GRAIN = {1: 0.05, 8: 0.035, 64: 0.03}


@dataclass(frozen=True)
class Ground:
    """The ground as seen from above.

    Attributes:
        levels: pictures, columns along x, rows along y; 0.05 m a pixel, each next one half as fine.
    """

    levels: tuple[ByteArray, ...]

    def colour(self, xy_m: FloatArray, footprint_m: FloatArray) -> Float32Array:
        """(N, 3) colours 0..255 at points (N, 2), street frame, as blurred as a pixel's footprint (N,) there asks."""
        fineness = np.log2(np.maximum(footprint_m * _PX_PER_M, 1.0))
        level = np.minimum(np.round(fineness), len(self.levels) - 1).astype(np.int64)
        rgb = np.zeros((len(xy_m), 3), np.float32)
        for number, picture in enumerate(self.levels):
            here = np.flatnonzero(level == number)
            if len(here):
                rgb[here] = colour_at(picture, (_pixel(xy_m[here]) + 0.5) / 2**number - 0.5)
        return rgb


def _pixel(xy_m: ArrayLike) -> FloatArray:
    """Pixels (..., 2) as (column, row) of points (..., 2); pixel centres lie at whole numbers."""
    return np.asarray((np.asarray(xy_m, dtype=np.float64) - LOW_M) * _PX_PER_M - 0.5)


def make_ground(random: np.random.Generator) -> Ground:
    """Draw the ground: surfaces, then markings, then grain."""
    width, height = ((HIGH_M - LOW_M) * _PX_PER_M).astype(int)
    picture = np.full((height, width, 3), _GRASS, np.uint8)
    for colour, margin in ((_PAVEMENT, PAVEMENT_M), (_KERB, LINE_WIDTH_M), (_ASPHALT, 0.0)):
        for area in drivable_areas():
            outward = np.sign(area - area.mean(axis=0)) * margin
            _fill(picture, area + outward, colour)
    for area in parking_lanes():
        _fill(picture, area, _PARKING)
    for lines, colour in ((lane_lines(), _WHITE), (centre_lines(), _YELLOW)):
        for a, b in lines:
            across = np.array([a[1] - b[1], b[0] - a[0]]) / np.hypot(*(b - a)) * LINE_WIDTH_M / 2
            _fill(picture, np.stack([a + across, b + across, b - across, a - across]), colour)
    for area in stop_lines():
        _fill(picture, area, _WHITE)
    levels = [_with_grain(picture, random)]
    for _ in range(4):
        half = cv2.resize(levels[-1], None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
        levels.append(np.asarray(half, dtype=np.uint8))
    return Ground(tuple(levels))


def _fill(picture: ByteArray, area: FloatArray, colour: tuple[int, int, int]) -> None:
    # OpenCV fills the rim pixels too: the polygon is drawn half a pixel smaller on all sides.
    inward = area - np.sign(area - area.mean(axis=0)) * 0.5 / _PX_PER_M
    cv2.fillConvexPoly(picture, np.round(_pixel(inward)).astype(np.int32), colour)


def _with_grain(picture: ByteArray, random: np.random.Generator) -> ByteArray:
    """The picture with light and dark specks of several sizes, the same in every picture of one seed."""
    height, width = picture.shape[:2]
    grain = np.ones((height, width), np.float32)
    for size, share in _GRAIN.items():
        coarse = random.standard_normal((height // size + 1, width // size + 1), dtype=np.float32)
        grain += share * np.asarray(cv2.resize(coarse, (width, height), interpolation=cv2.INTER_LINEAR))
    return np.asarray(cv2.multiply(picture, cv2.merge([grain] * 3), dtype=cv2.CV_8U), dtype=np.uint8)
