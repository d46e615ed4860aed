from __future__ import annotations

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter

from appocc.checks import FloatArray
from tracking.filtering.kalman import MotionConfig, Motions, bend, spread

CONFIG = MotionConfig()
ONE = np.zeros(1, np.int64)


def noise(sigma_m: float = 0.3) -> FloatArray:
    return np.eye(2)[None] * sigma_m**2


def begun(yaw_rad: float = 0.0, sigma_m: float = 0.3) -> Motions:
    motions = Motions(CONFIG)
    motions.add(np.zeros((1, 2)), np.array([yaw_rad]), noise(sigma_m))
    return motions


def followed(steps_s: list[float], velocity_mps: FloatArray) -> tuple[Motions, float]:
    """A filter that saw a vehicle at steady speed after each of some time steps, and the time that passed."""
    yaw = np.arctan2(velocity_mps[1], velocity_mps[0])
    motions, passed = begun(float(yaw)), 0.0
    for step in steps_s:
        passed += step
        motions.predict(np.array([step]), np.array([yaw]))
        motions.update(ONE, (velocity_mps * passed)[None], noise())
    return motions, passed


def test_velocity_is_found_at_irregular_steps() -> None:
    velocity = np.array([6.0, -3.0])
    motions, passed = followed([0.1, 0.5, 0.2, 0.05, 1.0, 0.3], velocity)
    np.testing.assert_allclose(motions.mean[0, 2:], velocity, atol=0.2)
    np.testing.assert_allclose(motions.mean[0, :2], velocity * passed, atol=0.1)
    assert motions.moves().tolist() == [True]


def test_a_prediction_goes_on_at_the_same_velocity_and_grows_uncertain() -> None:
    motions, passed = followed([0.2] * 10, np.array([5.0, 0.0]))
    sure = motions.blur_m()[0]
    motions.predict(np.ones(1), np.zeros(1))
    np.testing.assert_allclose(motions.mean[0, :2], [5.0 * (passed + 1.0), 0.0], atol=0.3)
    assert motions.blur_m()[0] > 2 * sure


def test_one_long_step_is_as_uncertain_as_many_short_ones() -> None:
    one, many = begun(0.7), begun(0.7)
    one.predict(np.ones(1), np.array([0.7]))
    for _ in range(10):
        many.predict(np.array([0.1]), np.array([0.7]))
    np.testing.assert_allclose(one.cov, many.cov, atol=1e-12)


def test_a_standing_vehicle_does_not_move() -> None:
    motions, _ = followed([0.2] * 10, np.zeros(2))
    assert not motions.moves().any()
    np.testing.assert_allclose(motions.mean, 0, atol=1e-9)


def test_a_vehicle_may_go_where_it_points_but_hardly_sideways() -> None:
    motions = begun(np.pi / 2)
    motions.predict(np.array([0.5]), np.array([np.pi / 2]))
    x, y = np.sqrt(np.diagonal(motions.cov[0, :2, :2]))
    assert y == pytest.approx(np.hypot(0.3, 0.5 * CONFIG.speed_mps), rel=0.01)
    assert x == pytest.approx(np.hypot(0.3, 0.5 * CONFIG.drift_mps), rel=0.05)
    assert motions.blur_m()[0] == pytest.approx(y)


def test_a_blurred_sighting_moves_the_state_less() -> None:
    sharp, blurred = begun(), begun()
    sharp.update(ONE, np.array([[1.0, 0.0]]), noise(0.1))
    blurred.update(ONE, np.array([[1.0, 0.0]]), noise(2.0))
    assert sharp.mean[0, 0] > 0.8 > 0.2 > blurred.mean[0, 0] > 0


