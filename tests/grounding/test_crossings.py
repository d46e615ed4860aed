"""Places at crossings, junctions, kerbs and people: where a driver would stop, on our side of the road."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pytest
from street import BLACK, BLUE, EGO, WHITE, WORLD_FROM_EGO, Street

from appocc.bevmap import ROAD
from appocc.geometry import apply
from appocc.nuscenes.maps import VectorMap
from grounding import Answer, Grounder
from grounding.language import parse

PERSON = "human.pedestrian.adult"
HALF_M = EGO.length_m / 2
Outlines = Mapping[str, Sequence[tuple[float, float]]]


def ask(text: str, outlines: Outlines | None = None, street: Street | None = None) -> Answer:
    """Answer a command on a street whose landmarks lie across the road, between distances ahead."""
    made = street or Street()
    landmarks = {}
    for kind, spans in (outlines or {"crossing": [], "junction": []}).items():
        corners = [np.array([[a, -8.0, 0.0], [b, -8, 0], [b, 8, 0], [a, 8, 0]]) for a, b in spans]
        landmarks[kind] = tuple(apply(WORLD_FROM_EGO, one)[:, :2] for one in corners)
    grounder = Grounder()
    grounder.set_street_map(VectorMap((), (), landmarks))
    grounder.set_scene(made.bev(), made.boxes(), WORLD_FROM_EGO)
    return grounder.ground(text)


def place(answer: Answer) -> tuple[float, float]:
    """Place ahead and left of the ego, metres."""
    assert answer.target is not None, answer.text()
    return float(answer.target.ego_m[0]), float(answer.target.ego_m[1])


def crossroads() -> Street:
    """A street with a road to both sides, 8 to 18 m behind the ego."""
    street = Street()
    x = street.grid.centres()[:, 0, 0]
    street.occupancy[ROAD, (x > -18) & (x < -8)] = 1
    return street


ACROSS = {"crossing": [(14.0, 18.0)], "junction": [(20.0, 28.0)]}


@pytest.mark.parametrize(
    "text", ["stop beside the pedestrian", "pick up the pedestrian", "park next to the pedestrian"]
)
@pytest.mark.parametrize("junction", [(), ((10.0, 30.0),)])
def test_a_person_across_the_road_is_stopped_at_on_our_side(
    text: str, junction: Sequence[tuple[float, float]]
) -> None:
    street = Street().car("p", 20, 5.5, None, size_wlh_m=(0.6, 0.6, 1.7), category=PERSON)
    answer = ask(text, {"junction": junction}, street)
    if answer.target is not None:
        assert place(answer)[1] < 1, answer.text()
    elif "park" not in text:
        pytest.fail(answer.text())


def test_a_distance_to_the_kerb_is_none_to_the_person() -> None:
    street = Street().car("p", 20, -7, None, size_wlh_m=(0.6, 0.6, 1.7), category=PERSON)
    answer = ask("leave 2 m to the kerb when you stop beside the pedestrian", street=street)
    assert answer.query.distance_of == "kerb"
    assert any("to the kerb are not held" in reason for reason in answer.reasons)


@pytest.mark.parametrize("text", ["stop 2 m from the kerb", "keep 2 m from the kerb when you stop"])
def test_a_distance_to_the_kerb_is_kept(text: str) -> None:
    assert 8 - EGO.width_m / 2 + place(ask(text))[1] == pytest.approx(2, abs=0.4)


@pytest.mark.parametrize(
    "text", ["catch up with the black car", "approach the black car", "get up behind the black car"]
)
def test_a_vehicle_that_drives_ahead_of_us_is_followed(text: str) -> None:
    answer = ask(text, street=Street().car("b", 25, -1, BLACK, speed_mps=5).car("w", 12, 7, WHITE))
    ahead_m, left_m = place(answer)
    assert ahead_m + HALF_M < 25 - 2.2
    assert left_m < 1


@pytest.mark.parametrize(
    "text", ["straight over at the junction", "go straight on at the junction", "go straight across the junction"]
)
def test_straight_on_at_a_junction_leads_beyond_it(text: str) -> None:
    assert place(ask(text, {"junction": [(10.0, 20.0)], "crossing": [(21.0, 24.0)]}))[0] - HALF_M > 24


def test_a_junction_reaches_as_far_as_our_lane_lies_in_it() -> None:
    beyond = {"junction": [(16.0, 60.0)]}
    answer = ask("go straight over the junction", beyond)
    assert place(answer)[0] > 34
    assert "reaches beyond the end of the map" in answer.reasons[0]
    assert "what is past it is not known" in ask("stop after the junction", beyond).text()


@pytest.mark.parametrize(
    "text", ["someone's on the zebra, stop before it", "there's somebody on the crossing, stop before it"]
)
def test_it_is_no_person(text: str) -> None:
    street = Street().car("p", 16, 2, None, size_wlh_m=(0.6, 0.6, 1.7), category=PERSON)
    answer = ask(text, ACROSS, street)
    assert answer.query.referent is None
    assert place(answer)[0] + HALF_M < 14


@pytest.mark.parametrize(
    "text",
    [
        "once over the crossing find somewhere on the right to pull in",
        "after the crossing find somewhere on the right to pull in",
        "when we are over the crossing park on the right",
        "after we cross the zebra pull over",
    ],
)
def test_over_a_crossing_is_past_it(text: str) -> None:
    ahead_m, left_m = place(ask(text, {"crossing": [(8.0, 11.0)]}))
    assert ahead_m - HALF_M > 11
    assert left_m < 0


@pytest.mark.parametrize(
    ("text", "least_m", "most_m"),
    [
        ("go straight on and stop before the next crossing", 8, 14),
        ("go straight over the junction and stop before the crossing", 26, 32),
        ("stop before the crossing on the far side", 26, 32),
    ],
)
def test_what_is_driven_through_has_no_place_of_its_own(text: str, least_m: float, most_m: float) -> None:
    answer = ask(text, {"crossing": [(14.0, 17.0), (32.0, 35.0)], "junction": [(18.0, 31.0)]})
    assert len(answer.steps) == 1
    assert least_m < place(answer)[0] + HALF_M < most_m


@pytest.mark.parametrize(
    "text",
    ["park on this side but not within 10 m of the crossing", "pull over but keep 10 m away from the crossing"],
)
def test_places_near_a_landmark_are_ruled_out(text: str) -> None:
    answer = ask(text, {"crossing": [(9.0, 12.0)]})
    ahead_m, _ = place(answer)
    assert ahead_m - HALF_M >= 22 or ahead_m + HALF_M <= -1, answer.text()
    assert any("less than 10 m from a crossing" in reason for reason in answer.reasons)


def test_a_corner_is_a_junction() -> None:
    assert place(ask("drop me at the corner", ACROSS))[0] + HALF_M < 20


def test_a_refusal_comes_before_what_the_map_does_not_hold() -> None:
    assert ask("drive onto the pavement by the hedge").plan.refused


def test_a_manner_of_parking_is_no_step() -> None:
    answer = ask("park behind the white car, nose in to the kerb", street=Street().car("w", 20, -6.5, WHITE))
    assert len(answer.steps) == 1
    assert place(answer)[0] < 20


@pytest.mark.parametrize("text", ["turn right where we just came past", "take the right turning we've just passed"])
def test_a_road_that_we_have_passed_is_behind_us(text: str) -> None:
    answer = ask(text, street=crossroads())
    assert answer.target is None
    assert "behind us: for it we have to turn round" in answer.text()


def test_backwards_leads_to_a_landmark_behind_us() -> None:
    behind = {"junction": [(-30.0, -9.0), (20.0, 28.0)]}
    assert -9 < place(ask("go backwards as far as the junction", behind))[0] - HALF_M < -5
    assert "no junction is known behind us" in ask("reverse to the junction", ACROSS).text()


@pytest.mark.parametrize("text", ["stay in the inside lane", "keep to the slow lane"])
def test_a_lane_that_is_ours_is_kept(text: str) -> None:
    ahead_m, left_m = place(ask(text))
    assert ahead_m > 10
    assert abs(left_m) < 1


def test_to_stay_in_the_lane_that_we_change_to_is_no_standing_still() -> None:
    assert parse("shift to the inside lane and stay there").query.actions == ("change_lane",)


def test_one_lane_to_the_right_is_no_lane_of_a_name() -> None:
    assert not parse("change one lane to the right").query.secondary


@pytest.mark.parametrize("text", ["go go go its green", "go its green"])
def test_a_green_light_is_driven_on_at(text: str) -> None:
    assert place(ask(text))[0] > 10


def test_traffic_ahead_of_us_has_left_a_place_by_then() -> None:
    answer = ask("halt in 20 metres", street=Street().car("b", 22, 0, BLUE, speed_mps=4))
    assert place(answer)[0] - EGO.centre_m == pytest.approx(20, abs=3)
    assert any("have driven on" in reason for reason in answer.reasons)
    assert ask("halt in 20 metres", street=Street().car("b", 22, 0, BLUE)).target is None


@pytest.mark.parametrize(
    ("text", "side"),
    [
        ("go to the other side of the road", "on the other side of the road"),
        ("i'd rather be on the other side", "on the other side of the road"),
        ("i need to be out on the left so my boy doesn't step into traffic", "on the left"),
    ],
)
def test_a_side_is_not_lost(text: str, side: str) -> None:
    reading = parse(text)
    assert side in reading.doubt


def test_of_several_vehicles_at_a_turn_any_will_do() -> None:
    assert parse("turn into the street on the right where the cars are parked").query.referent.definite is False  # type: ignore[union-attr]


@pytest.mark.parametrize(
    "text",
    [
        "wait at the crossing until everybody is over",
        "stop at the crossing till the people are across",
        "wait before the crossing until the pedestrians are over the road",
        "stop before the crossing until the people have crossed",
    ],
)
def test_who_is_awaited_at_a_crossing_is_not_where_we_wait(text: str) -> None:
    size = (0.6, 0.6, 1.7)
    street = Street().car("p", 16, 3, None, size_wlh_m=size, category=PERSON)
    street.car("q", 16, -3, None, size_wlh_m=size, category=PERSON)
    answer = ask(text, ACROSS, street)
    assert [step.query.action for step in answer.steps] == ["stop", "wait"]
    assert answer.steps[1].query.trigger == "pass"
    assert 10 < place(answer.steps[0])[0] + HALF_M < 14
    assert answer.steps[1].pace == "standing", answer.text()


@pytest.mark.parametrize(
    "text",
    [
        "drive up to the crossing and wait there",
        "go to the junction ahead and wait there",
        "go to the lights and wait",
    ],
)
def test_a_landmark_to_wait_at_is_gone_to_or_told(text: str) -> None:
    answer = ask(text, ACROSS)
    if "lights" in text:
        assert (answer.status, "no traffic light" in answer.text()) == ("not_found", True)
    else:
        assert (answer.status, [step.query.action for step in answer.steps]) == ("ok", ["approach", "wait"])
