from __future__ import annotations

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter

from appocc.checks import FloatArray
from tracking.filtering.kalman import KalmanFilters, MotionConfig, acceleration_psd, arc_offset, oriented_covariance

CONFIG = MotionConfig()
ONE = np.zeros(1, np.int64)


def noise(sigma_m: float = 0.3) -> FloatArray:
    return np.eye(2)[None] * sigma_m**2


def initial_speed(yaw_rad: FloatArray) -> FloatArray:
    return oriented_covariance(yaw_rad, CONFIG.along_speed_std_mps**2, CONFIG.across_speed_std_mps**2)


def process_noise(yaw_rad: FloatArray) -> FloatArray:
    return oriented_covariance(yaw_rad, CONFIG.along_accel_psd_m2ps3, CONFIG.across_accel_psd_m2ps3)


def begun(yaw_rad: float = 0.0, sigma_m: float = 0.3) -> KalmanFilters:
    filters = KalmanFilters()
    filters.add(np.zeros((1, 2)), noise(sigma_m), np.zeros((1, 2)), initial_speed(np.array([yaw_rad])))
    return filters


def followed(steps_s: list[float], velocity_mps: FloatArray) -> tuple[KalmanFilters, float]:
    """A filter that saw a vehicle at steady speed after each of some time steps, and the time that passed."""
    yaw = np.arctan2(velocity_mps[1], velocity_mps[0])
    filters, passed = begun(float(yaw)), 0.0
    for step in steps_s:
        passed += step
        filters.predict(np.array([step]), process_noise(np.array([yaw])))
        filters.update(ONE, (velocity_mps * passed)[None], noise())
    return filters, passed


def test_velocity_is_found_at_irregular_steps() -> None:
    velocity = np.array([6.0, -3.0])
    filters, passed = followed([0.1, 0.5, 0.2, 0.05, 1.0, 0.3], velocity)
    np.testing.assert_allclose(filters.mean[0, 2:], velocity, atol=0.2)
    np.testing.assert_allclose(filters.mean[0, :2], velocity * passed, atol=0.1)
    assert filters.is_moving().tolist() == [True]


def test_a_prediction_goes_on_at_the_same_velocity_and_grows_uncertain() -> None:
    filters, passed = followed([0.2] * 10, np.array([5.0, 0.0]))
    sure = filters.position_std_m()[0]
    filters.predict(np.ones(1), process_noise(np.zeros(1)))
    np.testing.assert_allclose(filters.mean[0, :2], [5.0 * (passed + 1.0), 0.0], atol=0.3)
    assert filters.position_std_m()[0] > 2 * sure


def test_the_path_of_a_faster_vehicle_is_less_certain_across_it() -> None:
    yaw = np.array([0.0, 0.0, np.pi / 2])
    psd = acceleration_psd(yaw, np.array([[0.0, 0.0], [10.0, 0.0], [0.0, 10.0]]), 1.0, 0.1, 0.01)
    np.testing.assert_allclose(psd[:2], [np.diag([1.0, 0.1]), np.diag([1.0, 1.1])], atol=1e-12)
    np.testing.assert_allclose(psd[2], np.diag([1.1, 1.0]), atol=1e-12)


def test_one_long_step_is_as_uncertain_as_many_short_ones() -> None:
    one, many = begun(0.7), begun(0.7)
    one.predict(np.ones(1), process_noise(np.array([0.7])))
    for _ in range(10):
        many.predict(np.array([0.1]), process_noise(np.array([0.7])))
    np.testing.assert_allclose(one.cov, many.cov, atol=1e-12)


def test_a_stationary_vehicle_does_not_move() -> None:
    filters, _ = followed([0.2] * 10, np.zeros(2))
    assert not filters.is_moving().any()
    np.testing.assert_allclose(filters.mean, 0, atol=1e-9)


def test_a_vehicle_may_go_where_it_points_but_hardly_sideways() -> None:
    filters = begun(np.pi / 2)
    filters.predict(np.array([0.5]), process_noise(np.array([np.pi / 2])))
    x, y = np.sqrt(np.diagonal(filters.cov[0, :2, :2]))
    assert y == pytest.approx(np.hypot(0.3, 0.5 * CONFIG.along_speed_std_mps), rel=0.01)
    assert x == pytest.approx(np.hypot(0.3, 0.5 * CONFIG.across_speed_std_mps), rel=0.05)
    assert filters.position_std_m()[0] == pytest.approx(y)


def test_a_blurred_sighting_moves_the_state_less() -> None:
    sharp, blurred = begun(), begun()
    sharp.update(ONE, np.array([[1.0, 0.0]]), noise(0.1))
    blurred.update(ONE, np.array([[1.0, 0.0]]), noise(2.0))
    assert sharp.mean[0, 0] > 0.8 > 0.2 > blurred.mean[0, 0] > 0


