"""Pictures of any size become those of a setting, and a point stays on what it showed."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from appocc.camera import Camera
from appocc.checks import ByteArray
from appocc.errors import ShapeError
from appocc.geometry import transform
from appocc.models.input_images import fit_camera, fit_image, select_channels
from appocc.models.model_spec import MODEL_SPECS, ModelSpec
from appocc.rigs import read_rig

SETTING = MODEL_SPECS["360"]
AHEAD = (0.5, -0.5, 0.5, -0.5)


def camera(width_px: int, height_px: int, focal_px: float, centre_px: tuple[float, float] | None = None) -> Camera:
    u, v = centre_px or ((width_px - 1) / 2, (height_px - 1) / 2)
    k = np.array([[focal_px, 0, u], [0, focal_px, v], [0, 0, 1.0]])
    return Camera("CAM_FRONT", width_px, height_px, k, transform(AHEAD, [1.7, 0.0, 1.5]))


def blank(of: Camera) -> ByteArray:
    return np.zeros((of.height_px, of.width_px, 3), np.uint8)


def test_the_papers_full_pictures_become_the_papers_small_ones() -> None:
    full, small = read_rig("paper_full"), read_rig("paper")
    for channel in small.channels:
        found = fit_camera(full[channel], SETTING)
        assert (found.width_px, found.height_px) == (352, 128)
        np.testing.assert_allclose(found.intrinsic, small[channel].intrinsic, atol=1e-9)
        np.testing.assert_array_equal(found.ego_from_cam, small[channel].ego_from_cam)


def test_golden_numbers_of_nuscenes_pictures() -> None:
    # 0.22 of the size; (826.5 + 0.5) * 0.22 - 0.5 = 181.44; (469.5 + 0.5) * 0.22 - 0.5 - 48 = 54.9
    image, found = fit_image(np.zeros((900, 1600, 3), np.uint8), camera(1600, 900, 1250.0, (826.5, 469.5)), SETTING)
    assert image.shape == (128, 352, 3)
    expected = np.array([[275, 0, 181.44], [0, 275, 54.9], [0, 0, 1]])
    np.testing.assert_allclose(found.intrinsic, expected, atol=1e-9)


def test_a_picture_of_the_size_is_left_as_it_is() -> None:
    own = camera(352, 128, 251.0, (100.25, 90.75))
    image = np.random.default_rng(0).integers(0, 255, (128, 352, 3)).astype(np.uint8)
    found_image, found = fit_image(image, own, SETTING)
    np.testing.assert_array_equal(found_image, image)
    assert found is own


@pytest.mark.parametrize(
    ("size_px", "centre_px", "expected"),
    [
        ((704, 528), None, (175.5, 50.5)),  # 4:3, resized to 352x264, row 131.5: cut at 81
        ((704, 528), (351.5, 303.5), (175.5, 50.5)),  # its principal point lower: cut lower
        ((704, 528), (351.5, 23.5), (175.5, 11.5)),  # so high that nothing is left to cut
        ((704, 128), None, (175.5, 63.5)),  # too wide: 176 columns cut off at either side
    ],
)
def test_other_shapes_keep_the_principal_point_where_the_paper_has_it(
    size_px: tuple[int, int], centre_px: tuple[float, float] | None, expected: tuple[float, float]
) -> None:
    own = camera(*size_px, 500.0, centre_px)
    image, found = fit_image(blank(own), own, SETTING)
    assert image.shape == (128, 352, 3)
    np.testing.assert_allclose(found.intrinsic[:2, 2], expected, atol=1e-9)


@pytest.mark.parametrize("size_px", [(1920, 1080), (1600, 900), (640, 480), (1242, 375), (800, 200), (176, 99)])
def test_a_point_is_found_where_the_picture_shows_it(size_px: tuple[int, int]) -> None:
    own = camera(*size_px, 0.8 * size_px[0])
    point = np.array([[20.0, 1.3, 0.6]])
    uv, _ = own.project_ego(point)
    picture = blank(own)
    radius = max(round(size_px[0] / 60), 3)
    cv2.circle(picture, (round(uv[0, 0] * 16), round(uv[0, 1] * 16)), radius * 16, (255, 255, 255), -1, shift=4)
    image, found = fit_image(picture, own, SETTING)
    weight = image[..., 0].astype(float)
    rows, columns = np.indices(weight.shape)
    centre = [(columns * weight).sum() / weight.sum(), (rows * weight).sum() / weight.sum()]
    np.testing.assert_allclose(centre, found.project_ego(point)[0][0], atol=0.3)


def test_another_size_of_network() -> None:
    half = ModelSpec("small", SETTING.channels, SETTING.grid, 176, 64)
    found = fit_camera(camera(1920, 1080, 1371.0), half)
    np.testing.assert_allclose(found.intrinsic[:2, 2], [87.5, 49.0 - 24], atol=1e-9)


def test_a_picture_of_another_size_than_its_camera_is_refused() -> None:
    with pytest.raises(ShapeError, match=r"CAM_FRONT: expected shape \(128, 352, 3\), got \(128, 351, 3\)"):
        fit_image(np.zeros((128, 351, 3), np.uint8), camera(352, 128, 251.0), SETTING)


def test_cameras_of_a_rig_that_a_setting_uses() -> None:
    rig = ("CAM_BACK", "CAM_FRONT", "CAM_FRONT_LEFT", "CAM_FRONT_RIGHT", "CAM_LEFT", "CAM_RIGHT")
    ahead = ("CAM_FRONT_LEFT", "CAM_FRONT", "CAM_FRONT_RIGHT")
    assert select_channels(MODEL_SPECS["180"], rig) == ahead
    assert select_channels(SETTING, rig) == (*ahead, "CAM_BACK", "CAM_LEFT", "CAM_RIGHT")
    assert select_channels(SETTING, reversed(SETTING.channels)) == SETTING.channels
    assert select_channels(MODEL_SPECS["180"], ["CAM_BACK"]) == ()
