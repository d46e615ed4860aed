"""Where the ego should stand: from the relation and the vehicle it is measured from to one free cell of the map."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from appocc.checks import FloatArray
from appocc.drawing import EGO_LENGTH_M, EGO_WIDTH_M
from appocc.geometry import footprints, wrap_angle
from grounding.field import Field, Wish
from grounding.query import Query
from grounding.scene import Scene, SceneObject

# Beyond this angle to the ego's heading a vehicle faces us, and within this distance from our path it stands in it.
_FACING_RAD = np.radians(120)
_OUR_PATH_M = 4.5
_FAR_SIDE = 0.8
_MOVING_MPS = 1.0


@dataclass(frozen=True)
class Target:
    """The place for the middle of the ego's footprint (4.6 m x 1.9 m).

    Attributes:
        cell: (i, j) index of the grid.
        ego_m: (2,) centre of that cell, ego frame.
        world_m: (2,) the same in the world.
        heading_rad: heading in the world.
        heading_ego_rad: heading relative to the ego's present one.
        score: 0..1, one where nothing moved it from the best place.
    """

    cell: tuple[int, int]
    ego_m: FloatArray
    world_m: FloatArray
    heading_rad: float
    heading_ego_rad: float
    score: float

    def footprint(self) -> FloatArray:
        """Corners (4, 2) of the ego at the target, in the present ego frame."""
        return footprints(self.ego_m, self.heading_ego_rad, [EGO_LENGTH_M, EGO_WIDTH_M])


@dataclass(frozen=True)
class Plan:
    """A target with the reasons for it, or without one the reason why there is none."""

    target: Target | None
    reasons: tuple[str, ...]


def plan(query: Query, item: SceneObject, scene: Scene) -> Plan:
    """The target of a query beside the vehicle it is measured from."""
    heading, wishes, reasons = _wishes(query, item)
    if item.speed_mps is not None and item.speed_mps > _MOVING_MPS:
        reasons.append(f"it moves at {item.speed_mps:.0f} m/s: the place is measured from where it is now")
    fields = [Field(query, wish, item, heading, scene) for wish in wishes]
    best = min(fields, key=lambda one: one.best_cost())
    if not np.isfinite(best.best_cost()):
        return Plan(None, (*reasons, *(one.why_none() for one in fields)))
    index = best.chosen()
    cell = best.cells[index]
    at = scene.bev.grid.centre_of(cell)
    target = Target(
        (int(cell[0]), int(cell[1])),
        at,
        scene.world_xy(at),
        scene.world_heading(heading),
        heading,
        float(np.exp(-best.best_cost() / 2)),
    )
    better = [one for one in fields if one.wished_cost() < best.best_cost() - 1e-9 and one is not best]
    return Plan(target, (*reasons, *best.why_here(index), *(one.why_not_here() for one in better)))


def _along(yaw_rad: float) -> float:
    """The direction of an axis that is nearer to the ego's heading; it flips where the axis lies across our path."""
    turned = float(wrap_angle(yaw_rad))
    return turned if abs(turned) <= np.pi / 2 else float(wrap_angle(turned + np.pi))


def _as_we_see_it(yaw_rad: float) -> float:
    """The half-axis of a vehicle, lengthwise or across, nearest to the ego's heading: at most 45 degrees from it.

    A quarter turn to its left is then the half-axis nearest to the ego's left, whichever way the vehicle stands.
    """
    return float((yaw_rad + np.pi / 4) % (np.pi / 2) - np.pi / 4)


def _unit(angle_rad: float) -> FloatArray:
    return np.array([np.cos(angle_rad), np.sin(angle_rad)])


def _wishes(query: Query, item: SceneObject) -> tuple[float, list[Wish], list[str]]:
    """The ego's heading, ways to satisfy the relation, best first, and the frame of reference in words."""
    if query.relation in ("behind", "in_front_of"):
        return _at_an_end(query.relation, item)
    if query.relation == "next_to":
        heading = _along(item.yaw_rad)
        return heading, _sides(item, heading), []
    heading = _as_we_see_it(item.yaw_rad)
    sides, forward = _sides(item, heading), _unit(heading)
    if query.relation in ("left_of", "right_of"):
        return heading, [replace(sides[query.relation == "right_of"], cost=0.0)], [_whose_sides(item)]
    ways = [*sides, Wish("short of it", -forward, True), Wish("beyond it", forward, True)]
    dislike = (1.0, 1.0, 0.0, 2.0) if query.relation == "toward" else (0.0, 0.0, 0.5, 0.5)
    return heading, [replace(way, cost=way.cost + more) for way, more in zip(ways, dislike, strict=True)], []


def _sides(item: SceneObject, heading: float) -> list[Wish]:
    """Both sides of a vehicle, left and right of a heading; the one towards us is the better."""
    left = _unit(heading + np.pi / 2)
    towards_left = float(item.centre_m @ left) < 0
    return [
        Wish(_seen(left), left, False, 0.0 if towards_left else _FAR_SIDE),
        Wish(_seen(-left), -left, False, _FAR_SIDE if towards_left else 0.0),
    ]


def _seen(axis: FloatArray) -> str:
    """Where a place lies from the vehicle, as the ego sees it."""
    x, y = axis
    if abs(y) > abs(x) - 1e-9:
        return "left of it" if y > 0 else "right of it"
    return "beyond it" if x > 0 else "short of it"


def _whose_sides(item: SceneObject) -> str:
    """Whose left and right they are, and why not the vehicle's where those are others."""
    turn = item.yaw_rad - _as_we_see_it(item.yaw_rad)
    ours = "left and right are ours, as we see the vehicle"
    if abs(np.sin(turn)) > 0.5:
        return f"{ours}: it stands across our way, so the place is at its end"
    return f"{ours}, which faces us" if item.front_known and np.cos(turn) < 0 else ours


def _at_an_end(relation: str, item: SceneObject) -> tuple[float, list[Wish], list[str]]:
    """Heading, wish and frame of reference for a place before or behind a vehicle."""
    word = relation.replace("_", " ")
    facing = abs(float(wrap_angle(item.yaw_rad))) > _FACING_RAD
    ours, own = _as_we_see_it(item.yaw_rad), _along(item.yaw_rad)
    heading, front, reasons = own, _unit(item.yaw_rad), []
    if not item.front_known:
        heading, front = ours, _unit(ours)
        reasons = [f"its front is not known: '{word}' is taken along our own direction of travel"]
    elif facing and (item.speed_mps is None or item.speed_mps < 0.5) and abs(item.centre_m[1]) < _OUR_PATH_M:
        front = _unit(own)
        reasons = [f"it stands facing us beside our path: '{word}' is taken along our direction of travel"]
    elif facing:
        far = "far" if relation == "behind" else "near"
        reasons = [f"it faces us: '{word}' is taken from the vehicle itself, so that the place is at its {far} end"]
    return heading, [Wish(f"{word} it", -front if relation == "behind" else front, True)], reasons
