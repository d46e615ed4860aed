"""Oriented boxes of groups of cells from their second moments, and vehicle shape tests."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from appocc.checks import BoolArray, FloatArray, IntArray

# Length and width of a typical car, van, truck and bus, and penalties for the rarer ones.
TYPICAL_SIZES_M = np.array([(4.6, 1.9), (6.0, 2.2), (8.5, 2.5), (11.5, 2.7)])
RARITY_PENALTY = np.array([0.0, 0.2, 0.4, 0.4])


@dataclass(frozen=True, eq=False)
class OrientedBoxes:
    """Uniform rectangles with the second moments of N groups of cells; metres, radians.

    Attributes:
        centroid_m: (N, 2) centroids.
        yaw_rad: (N,) direction of the long axis in [-pi/2, pi/2); front and rear are not distinguished.
        length_m: (N,) extent along the long axis.
        width_m: (N,) extent across it.
        area_m2: (N,) covered area.
    """

    centroid_m: FloatArray
    yaw_rad: FloatArray
    length_m: FloatArray
    width_m: FloatArray
    area_m2: FloatArray


def fit_oriented_boxes(xy_m: FloatArray, member: IntArray, count: int, cell_m: float) -> OrientedBoxes:
    """Fit boxes to `count` non-empty groups of cells with centres (C, 2); cell c is in group member[c].

    A rectangle of length L has variance L^2 / 12. The variance within a cell (cell^2 / 12 on each axis) is added to
    that of the cell centres, so that a single cell has the size of one cell.
    """
    size = np.bincount(member, minlength=count).astype(np.float64)

    def mean(values: FloatArray) -> FloatArray:
        return np.bincount(member, values, count) / size

    centroid = np.stack([mean(xy_m[:, 0]), mean(xy_m[:, 1])], axis=1)
    dx, dy = (xy_m - centroid[member]).T
    xx, yy, xy = mean(dx * dx), mean(dy * dy), mean(dx * dy)
    own = cell_m**2 / 12
    middle, half = (xx + yy) / 2 + own, np.hypot((xx - yy) / 2, xy)
    yaw = np.arctan2(2 * xy, xx - yy) / 2
    return OrientedBoxes(
        centroid,
        np.where(yaw >= np.pi / 2, yaw - np.pi, yaw),
        np.sqrt(12 * (middle + half)),
        np.sqrt(12 * np.maximum(middle - half, own)),
        size * cell_m**2,
    )


def is_vehicle_shaped(boxes: OrientedBoxes) -> BoolArray:
    """(N,) whether a box can be a single vehicle.

    The cells fill the box (not an L, nor a row with gaps). The box is at most as wide as a construction vehicle and
    as long as a bus, and longer than wide (unlike cars side by side). Long boxes are also wide (unlike two cars
    bumper to bumper, which are as long as a bus but as narrow as a car).
    """
    filled = boxes.area_m2 >= 0.85 * boxes.length_m * boxes.width_m
    short_or_wide = (boxes.length_m <= 6.5) | (boxes.width_m >= 2.2)
    inside = (boxes.length_m <= 16.0) & (boxes.width_m <= 3.7) & (boxes.length_m >= 1.4 * boxes.width_m)
    return np.asarray(filled & short_or_wide & inside)


def size_deviation(boxes: OrientedBoxes) -> FloatArray:
    """(N,) log size deviation from the nearest typical vehicle: 0 for a car, log 2 for twice its length or width."""
    size = np.stack([boxes.length_m, boxes.width_m], axis=1)
    return np.asarray((np.abs(np.log(size[:, None] / TYPICAL_SIZES_M)).sum(axis=2) + RARITY_PENALTY).min(axis=1))
