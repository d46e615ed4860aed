from __future__ import annotations

import numpy as np
import pytest
from tolerances import assert_rounded

from appocc.checks import ByteArray, FloatArray
from appocc.colours import DAYLIGHT, Exposure, lab_from_rgb
from appocc.groundtruth.bodywork import BodyworkSamples, estimate_exposure, estimate_paint, extract_bodywork

LAB_TERMS = 20  # of a power, a matrix, a root and differences
RED, BLUE, YELLOW = (200, 30, 25), (30, 50, 190), (230, 190, 40)
GLASS, TYRE, GREY = (40, 50, 62), (14, 14, 15), (70, 72, 75)
NEUTRAL, EVEN = Exposure(np.ones(3), veil=0.0), np.ones(3)


def colours(*parts: tuple[tuple[int, int, int], int]) -> ByteArray:
    """So many pixels of each colour, with a little noise."""
    rgb = np.concatenate([np.tile(colour, (n, 1)) for colour, n in parts]).astype(np.float64)
    return np.clip(rgb + np.random.default_rng(1).normal(0, 2, rgb.shape), 0, 255).astype(np.uint8)


def shown(*parts: tuple[tuple[int, int, int], int], area_px: float = 1000.0, body: bool = True) -> BodyworkSamples:
    rgb = colours(*parts)
    return BodyworkSamples(rgb, lab_from_rgb(rgb), area_px, body)


def off(rgb: ByteArray, expected: tuple[int, int, int]) -> float:
    return float(np.abs(rgb.astype(float) - expected).max())


# Which pixels are bodywork ------------------------------------------------------------------------------------------


def test_only_the_band_between_tyres_and_windows_counts() -> None:
    rgb = colours((TYRE, 40), (RED, 30), (GLASS, 50))
    height = np.concatenate([np.full(40, 0.2), np.full(30, 0.5), np.full(50, 0.7)])
    seen = extract_bodywork(rgb, height, 3.0, NEUTRAL, EVEN)
    assert seen.body
    assert seen.area_px == 90.0
    np.testing.assert_array_equal(seen.rgb, rgb[40:70])
    assert_rounded(seen.lab, NEUTRAL.lab(rgb[40:70]), LAB_TERMS)


def test_where_no_bodywork_is_seen_all_is_kept_and_marked() -> None:
    rgb = colours((GLASS, 50), (RED, 11))
    seen = extract_bodywork(rgb, np.concatenate([np.full(50, 0.9), np.full(11, 0.5)]), 2.0, NEUTRAL, EVEN)
    assert not seen.body
    assert seen.area_px == 122.0
    np.testing.assert_array_equal(seen.rgb, rgb)


def test_of_a_large_picture_samples_are_kept_that_stand_for_all() -> None:
    rgb = colours((RED, 1500), (BLUE, 500))
    seen = extract_bodywork(rgb, np.full(2000, 0.5), 2.0, NEUTRAL, EVEN)
    assert len(seen.rgb) == 200
    assert seen.area_px == 4000.0
    assert (seen.rgb[:, 0] > 100).sum() == pytest.approx(150, abs=1)


def test_gains_equalise_the_cameras_and_exposure_is_per_image() -> None:
    rgb = np.array([[100, 50, 20], [240, 7, 30]] * 6, np.uint8)
    seen = extract_bodywork(rgb, np.full(12, 0.5), 1.0, NEUTRAL, np.array([1.1, 0.9, 1.0]))
    assert seen.rgb[:2].tolist() == [[110, 45, 20], [255, 6, 30]]
    assert_rounded(seen.lab, NEUTRAL.lab(rgb), LAB_TERMS)


def test_the_median_of_an_image_maps_to_middle_grey() -> None:
    image = np.full((64, 96, 3), (40, 60, 80), np.uint8)
    image[:8] = 250  # a sky of an eighth changes nothing
    lab = estimate_exposure(image).lab(np.array([40, 60, 80]))
    np.testing.assert_allclose(lab, [57.1, 0.0, 0.0], atol=0.1)


def test_night_images_stay_dark() -> None:
    dark, darker = (estimate_exposure(np.full((64, 96, 3), level, np.uint8)) for level in (20, 3))
    np.testing.assert_array_equal(dark.gain, darker.gain)


# What colour it has -------------------------------------------------------------------------------------------------


def test_shadows_and_highlights_are_trimmed() -> None:
    assert off(estimate_paint([shown((RED, 160), ((60, 8, 6), 20), ((255, 250, 250), 15))]), RED) < 6


def test_a_dense_shadow_on_paint_of_many_shades_is_trimmed() -> None:
    shades = np.linspace(40, 240, 172).astype(np.uint8)[:, None].repeat(3, axis=1)
    rgb = np.vstack([shades, np.full((28, 3), 5, np.uint8)])
    assert estimate_paint([BodyworkSamples(rgb, lab_from_rgb(rgb), 200.0, True)]).min() > 30


def test_the_larger_of_two_greys_is_the_paint() -> None:
    assert off(estimate_paint([shown((GREY, 120), ((200, 200, 200), 80))]), GREY) < 4


@pytest.mark.parametrize("hue", [RED, YELLOW, BLUE])
def test_a_hue_that_three_tenths_have_is_the_paints(hue: tuple[int, int, int]) -> None:
    """The grille, lamps and bumper of a taxi seen from ahead take more of the picture than its paint."""
    assert off(estimate_paint([shown((hue, 62), (TYRE, 60), (GREY, 80))]), hue) < 6


def test_a_hue_that_a_fifth_has_may_be_a_lamps() -> None:
    assert off(estimate_paint([shown((RED, 40), (GREY, 160))]), GREY) < 4


def test_a_tint_of_the_sky_is_no_hue() -> None:
    assert off(estimate_paint([shown(((66, 78, 98), 80), ((120, 121, 120), 120))]), (120, 121, 120)) < 4


def test_dark_and_bright_images_give_the_same_paint() -> None:
    """A quarter of red, in a picture as dark as that, is read in the picture's own light."""
    bright = colours((RED, 60), (GREY, 140))
    dark = (bright * 0.3).astype(np.uint8)
    light = Exposure(np.full(3, 0.3**-2.2), veil=0.0)
    answer = estimate_paint([BodyworkSamples(dark, light.lab(dark), 1.0, True)])
    assert off(answer, (60, 9, 7)) < 4


def test_images_are_weighted_by_area() -> None:
    near, far = shown((GREY, 50), area_px=5000.0), shown(((200, 200, 200), 200), area_px=2000.0)
    assert off(estimate_paint([near, far]), GREY) < 4
    assert off(estimate_paint([near._replace(area_px=500.0), far]), (200, 200, 200)) < 4


def test_images_without_bodywork_count_only_without_others() -> None:
    glass, paint = shown((GLASS, 200), area_px=1e6, body=False), shown((RED, 20), area_px=40.0)
    assert off(estimate_paint([glass, paint]), RED) < 6
    assert off(estimate_paint([glass]), GLASS) < 4


def test_one_pixel_is_its_own_colour() -> None:
    rgb = np.array([[10, 200, 90]], np.uint8)
    lab: FloatArray = DAYLIGHT.lab(rgb)
    assert estimate_paint([BodyworkSamples(rgb, lab, 1.0, True)]).tolist() == [10, 200, 90]
