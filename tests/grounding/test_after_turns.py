"""A vehicle named after a turn is the one that is seen there; the very kind and colour break a tie."""

from __future__ import annotations

import numpy as np
import pytest
from street import BLACK, BLUE, GREY, RED, WHITE, Street

from appocc.bevmap import LANE, ROAD
from grounding import Answer
from grounding.query import Query, Referent
from grounding.referent.resolver import resolve
from grounding.road.pose import Pose2D

VAN_M, TRUCK_M = (2.0, 5.4, 2.3), (2.4, 7.5, 3.0)


def junction() -> Street:
    """A street with side roads to both sides 16 m ahead, with vehicles here and there."""
    street = Street()
    x, y = np.moveaxis(street.grid.centres(), -1, 0)
    street.occupancy[ROAD] = (np.abs(y) < 4) | ((np.abs(x - 16) < 4.5) & (np.abs(y) < 45))
    street.occupancy[LANE, (np.abs(y) < 0.2) & (x % 4 < 2) & (np.abs(x - 16) > 5)] = 1
    street.occupancy[LANE, (np.abs(x - 16) < 0.2) & (y % 4 < 2) & (np.abs(y) > 5)] = 1
    street.car("here", 7, -3, WHITE).car("behind", -12, -3, WHITE, size_wlh_m=VAN_M, category="vehicle.car")
    for name, y_m, rgb in (("near", 24, WHITE), ("far", 36, WHITE), ("red", 30, RED)):
        street.car(name, 19.2 if name != "red" else 12.8, y_m, rgb, yaw_rad=np.pi / 2)
    return street.car("van", 12.8, -26, BLUE, yaw_rad=-np.pi / 2, size_wlh_m=VAN_M)


def ask(text: str) -> Answer:
    return junction().grounder().ground(text)


@pytest.mark.parametrize(
    ("text", "vehicle"),
    [
        ("turn left and stop behind the white car", "near"),
        ("take the left turn, then stop by the first white car", "near"),
        ("go left, then stop next to the second white car", "far"),
        ("turn left and pull up beside the red car on the left", "red"),
        ("turn right and then stop behind the van", "van"),
        ("stop behind the white car", "here"),
    ],
)
def test_the_vehicle_is_seen_from_where_the_turn_ends(text: str, vehicle: str) -> None:
    answer = ask(text)
    assert answer.steps[-1].candidates[0].item.id == vehicle, answer.text()


def test_what_is_not_there_is_sought_from_here() -> None:
    answer = ask("turn right and stop by the red car")
    assert [one.item.id for one in answer.steps[-1].candidates[:1]] == ["red"]


def test_a_scene_from_another_pose() -> None:
    scene = junction().scene()
    pose = Pose2D(16.0, 10.0, np.pi / 2)
    seen = {item.id: item for item in scene.seen_from(pose).objects}
    np.testing.assert_allclose(seen["near"].centre_m, [14 + scene.ego.centre_m, -3.2], atol=1e-6)
    assert seen["near"].yaw_rad == pytest.approx(0.0)
    assert seen["here"].centre_m[0] < 0


def named(noun: str, colour: str | None, street: Street) -> list[str]:
    query = Query("", "stop", relation="next_to", landmark="referent", referent=Referent(noun, noun, colour))
    found = resolve(query, street.scene())
    return (
        sorted(one.item.id for one in found.candidates)
        if found.status == "ambiguous"
        else [found.candidates[0].item.id]
    )


def test_the_very_colour_and_kind_break_a_tie() -> None:
    assert named("car", "black", Street().car("g", 20, -4, (84, 84, 86)).car("b", 22, 4, BLACK)) == ["b"]
    assert named("car", "black", Street().car("x", 20, -4, BLACK).car("b", 22, 4, BLACK)) == ["b", "x"]
    assert named("car", "grey", Street().car("s", 20, -4, (150, 150, 152)).car("g", 21, 4, GREY)) == ["g"]
    both = Street().car("v", 18, -4, BLUE, size_wlh_m=VAN_M)
    assert named("truck", None, both.car("t", 24, 4, BLUE, size_wlh_m=TRUCK_M, category="vehicle.truck")) == ["t"]


def test_backwards_looks_back() -> None:
    scene = Street().car("ahead", 14, -4, WHITE).car("back", -14, -4, WHITE).scene()
    query = Query("", "approach", relation="next_to", landmark="referent", referent=Referent("car", "car", "white"))
    assert resolve(query, scene).candidates[0].item.id == "ahead"
    back = Query("", "approach", relation="next_to", landmark="referent", referent=query.referent, manoeuvre="back")
    assert "back" in {one.item.id for one in resolve(back, scene).candidates}
