"""Many vehicles, and many that come and go: ids stay right and nothing piles up."""

from __future__ import annotations

from itertools import islice

import numpy as np
import pytest

from benchmarks import tracking_speed
from benchmarks.tracking_speed import Moment, Traffic
from tracking.association.costs import AssociationConfig
from tracking.neighbours import find_neighbours
from tracking.tracker import Tracker

NOW = np.eye(4)


def moments(count: int, frames: int) -> list[Moment]:
    return list(islice(Traffic(count).moments(), frames))


def ids_of(count: int, frames: int) -> dict[int, set[int]]:
    """The ids of the tracks that took what was seen of each vehicle."""
    tracker = Tracker()
    ids: dict[int, set[int]] = {}
    for moment in moments(count, frames):
        tracks = tracker.update(moment.detections, moment.timestamp_us, NOW)
        seen = tracks.detection >= 0
        truth = moment.truth[tracks.detection[seen]]
        for vehicle, track in zip(truth.tolist(), tracks.id[seen].tolist(), strict=True):
            if vehicle >= 0:
                ids.setdefault(vehicle, set()).add(track)
    return ids


def test_each_of_500_vehicles_keeps_its_own_id(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tracking_speed, "FALSE", 0.0)
    ids = ids_of(500, 40)
    of_those_at_first = [own for vehicle, own in ids.items() if vehicle < 500]
    assert len(of_those_at_first) > 495  # the others left at once
    assert all(len(own) == 1 for own in of_those_at_first)
    assert len(set.union(*ids.values())) == sum(len(own) for own in ids.values())  # no id for two


def test_false_detections_do_not_mix_the_ids_of_500_vehicles() -> None:
    ids = ids_of(500, 40)
    assert np.mean([len(own) == 1 for vehicle, own in ids.items() if vehicle < 500]) >= 0.99
    assert len(set.union(*ids.values())) == sum(len(own) for own in ids.values())


def test_state_size_is_bounded_by_the_number_of_tracks() -> None:
    """Hundreds of vehicles and false ones come and go; in the end there are as many tracks as in the beginning."""
    tracker, alive, last_id = Tracker(), [], 0
    for moment in moments(20, 400):
        tracks = tracker.update(moment.detections, moment.timestamp_us, NOW)
        alive.append(len(tracker._table))
        last_id = max([last_id, *tracks.id.tolist()])
    assert last_id > 400
    assert max(alive[200:]) <= max(alive[:200]) + 10 < 120
    state = tracker._table
    arrays = [state.state, *vars(state.filters).values(), *vars(state._medians).values()]
    assert all(len(state) in array.shape for array in arrays)
    assert max(array.size for array in arrays) <= len(state) * (11 + 3) * 9
    assert len(tracker._classes.names) == 1


def test_tracks_that_left_are_forgotten() -> None:
    tracker = Tracker()
    for moment in moments(50, 5):
        tracker.update(moment.detections, moment.timestamp_us, NOW)
    nobody = moment.detections.select(np.zeros(0, np.int64))
    for step in range(1, 14):
        tracks = tracker.update(nobody, moment.timestamp_us + step * 3_000_000, NOW)
    assert (len(tracks), len(tracker._table)) == (0, 0)


@pytest.mark.parametrize("count", [20, 80])  # few, and more
@pytest.mark.parametrize("reach_m", [0.5, 5.0, 500.0])
def test_all_neighbours_are_found(reach_m: float, count: int) -> None:
    dice = np.random.default_rng(3)
    one, other = dice.uniform(-50, 50, (count, 2)), dice.uniform(-50, 50, (90, 2))
    reaches_m = reach_m * dice.uniform(0.5, 1, count)
    rows, columns = find_neighbours(one, other, reaches_m)
    apart_m = np.hypot(*np.moveaxis(one[:, None] - other, -1, 0))
    assert (np.diff(rows) >= 0).all()
    found = sorted(zip(rows.tolist(), columns.tolist(), strict=True))
    assert found == [tuple(pair) for pair in np.argwhere(apart_m <= reaches_m[:, None]).tolist()]


def test_no_points_have_no_neighbours() -> None:
    nobody, some = np.zeros((0, 2)), np.ones((3, 2))
    assert [len(each) for each in find_neighbours(nobody, some, np.zeros(0))] == [0, 0]
    assert [len(each) for each in find_neighbours(some, nobody, np.ones(3))] == [0, 0]


def test_the_reach_of_a_track_grows_with_the_time_unseen() -> None:
    config = AssociationConfig(min_gate_m=2.0, gate_speed_mps=10.0, max_gate_m=6.0)
    assert config.gate_radius_m(np.array([0.0, 0.1, 0.3, 9.0])).tolist() == [2.0, 3.0, 5.0, 6.0]


def test_traffic_matches_its_specification() -> None:
    seen = moments(50, 200)
    shares = np.array([[(m.truth < 0).sum() / 50, (m.truth >= 0).sum() / 50] for m in seen])
    np.testing.assert_allclose(shares.mean(axis=0), [0.05, 0.95], atol=0.01)
    assert seen[-1].truth.max() > 60  # some came
    assert all(np.abs(m.detections.ground_m[:, :2]).max() < 41 for m in seen)