def test_each_filter_is_filterpys() -> None:
    """Twenty vehicles over thirty irregular steps, some unseen at times, against filterpy one by one."""
    random = np.random.default_rng(4)
    n, yaw = 20, random.uniform(-np.pi, np.pi, 20)
    places, cov = random.normal(0, 20, (n, 2)), spread(yaw, 0.09, 0.04)
    motions, singles = Motions(CONFIG), []
    motions.add(places, yaw, cov)
    for i in range(n):
        single = KalmanFilter(dim_x=4, dim_z=2)
        single.x = np.append(places[i], [0.0, 0.0])
        single.H = np.eye(2, 4)
        single.P = np.zeros((4, 4))
        single.P[:2, :2], single.P[2:, 2:] = (
            cov[i],
            spread(yaw[i : i + 1], CONFIG.speed_mps**2, CONFIG.drift_mps**2)[0],
        )
        singles.append(single)
    for _ in range(30):
        seconds = float(random.uniform(0.02, 0.8))
        motions.predict(np.full(len(yaw), seconds), yaw)
        push = spread(yaw, CONFIG.push_m2ps3, CONFIG.swerve_m2ps3)
        for i, single in enumerate(singles):
            single.F = np.eye(4) + seconds * np.eye(4, k=2)
            parts = [
                [seconds**3 / 3 * push[i], seconds**2 / 2 * push[i]],
                [seconds**2 / 2 * push[i], seconds * push[i]],
            ]
            single.Q = np.block(parts)
            single.predict()
        rows = np.flatnonzero(random.random(n) < 0.7)
        seen = motions.mean[rows, :2] + random.normal(0, 0.5, (len(rows), 2))
        motions.update(rows, seen, cov[rows])
        for row, place in zip(rows, seen, strict=True):
            singles[row].update(place, R=cov[row])
    np.testing.assert_allclose(motions.mean, [single.x for single in singles], atol=1e-9)
    np.testing.assert_allclose(motions.cov, [single.P for single in singles], atol=1e-9)


def test_some_go_on() -> None:
    motions = Motions(CONFIG)
    motions.add(np.arange(6.0).reshape(3, 2), np.zeros(3), np.repeat(noise(), 3, axis=0))
    motions.keep(np.array([True, False, True]))
    assert motions.mean[:, :2].tolist() == [[0, 1], [4, 5]]
    assert len(motions.cov) == 2


def test_who_was_seen_once_does_not_stand_as_far_as_is_known() -> None:
    """Its speed may be anything along its heading, whichever way that points."""
    for yaw in (0.0, np.pi / 2):
        assert not begun(yaw).rest(1.0).any()
    standing, _ = followed([0.2] * 10, np.zeros(2))
    assert standing.rest(1.0).all()
    slow, _ = followed([0.2] * 10, np.array([0.5, 0.0]))
    assert slow.rest(1.0).all()
    assert not slow.rest(0.3).any()


def test_three_standard_deviations_are_certain_to_move() -> None:
    motions = begun()
    motions.cov[:] = np.eye(4)
    for speed, moves in ((2.9, False), (3.1, True)):
        motions.mean[0, 2:] = speed * np.array([0.6, -0.8])
        assert motions.moves().tolist() == [moves]


@pytest.mark.parametrize("angle", [0.0, 0.4, -1.2, np.pi])
def test_an_arc_bends_to_the_side_to_which_it_turns(angle: float) -> None:
    """In small steps, each straight on."""
    headings = angle * (np.arange(20_000) + 0.5) / 20_000
    ahead, left = bend(np.array([angle]))
    np.testing.assert_allclose([1 + ahead[0], left[0]], [np.cos(headings).mean(), np.sin(headings).mean()], atol=1e-8)


def test_what_is_not_known_turns_with_the_vehicle() -> None:
    """After a quarter turn the speed is unknown along the new heading, and so is the place at the arc's end."""
    motions = begun()
    motions.mean[0, 2:] = [5.0, 0.0]
    motions.predict(np.array([0.5]), np.zeros(1))
    motions.turn(ONE, np.array([np.pi / 2]), np.array([0.5]))
    np.testing.assert_allclose(motions.mean[0], [2.5 * 2 / np.pi, 2.5 * 2 / np.pi, 0, 5], atol=1e-9)
    along, across = motions.cov[0, 3, 3], motions.cov[0, 2, 2]
    assert along > 0.9 * CONFIG.speed_mps**2
    assert across < 1.0
    np.testing.assert_allclose(motions.cov[0, 0, 3], motions.cov[0, 1, 3], rtol=0.05)
