"""Building blocks of relations: gaps, alignment, and admissible places of the ego."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from appocc.checks import BoolArray, FloatArray
from benchmarks.grounding_truth.key_frames import EASY_M, HALF_CELL_M, TrueFrame, Vehicle

# Best gap between bumpers; accepted excess; least gap; lateral tolerance.
GAP_M = {"park": 1.0, "pull_over": 1.5, "stop": 2.0, "approach": 2.0} | dict.fromkeys(
    ("follow", "overtake", "drive_past"), 6.0
)
GAP_PER_MPS = 1.5
SLACK_M, LEAST_GAP_M, ALIGNED_M = 2.0, 0.3, 1.2
# Margin to vehicles and largest angle to the lane; the same for a comfortable place, and how many of them a case
# needs.
MARGIN_M = 0.2
TURN_DEG, EASY_TURN_DEG = 30, 10
EASY_CELLS = 4


class Ask(NamedTuple):
    """Details of a command beyond the relation.

    Attributes:
        action: park, stop, pull_over, ...
        said_m: a named gap, or distance to drive.
        side: named side of the road: left, right.
        blobs: whether only the map is known, without fronts and speeds of vehicles.
    """

    action: str
    said_m: float | None = None
    side: str | None = None
    blobs: bool = False


class Region(NamedTuple):
    """Admissible goals.

    Attributes:
        cells: (X, Y) their cells.
        best_m: (2,) the best goal.
        yaws_rad: headings of the lane there; the ego's may differ by 30 degrees.
    """

    cells: BoolArray
    best_m: FloatArray
    yaws_rad: tuple[float, ...]


def unit(yaw_rad: float) -> FloatArray:
    """Return the unit vector (2,) of a heading."""
    return np.array([np.cos(yaw_rad), np.sin(yaw_rad)])


def lanes_near(moment: TrueFrame, v: Vehicle) -> tuple[float, ...]:
    """Return the lane headings near a vehicle: its own and ours."""
    return v.yaw_rad, v.yaw_rad + np.pi, moment.our_yaw(v.xy_m[0]), moment.our_yaw(v.xy_m[0]) + np.pi


def wanted_m(ask: Ask, v: Vehicle) -> float:
    """Return the best gap."""
    if ask.said_m is not None:
        return ask.said_m
    speed = v.speed_mps if ask.action == "follow" and not ask.blobs else 0.0
    return GAP_M[ask.action] + GAP_PER_MPS * speed


def is_accepted_gap(gap: FloatArray, ask: Ask, v: Vehicle) -> BoolArray:
    """Return the cells where a gap (X, Y) is acceptable."""
    wanted = wanted_m(ask, v)
    if ask.said_m is not None:
        return np.asarray(np.abs(gap - wanted) <= 1 + ask.said_m / 10 + HALF_CELL_M)
    if ask.action in ("follow", "overtake", "drive_past"):
        return np.asarray((gap >= wanted / 2) & (gap <= 1.5 * wanted + SLACK_M))  # rough distances
    return np.asarray((gap >= LEAST_GAP_M - HALF_CELL_M) & (gap <= wanted + SLACK_M + HALF_CELL_M))


def in_line(moment: TrueFrame, v: Vehicle, yaw_rad: float, sign: int) -> BoolArray:
    """Return the cells in line with a vehicle, ahead of it (1) or behind (-1), without a vehicle in between."""
    along, across = moment.local(v.xy_m, yaw_rad)
    nearest = next_in_line(moment, v, yaw_rad, sign)
    return (np.abs(across) <= ALIGNED_M + HALF_CELL_M) & (sign * along > 0) & (sign * along < nearest)


def next_in_line(moment: TrueFrame, v: Vehicle, yaw_rad: float, sign: int) -> float:
    """Return the distance to the next vehicle in line, infinity without one."""
    nearest = np.inf
    for other in moment.vehicles:
        ahead, aside = (float((other.xy_m - v.xy_m) @ unit(yaw_rad + turn)) for turn in (0.0, np.pi / 2))
        if sign * ahead > 0.5 and abs(aside) < ALIGNED_M:
            nearest = min(nearest, sign * ahead)
    return float(nearest)


def places(moment: TrueFrame, where: BoolArray, ideal_m: FloatArray, yaws: tuple[float, ...]) -> Region | None:
    """Return the admissible ones of some cells, and the comfortable one nearest to the ideal place.

    None without a comfortable place: people disagree about tight ones.
    """
    easy = _standing(moment, where & moment.comfortably_reachable, yaws, EASY_TURN_DEG, EASY_M)
    if np.count_nonzero(easy) < EASY_CELLS:
        return None
    away = np.where(easy, np.hypot(*np.moveaxis(moment.centres - ideal_m, -1, 0)), np.inf)
    best = np.unravel_index(int(np.argmin(away)), away.shape)
    return Region(
        _standing(moment, where & moment.reachable, yaws, TURN_DEG, MARGIN_M), moment.centres[best].copy(), yaws
    )


def _standing(
    moment: TrueFrame, where: BoolArray, yaws: Sequence[float], turn_deg: int, margin_m: float
) -> BoolArray:
    """Return those of some cells (X, Y) in which the ego fits at a heading near one of the given ones."""
    cells, free = np.argwhere(where), np.zeros_like(where)
    for yaw in {round(yaw % np.pi, 3) for yaw in yaws}:  # the footprint is symmetric
        for turn in np.radians(sorted(range(-turn_deg, turn_deg + 1), key=abs)):
            if len(cells):
                stands = moment.stands_free(cells, yaw + turn, margin_m)
                free[tuple(cells[stands].T)] = True
                cells = cells[~stands]
    return free
