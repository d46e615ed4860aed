"""Recorded traffic: interpolated, saved and loaded."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest

from appocc.errors import DataError, ShapeError
from appocc.simulation.traffic import Actor, Light, TrafficLog
from appocc.simulation.traffic_files import load_traffic, save_traffic


def _log(steps: int = 40) -> TrafficLog:
    """A car in a curve, one that arrives late and leaves early, a parked one, and a pedestrian."""
    rng = np.random.default_rng(3)
    t = np.arange(steps) * 0.2
    xy = np.full((steps, 4, 2), np.nan, np.float32)
    yaw = np.full((steps, 4), np.nan, np.float32)
    turn = np.pi - 0.4 + 0.1 * t
    xy[:, 0], yaw[:, 0] = np.stack([8 * t, -3 * t], axis=1) + 400, np.mod(turn + np.pi, 2 * np.pi) - np.pi
    xy[5:30, 1], yaw[5:30, 1] = np.stack([-20 * t, t**2], axis=1)[5:30], -1.0
    xy[:, 2], yaw[:, 2] = (12.3, -45.6), 2.0
    xy[:, 3], yaw[:, 3] = np.stack([t, 0 * t], axis=1), 0.0
    lights = rng.choice([0, int(Light.BRAKE), int(Light.LEFT)], (steps, 4)).astype(np.uint8)
    lights[:, 2] = int(Light.PARKED)
    lights[~np.isfinite(yaw)] = 0
    actors = (
        Actor("car_0", "car", "sedan", (4.6, 1.83, 1.45)),
        Actor("bus_0", "bus", "bus", (11.5, 2.5, 3.2)),
        Actor("parked_0", "van", "van", (5.2, 2.0, 2.2)),
        Actor("pedestrian_0", "pedestrian", "adult", (0.5, 0.6, 1.8)),
    )
    letters = rng.choice(np.frombuffer(b"ryGg", np.uint8), (steps, 3)).astype(np.uint8)
    return TrafficLog(
        step_s=0.2,
        actors=actors,
        xy_m=xy,
        yaw_rad=yaw,
        lights=lights,
        signal_links=("j/0", "j/1", "k/0"),
        signals=letters,
    )


def test_a_recorded_step_is_returned_unchanged() -> None:
    log = _log()
    state = log.state_at(2.0)
    np.testing.assert_array_equal(state.index, [0, 1, 2, 3])
    np.testing.assert_allclose(state.xy_m, log.xy_m[10], atol=1e-4)
    np.testing.assert_allclose(state.velocity_mps[0], [8, -3], atol=1e-2)
    np.testing.assert_array_equal(state.signals, log.signals[10])
    assert state.lights[2] == Light.PARKED


def test_headings_are_interpolated_along_the_shorter_arc() -> None:
    log = _log()
    step = int(np.flatnonzero(np.abs(np.diff(log.yaw_rad[:, 0])) > 3)[0])  # from +pi to -pi
    yaw = log.state_at((step + 0.25) * 0.2).yaw_rad[0]
    expected = log.yaw_rad[step, 0] + 0.25 * 0.02
    np.testing.assert_allclose(np.cos(yaw - expected), 1.0, atol=1e-7)


def test_actors_absent_at_either_step_are_left_out() -> None:
    log = _log()
    assert 1 not in log.state_at(0.9).index  # comes at step 5
    assert 1 in log.state_at(1.0).index
    assert 1 not in log.state_at(5.9).index


@pytest.mark.parametrize("time_s", [-0.1, 8.0, float("nan")])
def test_times_outside_are_refused(time_s: float) -> None:
    with pytest.raises(ShapeError, match="expected a time within"):
        _log().state_at(time_s)


def test_the_state_at_the_last_step() -> None:
    log = _log()
    np.testing.assert_allclose(log.state_at(log.duration_s).xy_m[0], log.xy_m[-1, 0], atol=1e-3)


def test_array_shapes_are_checked() -> None:
    log = _log()
    with pytest.raises(ShapeError, match="yaw_rad"):
        TrafficLog(
            step_s=0.2,
            actors=log.actors,
            xy_m=log.xy_m,
            yaw_rad=log.yaw_rad[:, :2],
            lights=log.lights,
            signal_links=log.signal_links,
            signals=log.signals,
        )


def test_logs_are_saved_and_loaded(tmp_path: Path) -> None:
    log, file = _log(), tmp_path / "a.traffic.npz"
    save_traffic(file, log)
    again = load_traffic(file)
    assert (again.actors, again.signal_links, again.step_s) == (log.actors, log.signal_links, log.step_s)
    np.testing.assert_array_equal(np.isfinite(again.xy_m), np.isfinite(log.xy_m))
    np.testing.assert_allclose(again.xy_m, log.xy_m, atol=0.0051)
    turn = np.mod(again.yaw_rad - log.yaw_rad + np.pi, 2 * np.pi) - np.pi
    assert np.nanmax(np.abs(turn)) <= np.deg2rad(0.126)
    np.testing.assert_array_equal(again.lights, log.lights)
    np.testing.assert_array_equal(again.signals, log.signals)


def test_the_same_log_gives_the_same_bytes(tmp_path: Path) -> None:
    save_traffic(tmp_path / "a.npz", _log())
    save_traffic(tmp_path / "b.npz", _log())
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


def test_a_log_of_parked_cars_only(tmp_path: Path) -> None:
    log = _log()
    parked = TrafficLog(
        step_s=0.2,
        actors=log.actors[2:3],
        xy_m=log.xy_m[:, 2:3],
        yaw_rad=log.yaw_rad[:, 2:3],
        lights=log.lights[:, 2:3],
        signal_links=(),
        signals=log.signals[:, :0],
    )
    save_traffic(tmp_path / "p.npz", parked)
    np.testing.assert_allclose(load_traffic(tmp_path / "p.npz").xy_m, parked.xy_m, atol=0.0051)


def test_an_actor_that_reappears_cannot_be_saved(tmp_path: Path) -> None:
    log = _log()
    xy = log.xy_m.copy()
    xy[15, 1] = np.nan
    broken = TrafficLog(
        step_s=0.2,
        actors=log.actors,
        xy_m=xy,
        yaw_rad=log.yaw_rad,
        lights=log.lights,
        signal_links=log.signal_links,
        signals=log.signals,
    )
    with pytest.raises(DataError, match="bus_0"):
        save_traffic(tmp_path / "b.npz", broken)
    assert not list(tmp_path.iterdir())


def test_damaged_files_give_one_line(tmp_path: Path) -> None:
    file = tmp_path / "a.npz"
    save_traffic(file, _log())
    good = file.read_bytes()
    foreign = io.BytesIO()
    np.savez(foreign, a=np.zeros(3))
    swapped = bytearray(good)
    swapped[len(good) // 3] ^= 0xFF
    for data in (b"", b"hello", good[: len(good) // 2], foreign.getvalue(), bytes(swapped)):
        file.write_bytes(data)
        with pytest.raises(DataError, match=r"a\.npz") as caught:
            load_traffic(file)
        assert "\n" not in str(caught.value)
    with pytest.raises(DataError, match="cannot be read"):
        load_traffic(tmp_path / "none.npz")


def test_inconsistent_parts_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "a.npz"
    save_traffic(file, _log())
    with np.load(file) as archive:
        arrays = dict(archive)
    arrays["spans"] = arrays["spans"] + np.array([0, 1], np.int32)
    np.savez_compressed(file, **arrays)
    with pytest.raises(DataError, match="no recorded traffic"):
        load_traffic(file)
