"""Goal plans for tests; the invariants of every plan are checked."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from street import EGO, HALF_ROAD_M, WORLD_FROM_EGO, Street

from appocc.bevmap import ROAD, VEHICLE
from appocc.checks import BoolArray
from appocc.grid import BEVGrid
from grounding.goal.planner import GoalPlan, Target, plan_goal
from grounding.query import Query, Referent
from grounding.referent.scene import SceneModel, SceneObject
from grounding.road.road_map import RoadMap

HALF_CELL_M = 0.2 + 1e-9
# Half a car (4.4 m x 1.8 m) and half the ego; from the middle of the road to an ego parked at its edge.
LENGTHWISE_M, SIDEWAYS_M = (4.4 + EGO.length_m) / 2, (1.8 + EGO.width_m) / 2
EDGE_M = HALF_ROAD_M - EGO.width_m / 2 - 0.3


def make_query(action: str, relation: str = "none", **more: object) -> Query:
    """A query as the parser makes it; a relation refers to "the car"."""
    if relation != "none":
        more = {"referent": Referent("car", "car"), "landmark": "referent", **more}
    return replace(Query("", action, (action,), relation), **more)  # type: ignore[arg-type]


def object_named(scene: SceneModel, name: str) -> SceneObject:
    return next(item for item in scene.objects if item.id == name)


def plan_in(
    street: Street,
    query: Query,
    name: str | None = "car",
    partner: str | None = None,
    left_hand_traffic: bool | None = None,
) -> GoalPlan:
    """Plan a goal relative to a vehicle of a street and check the invariants."""
    scene = street.scene()
    assert scene.bev is not None
    road = RoadMap.from_map(scene.bev, scene.objects, EGO, left_hand_traffic=left_hand_traffic)
    item = None if name is None else object_named(scene, name)
    made = plan_goal(query, scene, road, item, None if partner is None else object_named(scene, partner))
    check_invariants(made, scene, road)
    return made


def check_invariants(made: GoalPlan, scene: SceneModel, road: RoadMap) -> None:
    """Check what holds for every plan, independently of the planner's code."""
    bev = scene.bev
    assert bev is not None
    assert made.reasons
    places = [one for one in (made.target, made.nearest, *made.runners_up) if one is not None]
    for place in places:
        assert bev.grid.centre_of(place.cell) == pytest.approx(place.ego_m)
        assert (WORLD_FROM_EGO @ [*place.ego_m, 0, 1])[:2] == pytest.approx(place.world_m)
        assert np.cos(place.heading_rad - place.heading_ego_rad - np.pi / 2) == pytest.approx(1)
        assert 0 < place.score <= 1
        under = cells_under(place, bev.grid)
        assert not bev.on[VEHICLE][under].any()
        assert bev.on[ROAD][under].all()
        assert bev.occupancy_valid[:2, under].all()
        assert bev.grid.contains(bev.grid.cell_of(place.footprint())).all()
        assert not any(item.covers(place.footprint(), 0.29).any() for item in scene.objects)
    for one, other in ((a, b) for a in made.runners_up for b in (made.target, *made.runners_up) if a is not b):
        assert other is not None
        assert np.hypot(*(one.ego_m - other.ego_m)) >= EGO.length_m
    assert (made.route is not None) == (made.target is not None)
    if made.target is not None and made.route is not None and made.cost_field is not None:
        assert made.nearest is None
        assert made.route[-1] == pytest.approx(made.target.ego_m)
        assert np.isfinite(made.cost_field[made.target.cell])


def cells_under(target: Target, grid: BEVGrid) -> BoolArray:
    offset = grid.centres() - target.ego_m
    cos, sin = np.cos(target.heading_ego_rad), np.sin(target.heading_ego_rad)
    along, across = offset @ [cos, sin], offset @ [-sin, cos]
    return np.asarray((np.abs(along) <= EGO.length_m / 2) & (np.abs(across) <= EGO.width_m / 2))


def target_of(made: GoalPlan) -> Target:
    assert made.target is not None, made.reasons
    return made.target


def is_near(target: Target, x_m: float, y_m: float) -> bool:
    """Return whether the target is within one cell of a position."""
    return bool(np.abs(target.ego_m - [x_m, y_m]).max() <= 2 * HALF_CELL_M)


def has_reason(made: GoalPlan, words: str) -> bool:
    return any(words in reason for reason in made.reasons)
