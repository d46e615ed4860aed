from __future__ import annotations

import pickle

import cv2
import numpy as np
import pytest

from appocc.checks import FloatArray
from appocc.errors import ShapeError
from appocc.lenses import FisheyeLens, kannala_brandt, ocamcalib, polynomial_fisheye, unified_sphere

K = np.array([[300.0, 0, 640], [0, 310, 480], [0, 0, 1]])
KB = [0.05, -0.01, 0.003, -0.001]
# The polynomial and offsets of WoodScape's example file.
WOODSCAPE = polynomial_fisheye([339.749, -31.988, 48.275, -7.201], [643.442, 479.407])
SCARAMUZZA = ocamcalib([-200.0, 0.0, 1.7e-3, -1e-6, 2e-9], [640, 480], (0.9999, 0.0003, -0.0002))
# About the parameters of KITTI-360's fisheyes.
MEI = unified_sphere(2.2134, (0.0168, 1.6548), (1336.3, 1335.8), (716.94, 705.76))
LENSES = [kannala_brandt(K, KB), WOODSCAPE, SCARAMUZZA, MEI]


def rays(half_deg: float, count: int = 500) -> FloatArray:
    made = np.random.default_rng(0)
    angle, around = made.uniform(0, np.radians(half_deg), count), made.uniform(-np.pi, np.pi, count)
    return np.stack([np.sin(angle) * np.cos(around), np.sin(angle) * np.sin(around), np.cos(angle)], axis=1)


@pytest.mark.parametrize("lens", LENSES)
def test_what_is_projected_to_a_pixel_is_what_it_sees_up_to_200_degrees(lens: FisheyeLens) -> None:
    pixels = lens.project(3.0 * rays(99.9))
    np.testing.assert_allclose(lens.unproject(pixels), rays(99.9), atol=1e-9)
    assert np.isnan(lens.project(np.array([[1.0, 0.0, -0.2]]))).all(), "101 degrees off the axis"


def test_it_projects_as_opencv() -> None:
    ahead = rays(89.0)
    skewed = K.copy()
    skewed[0, 1] = 3.0
    wanted, _ = cv2.fisheye.projectPoints(
        ahead[:, None], np.zeros(3), np.zeros(3), K, np.array(KB), alpha=3.0 / 300.0
    )
    np.testing.assert_allclose(kannala_brandt(skewed, KB).project(ahead), wanted[:, 0], atol=1e-9)


def test_the_unified_sphere_is_opencvs() -> None:
    """cv2.projectPoints has the same distortion of the point on the normalised plane behind the sphere."""
    ahead = rays(99.0)
    behind = ahead + np.array([0, 0, 2.2134])
    k = np.array([[1336.3, 0, 716.94], [0, 1335.8, 705.76], [0, 0, 1]])
    wanted, _ = cv2.projectPoints(behind, np.zeros(3), np.zeros(3), k, np.array([0.0168, 1.6548, 0, 0]))
    np.testing.assert_allclose(MEI.project(ahead), wanted[:, 0], atol=1e-9)
    with pytest.raises(ShapeError, match="xi of 0 or more"):
        unified_sphere(-1.0, (0, 0), (1, 1), (0, 0))


def test_the_published_polynomial() -> None:
    # rho(1 rad) is the sum of the coefficients; u = rho x / chi + cx_offset + width / 2 - 0.5.
    (pixel,) = WOODSCAPE.project(np.array([[np.sin(1.0), 0.0, np.cos(1.0)]]))
    assert pixel == pytest.approx([339.749 - 31.988 + 48.275 - 7.201 + 3.942 + 640 - 0.5, -3.093 + 483 - 0.5])


def test_the_mirrors_polynomial_has_x_down_and_z_backwards() -> None:
    # At 100 pixels below the centre the ray of OCamCalib is (100, 0, f(100)): x down, z backwards.
    height = -200 + 1.7e-3 * 100**2 - 1e-6 * 100**3 + 2e-9 * 100**4
    (ray,) = ocamcalib([-200.0, 0.0, 1.7e-3, -1e-6, 2e-9], [640, 480]).unproject(np.array([[640.0, 580.0]]))
    assert ray == pytest.approx(np.array([0.0, 100.0, -height]) / np.hypot(100, height))
    # row = c x + d y + row of the centre, column = e x + y + column of the centre.
    (pixel,) = ocamcalib([-200.0], [640, 480], (0.9, 0.1, 0.2)).project(np.array([[0.0, 100.0, 200.0]]))
    assert pixel == pytest.approx([640 + 0.2 * 100, 480 + 0.9 * 100])


def test_the_image_circle_ends_what_is_seen() -> None:
    lens = kannala_brandt(K, KB, wide_deg=120)
    inside, outside = lens.project(np.array([[np.sin(a), 0.0, np.cos(a)] for a in np.radians([59.9, 60.1])]))
    assert np.isfinite(inside).all()
    assert np.isnan(outside).all()
    assert np.isnan(lens.unproject(inside[None] + [30.0, 0.0])).all()
    assert lens.unproject(np.array([[640.0, 480.0]]))[0] == pytest.approx([0, 0, 1])


def test_a_polynomial_is_used_as_far_as_it_rises() -> None:
    # 300 a - 100 a^2 rises up to 1.5 rad.
    lens = polynomial_fisheye([300.0, -100.0], [640, 480])
    seen = np.isfinite(lens.project(np.array([[np.sin(a), 0.0, np.cos(a)] for a in (1.49, 1.51)]))).all(axis=1)
    assert seen.tolist() == [True, False]


@pytest.mark.parametrize("lens", LENSES)
def test_it_can_be_sent_to_another_process(lens: FisheyeLens) -> None:
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(lens)).project(rays(60)), lens.project(rays(60)))


def test_what_is_no_fisheye() -> None:
    with pytest.raises(ShapeError, match="farther from the centre"):
        polynomial_fisheye([-300.0], [640, 480])
    with pytest.raises(ShapeError, match="negative first coefficient a0, got 200"):
        ocamcalib([200.0], [640, 480])
    with pytest.raises(ShapeError, match="no mirror image"):
        polynomial_fisheye([300.0], [640, 480], aspect=-1.0)
    with pytest.raises(ShapeError, match="expected shape"):
        kannala_brandt(K, [0.1, 0.1])
