"""Places that a command rules out: in a relation to a vehicle, or too near to one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from appocc.checks import BoolArray
from grounding.goal.at_landmark import CLEAR_M
from grounding.goal.proposals import propose_relation
from grounding.query import LandmarkRelation, Query
from grounding.referent.predicates import to_referent
from grounding.referent.scene import SceneModel
from grounding.referent.scoring import score_objects
from grounding.road.free_space import gap_m
from grounding.road.road_map import RoadMap
from grounding.scene_object import SceneObject
from grounding.vocabulary import KNOWN_NOUNS

_NEAR = ("near", "at", "toward")


class ExcludedPlace(NamedTuple):
    """A place that is ruled out.

    Attributes:
        relation: the relation to a vehicle or a person.
        item: that vehicle or person.
        distance_m: how far from it the goal must be; None: not said.
    """

    relation: LandmarkRelation
    item: SceneObject
    distance_m: float | None = None


def resolve_exclusions(query: Query, scene: SceneModel) -> tuple[ExcludedPlace, ...]:
    """Return the places at vehicles and people that a query rules out."""
    excluded: list[ExcludedPlace] = []
    for part in query.excluded:
        if part.relation is not None and part.noun in KNOWN_NOUNS and len(scene.table):
            scores = score_objects(Query(""), to_referent(part), scene)
            meant = scores.matches & (scores.probability >= scores.probability.max() / 3)
            items = (scene.table.items[i] for i in np.flatnonzero(meant).tolist())
            excluded += [ExcludedPlace(part.relation, item, part.distance_m) for item in items]
    return tuple(excluded)


def excluded_cells(
    excluded: Sequence[ExcludedPlace], road: RoadMap, kept_clear: Sequence[BoolArray]
) -> BoolArray | None:
    """Return the cells (X, Y) of excluded places, and others to keep clear; None without any."""
    if not (excluded or kept_clear):
        return None
    cells = np.zeros(road.grid.shape, np.bool_)
    for other in kept_clear:
        cells |= other
    for place in excluded:
        if place.relation in _NEAR:
            cells |= _too_near(place.item, place.distance_m or CLEAR_M, road)
            continue
        for candidates in propose_relation(place.relation, Query("", "stop"), road, place.item)[0]:
            cells[tuple(candidates.cells.T)] = True
    return cells


def _too_near(item: SceneObject, clear_m: float, road: RoadMap) -> BoolArray:
    """Return the cells (X, Y) at which the ego, along the road, is less than a distance from an object."""
    centres = road.grid.centre_of(np.argwhere(np.ones(road.grid.shape, np.bool_)))
    heading = np.asarray(road.direction_at(item.centre_m))
    return np.asarray(gap_m(item, road.ego, centres, heading) < clear_m).reshape(road.grid.shape)
