"""Invariants of goal plans on random roads with random vehicles."""

from __future__ import annotations

import numpy as np
from goal_plans import check_invariants, make_query
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy import ndimage
from street import EGO, Street

from appocc.bevmap import LANE, ROAD, VEHICLE, BEVMap
from appocc.grid import BEVGrid
from grounding.goal.exclusions import ExcludedPlace
from grounding.goal.planner import plan_goal
from grounding.query import Query
from grounding.road.road_map import RoadMap

RELATIONS = ("behind", "in_front_of", "next_to", "near", "left_of", "right_of", "opposite", "past", "before", "at")
WITH = [
    make_query(action, relation) for relation in (*RELATIONS, "toward") for action in ("park", "stop", "pull_over")
]
WITH += [make_query(action) for action in ("follow", "approach", "overtake", "drive_past", "change_lane", "avoid")]
WITH += [make_query("park", "between"), make_query("turn", "past", direction="left"), make_query("follow", "same_as")]
WITH += [
    make_query("stop", "behind", distance_m=5.0, distance_of="referent"),
    make_query("park", "near", goal_side="left"),
]
ALONE = [make_query("turn", direction=way) for way in ("left", "right", "around", "straight")]
ALONE += [make_query(action) for action in ("park", "pull_over", "stop", "wait", "slow_down", "change_lane")]
GRIDS = [BEVGrid.surround(), BEVGrid.front(), BEVGrid(-8.0, 24.0, -16.0, 20.0)]


@st.composite
def streets(draw: st.DrawFn) -> Street:
    """Roads crossing at any angle, with markings, unknown cells, holes and vehicles at any pose."""
    street = Street(draw(st.sampled_from(GRIDS)))
    chance = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    x, y = np.moveaxis(street.grid.centres(), -1, 0)
    street.occupancy[ROAD] = 0
    for number in range(draw(st.integers(1, 3))):
        angle = chance.normal(0, 0.15) if number == 0 else chance.uniform(-np.pi, np.pi)
        px, py = (0.0, chance.uniform(-2, 2)) if number == 0 else chance.uniform(-10, 30, 2)
        across = (y - py) * np.cos(angle) - (x - px) * np.sin(angle)
        street.occupancy[ROAD, np.abs(across) < chance.uniform(1.5, 8)] = 1
        street.occupancy[LANE, np.abs(across) < 0.2] = 1
    for _ in range(draw(st.integers(0, 3))):
        px, py, radius = chance.uniform([-20, -15, 0.3], [35, 15, 3])
        street.occupancy[ROAD, np.hypot(x - px, y - py) < radius] = 0
    if draw(st.booleans()):
        street.road_known[:] = np.hypot(x - chance.uniform(-10, 40), y) < chance.uniform(5, 40)
    for number in range(draw(st.integers(2, 12))):
        px, py = chance.uniform(-10, 35), chance.uniform(-10, 10)
        if np.hypot(px - 1.3, py) > 4:
            yaw = chance.choice([0.0, np.pi, chance.uniform(-np.pi, np.pi)])
            street.car(f"c{number}", px, py, yaw_rad=yaw, speed_mps=float(chance.choice([0, 7])))
    return street


@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
@given(streets(), st.sampled_from(WITH + ALONE), st.integers(0, 10**6), st.booleans())
def test_no_goal_violates_a_constraint(street: Street, query: Query, pick: int, soft: bool) -> None:
    scene = street.scene()
    bev = scene.bev
    assert bev is not None
    if soft:  # A predicted map: probabilities, and small holes are filled for paths but not for goals.
        occupancy = np.clip(bev.occupancy, 0.1, 0.9)
        bev = BEVMap(bev.grid, occupancy, bev.occupancy_valid, bev.appearance, bev.appearance_valid)
    road = RoadMap.from_map(bev, scene.objects, EGO)
    item = partner = None
    excluded = []
    if query in WITH and scene.objects:
        item, partner = (scene.objects[(pick + step) % len(scene.objects)] for step in (0, 1))
        other = scene.objects[pick // 7 % len(scene.objects)]
        excluded = [ExcludedPlace("next_to", other)] if pick % 3 == 0 else []
    made = plan_goal(query, scene, road, item, partner, excluded)
    check_invariants(made, scene, road)
    if any("have driven on" in reason for reason in made.reasons):
        later = road.after_traffic([one for one in (item, partner) if one])
        assert later is not None
        assert made.route is not None
        cells = later.grid.cell_of(made.route[later.grid.contains(later.grid.cell_of(made.route))])
        assert (later.clearance_m[tuple(cells.T)] > 0.5).all()  # only those that drive on are passed through
        return
    if made.target is not None and not soft:
        # Independent of the path search: goal and start are in one component where a disc of the ego width fits.
        open_ = np.pad(bev.on[ROAD] & bev.occupancy_valid[:2].all(axis=0) & ~bev.on[VEHICLE], 1)
        room = ndimage.distance_transform_edt(open_)[1:-1, 1:-1] * bev.grid.cell_m
        piece = ndimage.label(room > 0.95, np.ones((3, 3)))[0]
        start = np.argwhere(road.paths.length_m == 0)[0]
        assert piece[made.target.cell] == piece[tuple(start)] > 0
    if made.route is not None:
        cells = road.grid.cell_of(made.route)
        on_map = road.grid.contains(cells)
        # A way that begins backwards crosses the cells where the ego stands once more.
        own = ndimage.binary_dilation(EGO.body_cells(road.grid), iterations=2)
        # Between the centres of cells the room is interpolated.
        passable = ndimage.binary_dilation(road.paths.free | own, np.ones((3, 3), np.bool_))
        free = on_map & passable[tuple(np.where(on_map[:, None], cells, 0).T)]
        assert free[np.argmax(free) :].all()  # from where it meets the first free cell
        assert np.hypot(*np.diff(made.route, axis=0).T).max(initial=0.0) < 7
