"""Where the ego should stand: from a command, the vehicle it is measured from and the road to one free cell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from appocc.checks import BoolArray, FloatArray
from appocc.ego_vehicle import EGO_LENGTH_M, EGO_WIDTH_M
from appocc.geometry import footprints
from grounding.goal.candidates import place_beside, wanted
from grounding.goal.search import Field, Place
from grounding.query import Query
from grounding.referent.scene import SceneModel
from grounding.road.road_map import Road
from grounding.scene_object import SceneObject

_MOVING_MPS = 1.0
# A place that is nearer than this to the best one is told as that.
_MOVED_M = 0.6
_RUNNERS_UP = 3
_LEAST_SCORE = 1e-6


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
    """A target with the reasons for it, or without one the reason why there is none.

    Attributes:
        target: the place, None where nothing fits.
        reasons: sentences that say why.
        route: (K, 2) way to the target, ego frame; None without one.
        runners_up: other good places, each at least a car's length from the target and from each other.
        nearest: where nothing fits, the nearest place at which the ego could stand.
        weighed: all places with their costs, None where there was nothing to weigh.
    """

    target: Target | None
    reasons: tuple[str, ...]
    route: FloatArray | None = None
    runners_up: tuple[Target, ...] = ()
    nearest: Target | None = None
    weighed: Field | None = None

    @cached_property
    def field(self) -> FloatArray | None:
        """(X, Y) cost of all places that would do, infinity elsewhere; None where there was nothing to weigh."""
        return None if self.weighed is None else self.weighed.picture()


def plan(
    query: Query,
    scene: SceneModel,
    road: Road,
    item: SceneObject | None = None,
    partner: SceneObject | None = None,
    forbidden: Sequence[tuple[str, SceneObject]] = (),
) -> Plan:
    """The place that a command asks for.

    Args:
        query: the command.
        scene: where it is given.
        road: the road of that scene.
        item: the vehicle that the relation is measured from, None where the command names none.
        partner: the second one of 'between'.
        forbidden: relations to vehicles in which the place may not be.
    """
    wishes, reasons = wanted(query, road, item, partner)
    if item is not None and item.speed_mps is not None and item.speed_mps > _MOVING_MPS:
        reasons = [*reasons, f"it moves at {item.speed_mps:.0f} m/s: the place is measured from where it is now"]
    if wishes is None:
        return Plan(None, tuple(reasons))
    fields = Field(wishes, scene, road, [one for one in (item, partner) if one], _excluded(forbidden, road))
    best = fields.best(1 + _RUNNERS_UP)
    if not best:
        return _nothing(fields, item, reasons)
    target, *others = (_target(place, scene, road) for place in best)
    route = road.ways.route(target.cell, road.own.middle_m, target.heading_ego_rad)
    return Plan(target, (*reasons, *_why(fields, best[0])), route, tuple(others), None, fields)


def _excluded(forbidden: Sequence[tuple[str, SceneObject]], road: Road) -> BoolArray | None:
    """Cells (X, Y) in a relation to a vehicle that the command rules out."""
    if not forbidden:
        return None
    excluded = np.zeros(road.grid.shape, np.bool_)
    for relation, item in forbidden:
        for wish in place_beside(relation, Query("", "stop"), road, item)[0]:
            excluded[tuple(wish.cells.T)] = True
    return excluded


def _target(place: Place, scene: SceneModel, road: Road, score: float | None = None) -> Target:
    at = road.grid.centre_of(place.cell)
    return Target(
        place.cell,
        at,
        scene.world_xy(at),
        scene.world_heading(place.heading_rad),
        place.heading_rad,
        max(float(np.exp(-place.cost / 2)), _LEAST_SCORE) if score is None else score,
    )


def _why(fields: Field, place: Place) -> list[str]:
    """The gap, the way, and the constraints that moved the place from better ones."""
    road = fields.road
    way_m = float(road.ways.length_m[place.cell])
    reasons = [f"the place is {fields.told(place)}"]
    ideal = fields.ideal(place.wish)
    if ideal is not None:
        moved = float(np.linalg.norm(np.subtract(ideal.cell, place.cell)) * road.grid.cell_m)
        if moved > _MOVED_M:
            reasons.append(f"moved {moved:.1f} m from the best place, which {fields.wrong(ideal)}")
    # The same place in words may be wished for with more than one heading.
    other_wishes = [wish for wish in fields.wishes if wish.words != place.wish.words]
    others = [other for wish in other_wishes if (other := fields.ideal(wish))]
    better = min(others, key=lambda other: other.cost, default=place)
    if better.cost < place.cost - 1e-9:
        reasons.append(f"{better.wish.words} would be better, but the best place there {fields.wrong(better)}")
    along, aside = (float(values[place.cell]) for values in road.own.coordinates)
    if along < -_MOVED_M and abs(aside) < 1.5:
        reasons.append(f"that is {-along:.1f} m behind where we are now")
    return [*reasons, f"the way there is {way_m:.0f} m over free road"]


def _nothing(fields: Field, about: SceneObject | None, reasons: Sequence[str]) -> Plan:
    """Which constraint leaves no place, and the nearest place that would do."""
    road = fields.road
    if not len(road.ways.cells):
        return Plan(None, (*reasons, "no free road around us is known"), weighed=fields)
    best, why = fields.why_none()
    reasons = [*reasons, *why]
    if not why or (best is None and about is None):
        return Plan(None, tuple(reasons), weighed=fields)
    middle = road.grid.centre_of(best.cell) if best else about.centre_m if about else road.own.middle_m
    near = fields.nearest(middle)
    if near is None:
        return Plan(None, tuple(reasons), weighed=fields)
    nearest = _target(near, fields.scene, road, score=_LEAST_SCORE)
    away, (x, y) = float(np.hypot(*(nearest.ego_m - middle))), nearest.ego_m
    where = "there" if best else "it"
    reasons.append(f"the nearest place that would do is {away:.1f} m from {where}, at ({x:.1f}, {y:.1f}) m")
    return Plan(None, tuple(reasons), nearest=nearest, weighed=fields)
