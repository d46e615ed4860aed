"""Oriented boxes of groups of cells by their moments, and whether such a box can be one vehicle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from appocc.checks import BoolArray, FloatArray, IntArray

# Length and width of a usual car, van, lorry and bus, and how much odder than cars these are, being rarer.
USUAL_M = np.array([(4.6, 1.9), (6.0, 2.2), (8.5, 2.5), (11.5, 2.7)])
RARER = np.array([0.0, 0.2, 0.4, 0.4])


@dataclass(frozen=True)
class Shapes:
    """N groups of cells, each as the uniform rectangle with the same second moments; metres, radians.

    Attributes:
        centroid_m: (N, 2) centres of mass.
        yaw_rad: (N,) direction of the long axis in [-pi/2, pi/2): front and rear cannot be told apart.
        length_m: (N,) extent along the long axis.
        width_m: (N,) extent across it.
        area_m2: (N,) covered area.
    """

    centroid_m: FloatArray
    yaw_rad: FloatArray
    length_m: FloatArray
    width_m: FloatArray
    area_m2: FloatArray


def shapes_of(xy_m: FloatArray, member: IntArray, count: int, cell_m: float) -> Shapes:
    """Shapes of `count` groups of cells with centres (C, 2), cell c in group member[c]; no group may be empty.

    A rectangle of length L has variance L^2 / 12 along it. The spread of a cell itself (cell^2 / 12 on either axis)
    is added to that of the cell centres, so that one cell measures one cell.
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
    return Shapes(
        centroid,
        np.where(yaw >= np.pi / 2, yaw - np.pi, yaw),
        np.sqrt(12 * (middle + half)),
        np.sqrt(12 * np.maximum(middle - half, own)),
        size * cell_m**2,
    )


def like_a_vehicle(shapes: Shapes) -> BoolArray:
    """(N,) whether a shape can be one vehicle.

    It fills its box (an L or a row with gaps does not), is no wider than a construction vehicle and no longer than a
    bus, longer than wide (cars side by side are not), and long only where it is wide (two cars bumper to bumper are
    as long as a bus, but as narrow as a car).
    """
    filled = shapes.area_m2 >= 0.85 * shapes.length_m * shapes.width_m
    short_or_wide = (shapes.length_m <= 6.5) | (shapes.width_m >= 2.2)
    inside = (shapes.length_m <= 16.0) & (shapes.width_m <= 3.7) & (shapes.length_m >= 1.4 * shapes.width_m)
    return np.asarray(filled & short_or_wide & inside)


def oddness(shapes: Shapes) -> FloatArray:
    """(N,) how far a shape is from the nearest usual vehicle: 0 of a car, log 2 of one twice as long or wide."""
    size = np.stack([shapes.length_m, shapes.width_m], axis=1)
    return np.asarray((np.abs(np.log(size[:, None] / USUAL_M)).sum(axis=2) + RARER).min(axis=1))
