"""Where the ego should stand: from the relation and the vehicle it is measured from to one free cell of the map."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from appocc.checks import FloatArray
from appocc.geometry import wrap_angle
from grounding.field import Field, Wish
from grounding.query import Query
from grounding.scene import EGO_LENGTH_M, EGO_WIDTH_M, Scene, SceneObject, rectangle

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
        return rectangle(self.ego_m, self.heading_ego_rad, EGO_LENGTH_M, EGO_WIDTH_M)


@dataclass(frozen=True)
class Plan:
    """A target with the reasons for it, or without one the reason why there is none."""

    target: Target | None
    reasons: tuple[str, ...]


def plan(query: Query, item: SceneObject, scene: Scene) -> Plan:
    """The target of a query beside the vehicle it is measured from."""
    heading = _along(item.yaw_rad)
    wishes, reasons = _wishes(query, item, heading)
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
    """The direction of an axis that is nearer to the ego's heading."""
    turned = float(wrap_angle(yaw_rad))
    return turned if abs(turned) <= np.pi / 2 else float(wrap_angle(turned + np.pi))


def _wishes(query: Query, item: SceneObject, heading: float) -> tuple[list[Wish], list[str]]:
    """Ways to satisfy the relation, best first, and the frame of reference in words."""
    forward = np.array([np.cos(heading), np.sin(heading)])
    left = np.array([-forward[1], forward[0]])
    front, reasons = _front(query.relation, item, forward)
    behind, before = Wish("behind it", -front, True), Wish("in front of it", front, True)
    # The side towards us is the better one: the other lies beyond the vehicle.
    towards_left = float(item.centre_m @ left) < 0
    sides = [
        Wish("left of it", left, False, 0.0 if towards_left else _FAR_SIDE),
        Wish("right of it", -left, False, _FAR_SIDE if towards_left else 0.0),
    ]
    if query.relation in ("left_of", "right_of"):
        return [replace(sides[query.relation == "right_of"], cost=0.0)], reasons
    if query.relation in ("behind", "in_front_of"):
        return [behind if query.relation == "behind" else before], reasons
    if query.relation == "next_to":
        return sides, reasons
    ways = [*sides, Wish("short of it", -forward, True), Wish("beyond it", forward, True)]
    dislike = (1.0, 1.0, 0.0, 2.0) if query.relation == "toward" else (0.0, 0.0, 0.5, 0.5)
    return [replace(way, cost=way.cost + more) for way, more in zip(ways, dislike, strict=True)], reasons


def _front(relation: str, item: SceneObject, forward: FloatArray) -> tuple[FloatArray, list[str]]:
    """The direction that counts as the vehicle's front for a relation, and why where it is not plain."""
    own = np.array([np.cos(item.yaw_rad), np.sin(item.yaw_rad)])
    facing = abs(float(wrap_angle(item.yaw_rad))) > _FACING_RAD
    if relation in ("left_of", "right_of"):
        return own, ["left and right are ours, not those of the vehicle, which faces us"] if facing else []
    if relation not in ("behind", "in_front_of"):
        return own, []
    word = relation.replace("_", " ")
    if not item.front_known:
        return forward, [f"its front is not known: '{word}' is taken along our own direction of travel"]
    if not facing:
        return own, []
    standing = item.speed_mps is None or item.speed_mps < 0.5
    if standing and abs(item.centre_m[1]) < _OUR_PATH_M:
        return forward, [f"it stands facing us beside our path: '{word}' is taken along our direction of travel"]
    far = "far" if relation == "behind" else "near"
    return own, [f"it faces us: '{word}' is taken from the vehicle itself, so that the place is at its {far} end"]
