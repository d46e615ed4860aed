"""Manoeuvres: bends, reversing, fast vehicles at low frame rates, and slow ones."""

from __future__ import annotations

import json

import numpy as np
import pytest

from benchmarks.manoeuvres import CASES, main
from tracking import Detections, Track, Tracker

EGO = np.eye(4)


def detected(position_m: tuple[float, float], yaw_rad: float) -> Detections:
    wrapped = (yaw_rad + np.pi) % (2 * np.pi) - np.pi
    return Detections.from_boxes([position_m], [wrapped], size_m=[[1.8, 4.5, 1.5]], log_odds=[3.0], kind="car")


def follow(places: np.ndarray, yaws_rad: np.ndarray, hz: float) -> list[Track]:
    """Return the only track after each detection of one car."""
    tracker, found = Tracker(), []
    for i, (place, yaw) in enumerate(zip(places, yaws_rad, strict=True)):
        (track,) = tracker.update(detected(tuple(place), float(yaw)), round(i * 1e6 / hz), EGO)
        found.append(track)
    return found


def rms(values: np.ndarray) -> float:
    return float(np.sqrt((values**2).mean()))


@pytest.mark.parametrize(("radius_m", "rate_radps"), [(8.0, 0.6), (30.0, 0.3)])
def test_a_track_in_a_bend_is_better_than_its_detections(radius_m: float, rate_radps: float) -> None:
    rng, seconds = np.random.default_rng(0), np.arange(400) / 10
    angle = rate_radps * seconds
    true_m = radius_m * np.column_stack([np.cos(angle), np.sin(angle)])
    noise_m = rng.normal(0, 0.1, true_m.shape)
    tracks = follow(true_m + noise_m, angle + np.pi / 2 + rng.normal(0, 0.03, 400), 10)
    off_m = np.array([np.hypot(*(one.position_world_m[:2] - true)) for one, true in zip(tracks, true_m, strict=True)])
    assert rms(off_m[100:]) < rms(np.hypot(*noise_m.T))
    assert rms(off_m[300:]) < 1.3 * rms(off_m[100:200])  # what lags is not taken for noise
    turned = np.array([one.yaw_world_rad for one in tracks]) - angle - np.pi / 2
    assert np.degrees(rms((turned[100:] + np.pi) % (2 * np.pi) - np.pi)) < 4


@pytest.mark.parametrize("hz", [2, 10])
@pytest.mark.parametrize("speed_mps", [-3.0, -1.0, 2.0, 8.0])
def test_detections_tell_the_front_of_a_slow_vehicle(hz: int, speed_mps: float) -> None:
    ahead_m = 30 + speed_mps / hz * np.arange(10 * hz)
    tracks = follow(np.column_stack([ahead_m, np.zeros_like(ahead_m)]), np.zeros_like(ahead_m), hz)
    later = tracks[4 * hz :]
    assert all(abs(one.yaw_world_rad) < 0.1 and one.heading_known for one in later)


def test_fast_motion_overrules_detections_that_are_turned_around() -> None:
    ahead_m = np.arange(60) * 0.9
    tracks = follow(np.column_stack([ahead_m, np.zeros(60)]), np.full(60, np.pi), 10)
    assert all(abs(one.yaw_world_rad) < 0.1 for one in tracks[20:])


@pytest.mark.parametrize("hz", [2, 5])
def test_a_fast_vehicle_keeps_its_id_at_a_low_frame_rate(hz: int) -> None:
    ahead_m = 30.0 / hz * np.arange(16) - 60
    tracks = follow(np.column_stack([ahead_m, np.zeros(16)]), np.zeros(16), hz)
    assert len({one.id for one in tracks}) == 1
    assert abs(tracks[-1].velocity_world_mps[0] - 30) < 1


@pytest.mark.parametrize(("speed_mps", "moving"), [(0.0, False), (1.75, True)])
def test_slow_vehicles_are_told_from_standing_ones(speed_mps: float, moving: bool) -> None:
    rng, ahead_m = np.random.default_rng(0), speed_mps / 10 * np.arange(80)
    places = np.column_stack([ahead_m, np.zeros(80)]) + rng.normal(0, 0.1, (80, 2))
    later = follow(places, np.zeros(80), 10)[40:]
    assert np.mean([one.moving == moving and one.velocity_known for one in later]) > 0.9


def test_the_benchmark_prints_all_cases(capsys: pytest.CaptureFixture[str]) -> None:
    main(["--seeds", "1", "--json"])
    found = json.loads(capsys.readouterr().out)
    assert len(found) == len(CASES)
    for rows in found.values():
        assert rows["appocc"]["place_m"] < 2 * rows["detections"]["place_m"]
    main(["--seeds", "1"])
    assert "plain filter" in capsys.readouterr().out
