"""Parts of what a relation means: gaps, what is in line, and places where the ego stands free."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from appocc.checks import BoolArray, FloatArray
from benchmarks.grounding_truth.moments import EASY_M, HALF_CELL_M, Moment, Vehicle

# Wanted between bumpers; what people accept beyond it; the least; how far beside the line.
GAP_M = {"park": 1.0, "pull_over": 1.5, "stop": 2.0, "approach": 2.0} | dict.fromkeys(
    ("follow", "overtake", "drive_past"), 6.0
)
GAP_PER_MPS = 1.5
SLACK_M, LEAST_GAP_M, ALIGNED_M = 2.0, 0.3, 1.2
# Clear of vehicles, and how far the heading may be from the lane's; the same with room to spare, and how many such
# places make a case.
MARGIN_M = 0.2
TURN_DEG, EASY_TURN_DEG = 30, 10
EASY_CELLS = 4


class Ask(NamedTuple):
    """What is asked beside the relation.

    Attributes:
        action: park, stop, pull_over, ...
        said_m: a gap (or the way to go) that was named.
        side: side of the road that was named: left, right.
        blobs: whether only the map is known, and so no vehicle's front nor speed.
    """

    action: str
    said_m: float | None = None
    side: str | None = None
    blobs: bool = False


class Region(NamedTuple):
    """Places that are right.

    Attributes:
        cells: (X, Y) those of them.
        best_m: (2,) the best of them.
        yaws_rad: headings of the lane there; the ego's may be 30 degrees off.
    """

    cells: BoolArray
    best_m: FloatArray
    yaws_rad: tuple[float, ...]


def unit(yaw_rad: float) -> FloatArray:
    """(2,) the direction of a heading."""
    return np.array([np.cos(yaw_rad), np.sin(yaw_rad)])


def lanes_near(moment: Moment, v: Vehicle) -> tuple[float, ...]:
    """Headings of a lane near it: its own and ours."""
    return v.yaw_rad, v.yaw_rad + np.pi, moment.our_yaw(v.xy_m[0]), moment.our_yaw(v.xy_m[0]) + np.pi


def wanted_m(ask: Ask, v: Vehicle) -> float:
    """The gap that is best."""
    if ask.said_m is not None:
        return ask.said_m
    speed = v.speed_mps if ask.action == "follow" and not ask.blobs else 0.0
    return GAP_M[ask.action] + GAP_PER_MPS * speed


def is_wanted(gap: FloatArray, ask: Ask, v: Vehicle) -> BoolArray:
    """Where a gap (X, Y) is as wanted."""
    wanted = wanted_m(ask, v)
    if ask.said_m is not None:
        return np.asarray(np.abs(gap - wanted) <= 1 + ask.said_m / 10 + HALF_CELL_M)
    if ask.action in ("follow", "overtake", "drive_past"):
        return np.asarray((gap >= wanted / 2) & (gap <= 1.5 * wanted + SLACK_M))  # nobody measures these
    return np.asarray((gap >= LEAST_GAP_M - HALF_CELL_M) & (gap <= wanted + SLACK_M + HALF_CELL_M))


def in_line(moment: Moment, v: Vehicle, yaw_rad: float, sign: int) -> BoolArray:
    """In line with a vehicle on one side (1 ahead of it in a direction, -1 behind), nobody else in between."""
    along, across = moment.local(v.xy_m, yaw_rad)
    nearest = next_in_line(moment, v, yaw_rad, sign)
    return (np.abs(across) <= ALIGNED_M + HALF_CELL_M) & (sign * along > 0) & (sign * along < nearest)


def next_in_line(moment: Moment, v: Vehicle, yaw_rad: float, sign: int) -> float:
    """How far off the next vehicle in line is, infinity without one."""
    nearest = np.inf
    for other in moment.vehicles:
        ahead, aside = (float((other.xy_m - v.xy_m) @ unit(yaw_rad + turn)) for turn in (0.0, np.pi / 2))
        if sign * ahead > 0.5 and abs(aside) < ALIGNED_M:
            nearest = min(nearest, sign * ahead)
    return float(nearest)


def places(moment: Moment, where: BoolArray, ideal_m: FloatArray, yaws: tuple[float, ...]) -> Region | None:
    """Those of some cells that are admissible, and of the comfortable ones the nearest to the ideal place.

    None where no place is comfortable: whether one squeezes in nobody can say for certain.
    """
    easy = _standing(moment, where & moment.easily_reached, yaws, EASY_TURN_DEG, EASY_M)
    if np.count_nonzero(easy) < EASY_CELLS:
        return None
    away = np.where(easy, np.hypot(*np.moveaxis(moment.centres - ideal_m, -1, 0)), np.inf)
    best = np.unravel_index(int(np.argmin(away)), away.shape)
    return Region(
        _standing(moment, where & moment.reached, yaws, TURN_DEG, MARGIN_M), moment.centres[best].copy(), yaws
    )


def _standing(moment: Moment, where: BoolArray, yaws: Sequence[float], turn_deg: int, margin_m: float) -> BoolArray:
    """Of some cells (X, Y) those where the ego stands free at a heading near one of these."""
    cells, free = np.argwhere(where), np.zeros_like(where)
    for yaw in {round(yaw % np.pi, 3) for yaw in yaws}:  # the footprint is the same both ways round
        for turn in np.radians(sorted(range(-turn_deg, turn_deg + 1), key=abs)):
            if len(cells):
                stands = moment.stands_free(cells, yaw + turn, margin_m)
                free[tuple(cells[stands].T)] = True
                cells = cells[~stands]
    return free
