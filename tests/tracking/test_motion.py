from __future__ import annotations

import numpy as np

from appocc.checks import FloatArray
from tracking.motion import Motion, MotionConfig


def followed(steps_s: list[float], velocity_mps: FloatArray) -> tuple[Motion, float]:
    """A filter that saw a vehicle at steady speed after each of some time steps, and the time that passed."""
    motion, passed = Motion(np.zeros(2), 0.3, MotionConfig()), 0.0
    for step in steps_s:
        passed += step
        motion.predict(step)
        motion.update(velocity_mps * passed, 0.3)
    return motion, passed


def test_velocity_is_found_at_irregular_steps() -> None:
    velocity = np.array([6.0, -3.0])
    motion, passed = followed([0.1, 0.5, 0.2, 0.05, 1.0, 0.3], velocity)
    np.testing.assert_allclose(motion.velocity_mps, velocity, atol=0.2)
    np.testing.assert_allclose(motion.position_m, velocity * passed, atol=0.1)
    assert motion.moves


def test_a_prediction_goes_on_at_the_same_velocity_and_grows_uncertain() -> None:
    motion, passed = followed([0.2] * 10, np.array([5.0, 0.0]))
    sure = motion.variance_m2
    motion.predict(1.0)
    np.testing.assert_allclose(motion.position_m, [5.0 * (passed + 1.0), 0.0], atol=0.3)
    assert motion.variance_m2 > 4 * sure


def test_one_long_step_is_as_uncertain_as_many_short_ones() -> None:
    one, many = (Motion(np.zeros(2), 0.3, MotionConfig()) for _ in range(2))
    one.predict(1.0)
    for _ in range(10):
        many.predict(0.1)
    assert np.isclose(one.variance_m2, many.variance_m2)


def test_a_standing_vehicle_does_not_move() -> None:
    motion, _ = followed([0.2] * 10, np.zeros(2))
    assert not motion.moves
    np.testing.assert_allclose(motion.velocity_mps, 0, atol=1e-9)


def test_a_first_sighting_tells_no_velocity() -> None:
    motion = Motion(np.array([3.0, 4.0]), 0.5, MotionConfig())
    np.testing.assert_allclose(motion.position_m, [3.0, 4.0])
    assert not motion.moves
    assert np.isclose(motion.variance_m2, 0.25)


def test_a_blurred_sighting_moves_the_state_less() -> None:
    sharp, blurred = (Motion(np.zeros(2), 0.3, MotionConfig()) for _ in range(2))
    sharp.update(np.array([1.0, 0.0]), 0.1)
    blurred.update(np.array([1.0, 0.0]), 2.0)
    assert sharp.position_m[0] > 0.8 > 0.2 > blurred.position_m[0] > 0
