"""Predictions with unseen cells: neither vehicles nor targets are taken from them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from goal_plans import cells_under
from street import EGO, RED, WHITE, Street

from appocc.bevmap import BEVMap
from appocc.checks import BoolArray
from appocc.grid import BEVGrid
from grounding.grounder import Grounder
from grounding.road.visibility import unseen_sides

GRID = BEVGrid.surround()
X_M, Y_M = np.moveaxis(GRID.centres(), -1, 0)
# Field of view of one front camera of 70 degrees.
AHEAD = np.abs(np.arctan2(Y_M, X_M - 1.7)) < np.radians(35)
THRESHOLDS = {"road": 0.5, "vehicle": 0.5, "lane": 0.5}


def predicted(street: Street, seen: BoolArray) -> BEVMap:
    """Return the map that a network with correct guesses predicts of a street."""
    bev = street.bev()
    valid = np.broadcast_to(seen & ~EGO.body_cells(GRID), (3, *GRID.shape)).copy()
    return replace(bev, occupancy_valid=valid, appearance_valid=valid[0].copy(), meta={"thresholds": THRESHOLDS})


def grounder(bev: BEVMap) -> Grounder:
    made = Grounder()
    made.set_scene(bev)
    return made


def test_unseen_sides_are_named() -> None:
    street = Street()
    assert unseen_sides(predicted(street, AHEAD), EGO) == ["on our left", "on our right", "behind us"]
    assert unseen_sides(predicted(street, X_M > -5), EGO) == ["behind us"]
    assert unseen_sides(predicted(street, np.ones(GRID.shape, np.bool_)), EGO) == []
    assert unseen_sides(street.bev(), EGO) == []


@pytest.mark.parametrize(
    "text", ["turn around", "stop", "park on the right", "go back 20 metres", "change to the left lane"]
)
def test_no_target_and_no_route_in_unseen_cells(text: str) -> None:
    bev = predicted(Street(), AHEAD)
    answer = grounder(bev).ground(text)
    allowed = AHEAD | EGO.body_cells(GRID)
    for target in filter(None, (answer.target, *answer.plan.runners_up, answer.plan.nearest)):
        assert AHEAD[target.cell]
        assert allowed[cells_under(target, GRID)].all()
    if answer.plan.route is not None:
        assert allowed[tuple(GRID.cell_of(answer.plan.route).T)].all()
    assert answer.reasons[-1] == "on our left, on our right and behind us nothing is seen"


def test_guesses_are_used_on_request() -> None:
    street = Street().car("behind", -12.0, -3.0, RED)
    bev = predicted(street, AHEAD)
    refused, trusted = (
        grounder(each).ground("park behind the red car behind us") for each in (bev, bev.with_guesses())
    )
    assert refused.status == "not_found"
    assert refused.reasons[-1].endswith("behind us nothing is seen")
    assert trusted.status == "ok"
    assert trusted.target is not None
    assert trusted.target.ego_m[0] < -12
    assert not any("nothing is seen" in reason for reason in trusted.reasons)


def test_a_vehicle_in_unseen_cells_is_not_in_the_scene() -> None:
    street = Street().car("ahead", 12.0, 1.0, WHITE).car("behind", -8.0, 1.0, WHITE)
    made = Grounder()
    scene = made.set_scene(predicted(street, AHEAD), street.boxes())
    assert [item.id for item in scene.objects] == ["ahead"]
    assert len(made.set_scene(street.bev(), street.boxes()).objects) == 2
