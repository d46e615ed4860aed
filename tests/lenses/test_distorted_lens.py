from __future__ import annotations

import pickle

import cv2
import numpy as np
import pytest

from appocc.checks import FloatArray
from appocc.errors import ShapeError
from appocc.lenses import DistortedLens

K = np.array([[500.0, 0, 640], [0, 510, 360], [0, 0, 1]])
PLUMB_BOB = [-0.3, 0.1, 0.001, -0.002]
STRONG = [-0.32, 0.12, 0.001, -0.001, -0.02]
RATIONAL = [0.5, -0.1, 0.001, -0.002, 0.01, 0.9, 0.02, 0.001]
LENSES = [PLUMB_BOB, STRONG, RATIONAL, [0.2, 0.1, 0.0, 0.0], [0.0] * 4]


def points(wide: float = 1.0) -> FloatArray:
    made = np.random.default_rng(0)
    depth = made.uniform(0.5, 30, 400)
    return np.stack([made.uniform(-wide, wide, 400) * depth, made.uniform(-0.6, 0.6, 400) * depth, depth], axis=1)


@pytest.mark.parametrize("coefficients", LENSES)
def test_it_projects_as_opencv(coefficients: list[float]) -> None:
    lens = DistortedLens(K, np.array(coefficients))
    wanted, _ = cv2.projectPoints(points(), np.zeros(3), np.zeros(3), K, np.array(coefficients))
    np.testing.assert_allclose(lens.project(points()), wanted[:, 0], atol=1e-9)


@pytest.mark.parametrize("coefficients", LENSES)
def test_a_pixel_sees_what_is_projected_to_it(coefficients: list[float]) -> None:
    lens = DistortedLens(K, np.array(coefficients))
    pixels = np.random.default_rng(1).uniform([300, 150], [980, 570], (500, 2))
    rays = lens.unproject(pixels)
    np.testing.assert_allclose(np.linalg.norm(rays, axis=1), 1)
    np.testing.assert_allclose(lens.project(7.0 * rays), pixels, atol=1e-7)


def test_where_the_model_folds_the_picture_nothing_is_seen() -> None:
    lens = DistortedLens(K, np.array([-0.4, 0.0, 0.0, 0.0]))
    # r (1 - 0.4 r^2) rises up to r = 0.913; OpenCV puts what is beyond back into the picture.
    beyond = np.array([[1.2, 0.0, 1.0]])
    folded, _ = cv2.projectPoints(beyond, np.zeros(3), np.zeros(3), K, np.array([-0.4, 0.0, 0.0, 0.0]))
    assert 0 < folded[0, 0, 0] < 1280
    assert np.isnan(lens.project(beyond)).all()
    assert np.isfinite(lens.project(np.array([[0.9, 0.0, 1.0]]))).all()
    assert np.isnan(lens.unproject(np.array([[1279.0, 360.0]]))).all()


def test_what_is_behind_is_not_seen() -> None:
    assert np.isnan(DistortedLens(K, np.zeros(4)).project(np.array([[0.1, 0.1, -1.0], [0.1, 0.1, 0.0]]))).all()


def test_it_can_be_sent_to_another_process() -> None:
    lens = DistortedLens(K, np.array(STRONG))
    lens.project(points())
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(lens)).project(points()), lens.project(points()))


@pytest.mark.parametrize(
    ("coefficients", "reason"),
    [([0.1] * 3, "4, 5 or 8 coefficients"), ([np.nan] * 4, "finite"), ([[0.1] * 4], "4, 5")],
)
def test_what_is_no_distortion(coefficients: list[float], reason: str) -> None:
    with pytest.raises(ShapeError, match=reason):
        DistortedLens(K, np.array(coefficients))