def test_each_filter_is_filterpys() -> None:
    """Twenty vehicles over thirty irregular steps, some unseen at times, against filterpy one by one."""
    random = np.random.default_rng(4)
    n, yaw = 20, random.uniform(-np.pi, np.pi, 20)
    places, cov = random.normal(0, 20, (n, 2)), oriented_covariance(yaw, 0.09, 0.04)
    filters, singles = KalmanFilters(), []
    filters.add(places, cov, np.zeros((n, 2)), initial_speed(yaw))
    for i in range(n):
        single = KalmanFilter(dim_x=4, dim_z=2)
        single.x = np.append(places[i], [0.0, 0.0])
        single.H = np.eye(2, 4)
        single.P = np.zeros((4, 4))
        single.P[:2, :2], single.P[2:, 2:] = (
            cov[i],
            initial_speed(yaw[i : i + 1])[0],
        )
        singles.append(single)
    for _ in range(30):
        seconds = float(random.uniform(0.02, 0.8))
        push = process_noise(yaw)
        filters.predict(np.full(len(yaw), seconds), push)
        for i, single in enumerate(singles):
            single.F = np.eye(4) + seconds * np.eye(4, k=2)
            parts = [
                [seconds**3 / 3 * push[i], seconds**2 / 2 * push[i]],
                [seconds**2 / 2 * push[i], seconds * push[i]],
            ]
            single.Q = np.block(parts)
            single.predict()
        rows = np.flatnonzero(random.random(n) < 0.7)
        seen = filters.mean[rows, :2] + random.normal(0, 0.5, (len(rows), 2))
        filters.update(rows, seen, cov[rows])
        for row, place in zip(rows, seen, strict=True):
            singles[row].update(place, R=cov[row])
    np.testing.assert_allclose(filters.mean, [single.x for single in singles], atol=1e-9)
    np.testing.assert_allclose(filters.cov, [single.P for single in singles], atol=1e-9)


def test_keep_selects_filters() -> None:
    filters, every = KalmanFilters(), np.repeat(noise(), 3, axis=0)
    filters.add(np.arange(6.0).reshape(3, 2), every, np.zeros((3, 2)), every)
    filters.keep(np.array([True, False, True]))
    assert filters.mean[:, :2].tolist() == [[0, 1], [4, 5]]
    assert len(filters.cov) == 2


def test_a_single_detection_is_not_stationary() -> None:
    """Its speed may be anything along its heading, whichever way that points."""
    for yaw in (0.0, np.pi / 2):
        assert not begun(yaw).is_stationary(1.0).any()
    standing, _ = followed([0.2] * 10, np.zeros(2))
    assert standing.is_stationary(1.0).all()
    slow, _ = followed([0.2] * 10, np.array([0.5, 0.0]))
    assert slow.is_stationary(1.0).all()
    assert not slow.is_stationary(0.3).any()


def test_moving_means_two_standard_deviations() -> None:
    filters = begun()
    filters.cov[:] = np.eye(4)
    for speed, moves in ((1.9, False), (2.1, True)):
        filters.mean[0, 2:] = speed * np.array([0.6, -0.8])
        assert filters.is_moving().tolist() == [moves]


@pytest.mark.parametrize("angle", [0.0, 0.4, -1.2, np.pi])
def test_an_arc_bends_to_the_side_to_which_it_turns(angle: float) -> None:
    """In small steps, each straight on."""
    headings = angle * (np.arange(20_000) + 0.5) / 20_000
    ahead, left = arc_offset(np.array([angle]))
    np.testing.assert_allclose([1 + ahead[0], left[0]], [np.cos(headings).mean(), np.sin(headings).mean()], atol=1e-8)


def test_covariance_rotates_with_the_turn() -> None:
    """After a quarter turn the speed is unknown along the new heading, and so is the place at the arc's end."""
    filters = begun()
    filters.mean[0, 2:] = [5.0, 0.0]
    filters.predict(np.array([0.5]), process_noise(np.zeros(1)))
    filters.turn(ONE, np.array([np.pi / 2]), np.array([0.5]))
    np.testing.assert_allclose(filters.mean[0], [2.5 * 2 / np.pi, 2.5 * 2 / np.pi, 0, 5], atol=1e-9)
    along, across = filters.cov[0, 3, 3], filters.cov[0, 2, 2]
    assert along > 0.9 * CONFIG.along_speed_std_mps**2
    assert across < 1.0
    np.testing.assert_allclose(filters.cov[0, 0, 3], filters.cov[0, 1, 3], rtol=0.05)
