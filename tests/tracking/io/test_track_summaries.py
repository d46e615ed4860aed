from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_tracks import track

from appocc.errors import DataError, ShapeError
from tracking.io.track_summaries import TrackSummary, path_length_m, summarise_tracks, write_summaries
from tracking.tracks import Track


def at(x_m: float, number: int = 1, speed_mps: float = 0.0, **changes: Any) -> Track:
    place, velocity = np.array([x_m, 5.0, 0.0]), np.array([speed_mps, 0.0])
    return track(number, position_world_m=place, velocity_world_mps=velocity, **changes)


def test_a_vehicle_that_drives() -> None:
    """It coasts at the end, and its first speed is a wild guess."""
    moments = [[at(3.0 * i, speed_mps=80.0 if i == 0 else 30.0 + 0.1 * i)] for i in range(8)]
    moments += [[at(24.0, seen=False)], []]
    (one,) = summarise_tracks(list(range(100, 110)), moments)
    assert (one.id, one.category, one.colour) == (1, "car", "black or blue")
    assert (one.first_us, one.last_us, one.seen, one.reported) == (100, 108, 8, 9)
    assert one.path_m == pytest.approx(21.0)
    assert one.top_speed_mps == pytest.approx(30.6)
    assert one.moves


def test_the_top_speed_of_a_track_of_two_frames_is_one_of_its_own() -> None:
    """A median filter that reads beyond the speeds gives others."""
    for i in range(200):
        (one,) = summarise_tracks([0, 1], [[at(0.0, speed_mps=4.0 + i)], [at(9.0, speed_mps=5.0 + i)]])
        assert one.top_speed_mps == 5.0 + i


def test_a_parked_vehicle_has_no_path_however_long_it_jitters() -> None:
    offsets = np.random.default_rng(1).normal(0, 0.3, 500)
    moments = [[at(float(offset), speed_mps=0.4)] for offset in offsets]
    (one,) = summarise_tracks(list(range(500)), moments)
    assert (one.path_m, one.top_speed_mps, one.moves) == (0.0, 0.0, False)


def test_colour_and_class_are_medians_over_the_track() -> None:
    white, yellow, none = np.array([245.0, 245, 245]), np.array([235.0, 200, 40]), np.full(3, np.nan)
    moments = [
        [at(0.0, rgb=rgb, length_m=7.0), at(9.0, 2, rgb=none, kind="trailer")]
        for rgb in (yellow, white, none, yellow)
    ]
    one, other = summarise_tracks(range(4), moments)
    assert (one.category, one.colour) == ("truck", "yellow")
    assert (other.category, other.colour) == ("trailer", "")


def test_a_way_is_that_of_chords() -> None:
    quarter = np.linspace(0, np.pi / 2, 400)
    bend = 10 * np.stack([np.cos(quarter), np.sin(quarter)], axis=1)
    assert path_length_m(bend) == pytest.approx(5 * np.pi, rel=0.01)
    assert path_length_m(np.array([[0.0, 0], [1.9, 0], [0, 0], [1.9, 0]])) == 0.0
    assert path_length_m(np.array([[0.0, 0], [2.0, 0], [2.0, 1.5]])) == 3.5
    assert path_length_m(np.zeros((0, 2))) == 0.0


def test_never_seen_and_nobody() -> None:
    (one,) = summarise_tracks([5], [[at(0.0, seen=False)]])
    assert (one.seen, one.reported, one.path_m, one.top_speed_mps) == (0, 1, 0.0, 0.0)
    assert summarise_tracks([], []) == ()


def test_table(tmp_path: Path) -> None:
    write_summaries(
        tmp_path / "s.csv",
        [
            TrackSummary(
                id=3,
                category="car",
                colour="grey or silver",
                first_us=10,
                last_us=2_000_010,
                seen=4,
                reported=5,
                path_m=21.004,
                top_speed_mps=10.5,
            )
        ],
    )
    assert (tmp_path / "s.csv").read_text().splitlines() == [
        "track_id,class,colour,first_us,last_us,moments_seen,moments_told,path_m,top_speed_mps,moves",
        "3,car,grey or silver,10,2000010,4,5,21.00,10.50,1",
    ]


def test_bad_input(tmp_path: Path) -> None:
    with pytest.raises(ShapeError, match="expected a time for each of 1 frames, got 0"):
        summarise_tracks([], [[]])
    (tmp_path / "file").write_text("")
    with pytest.raises(DataError, match="cannot be written"):
        write_summaries(tmp_path / "file" / "s.csv", [])
