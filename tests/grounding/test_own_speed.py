"""The speed of the ego: how far ahead it stops, and what is told of it."""

from __future__ import annotations

import numpy as np
import pytest
from street import WHITE, WORLD_FROM_EGO, Street, told
from tiny_dataset import TinyDataset

from appocc.ego_vehicle import EgoVehicle
from appocc.errors import AppoccError
from appocc.nuscenes import Dataset
from appocc.polylines import length_m
from grounding.grounder import Grounder
from grounding.pipeline import own_speed_mps


def grounder_at(speed_mps: float | None, street: Street | None = None) -> Grounder:
    street, grounder = street or Street(), Grounder()
    grounder.set_scene(street.bev(), street.boxes(), WORLD_FROM_EGO, speed_mps=speed_mps)
    return grounder


def stop_m(speed_mps: float | None, command: str = "stop here") -> float:
    answer = grounder_at(speed_mps).ground(command)
    assert answer.status == "ok", answer.text()
    assert answer.plan.route is not None
    return length_m(answer.plan.route)


def test_a_standing_ego_stops_where_it_is() -> None:
    answer = grounder_at(0.0).ground("stop here")
    assert answer.status == "ok"
    assert "we stand already" in answer.reasons
    assert answer.target is not None
    assert np.linalg.norm(answer.target.ego_m - np.array([EgoVehicle().centre_m, 0.0])) < 0.6


def test_a_faster_ego_stops_farther_ahead() -> None:
    slow, fast = stop_m(3.0), stop_m(9.0)
    assert slow < 4
    assert fast > 9**2 / 2 / 5  # no harder than 5 m/s2
    assert stop_m(9.0, "pull over") > 9**2 / 2 / 5


def test_without_a_speed_some_metres_are_taken() -> None:
    assert 5 < stop_m(None) < 11


@pytest.mark.parametrize(
    ("speed_mps", "question", "answer"),
    [
        (5.0, "how fast are we going?", "we drive at 5 m/s, 18 km/h"),
        (0.1, "what is our speed?", "we stand"),
        (0.1, "are we moving?", "no: we stand"),
        (6.0, "are we standing still?", "no: we drive at 6 m/s, 22 km/h"),
        (-1.0, "how fast are we?", "we drive backwards at 1 m/s, 4 km/h"),
        (None, "how fast are we?", "that is not known here: our own speed"),
    ],
)
def test_our_speed_is_told(speed_mps: float | None, question: str, answer: str) -> None:
    assert told(grounder_at(speed_mps).session(), question) == answer


def test_a_full_kerb_offers_to_stay_where_we_stand() -> None:
    street = Street()
    for number in range(12):
        street.car(f"p{number}", -8 + 5.4 * number, -6.9, WHITE)
    answer = grounder_at(0.0, street).ground("pull over on the right")
    assert answer.status == "ambiguous"
    assert answer.question.endswith("shall we stay where we are?")


def test_an_update_has_its_own_speed() -> None:
    grounder, street = grounder_at(8.0), Street()
    session = grounder.session()
    session.update(street.bev(), street.boxes(), WORLD_FROM_EGO, speed_mps=0.0)
    assert told(session, "are we moving?") == "no: we stand"


@pytest.mark.parametrize("speed_mps", [np.nan, np.inf])
def test_a_speed_is_finite(speed_mps: float) -> None:
    with pytest.raises(AppoccError, match="expected a finite speed_mps"):
        grounder_at(speed_mps)


def test_the_speed_of_a_recording_is_that_of_its_poses(tiny: TinyDataset) -> None:
    dataset = Dataset(tiny.root, tiny.version)
    samples = dataset.samples(dataset.scenes[0])
    for at, other in ((0, 1), (1, 0)):
        places = [dataset.world_from_ego(samples[i])[:2, 3] for i in (at, other)]
        seconds = abs(samples[at].timestamp_us - samples[other].timestamp_us) * 1e-6
        expected = float(np.linalg.norm(places[0] - places[1])) / seconds
        assert own_speed_mps(dataset, samples[at]) == pytest.approx(expected, rel=0.05)
