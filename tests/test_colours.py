from __future__ import annotations

import numpy as np
import pytest
from skimage.color import rgb2lab
from street import BLACK, BLUE, GREEN, GREY, RED, SILVER, WHITE, YELLOW, Street

from appocc.colours import (
    DAYLIGHT,
    WORDS,
    Exposure,
    exposure_of,
    fit,
    lab_from_rgb,
    linear_from_srgb,
    name,
    word_probabilities,
)
from appocc.errors import ShapeError


def test_colours_are_those_of_scikit_image() -> None:
    steps = np.array([0, 1, 5, 10, 11, 12, 40, 100, 128, 200, 254, 255], np.uint8)
    rgb = np.stack(np.meshgrid(steps, steps, steps), axis=-1).reshape(-1, 3)
    expected = rgb2lab(rgb[None] / 255)[0]
    np.testing.assert_allclose(lab_from_rgb(rgb), expected, atol=1e-9)
    np.testing.assert_allclose(lab_from_rgb(rgb.astype(np.float64)), expected, atol=1e-9)


def test_lab_is_that_of_skimage() -> None:
    rgb = np.random.default_rng(0).integers(0, 256, (500, 3)).astype(np.uint8)
    np.testing.assert_allclose(lab_from_rgb(rgb), rgb2lab(rgb[None])[0], atol=1e-9)


def test_linear_light_of_bytes_is_that_of_numbers() -> None:
    every = np.arange(256)
    linear = linear_from_srgb(every.astype(np.uint8))
    assert linear.tolist() == linear_from_srgb(every).tolist()
    np.testing.assert_allclose(linear[[0, 1, 188, 255]], [0, 1 / 255 / 12.92, 0.502886, 1], atol=1e-6)


def test_fractions_and_unknown_colours_pass() -> None:
    rgb = np.array([[[10.25, 99.5, 200.75], [np.nan] * 3]])
    np.testing.assert_allclose(lab_from_rgb(rgb)[:, :1], rgb2lab(rgb[:, :1] / 255), atol=1e-9)
    assert np.isnan(lab_from_rgb(rgb)[0, 1]).all()


def test_white_grey_and_black_have_no_hue() -> None:
    lab = lab_from_rgb([[255, 255, 255], [119, 119, 119], [0, 0, 0]])
    np.testing.assert_allclose(lab, [[100.0, 0.0, 0.0], [50.034, 0.0, 0.0], [0.0, 0.0, 0.0]], atol=5e-3)


def test_lab_keeps_leading_axes() -> None:
    assert lab_from_rgb(np.zeros((4, 5, 3), np.uint8)).shape == (4, 5, 3)
    assert lab_from_rgb((255, 255, 255)) == pytest.approx([100, 0, 0], abs=0.05)


@pytest.mark.parametrize(
    ("rgb", "word"),
    [
        (WHITE, "white"),
        (SILVER, "silver"),
        (GREY, "grey"),
        (BLACK, "black"),
        (RED, "red"),
        (BLUE, "blue"),
        (GREEN, "green"),
        (YELLOW, "yellow"),
        ((230, 120, 30), "orange"),
        ((100, 62, 35), "brown"),
        ((110, 40, 130), "purple"),
        ((245, 160, 190), "pink"),
        ((90, 15, 25), "red"),
    ],
)
def test_plain_colours_have_their_names(rgb: tuple[int, int, int], word: str) -> None:
    probabilities = word_probabilities(rgb)
    assert WORDS[int(probabilities.argmax())] == word
    assert name(rgb).startswith(word)


def test_probabilities_sum_to_one_and_leave_nothing_out() -> None:
    rgb = np.random.default_rng(1).integers(0, 256, (40, 25, 3))
    probabilities = word_probabilities(rgb)
    assert probabilities.shape == (40, 25, 12)
    assert probabilities.sum(axis=-1) == pytest.approx(np.ones((40, 25)))
    assert probabilities.min() > 0


def test_neighbours_overlap_and_opposites_do_not() -> None:
    assert fit("white", SILVER) > 0.15
    assert fit("grey", SILVER) > 0.15
    assert fit("silver", WHITE) > 0.15
    assert fit("white", BLACK) < 0.05
    assert fit("red", BLUE) < 0.05
    # White paint in half the light lies below sunlit silver: it must not lose its name.
    assert fit("white", (176, 176, 178)) > 0.3


def test_shades_and_synonyms() -> None:
    assert fit("dark blue", (20, 30, 80)) > fit("light blue", (20, 30, 80))
    assert fit("light grey", (170, 170, 170)) > fit("dark grey", (170, 170, 170))
    assert fit("dark", BLACK) > 0.9 > 0.1 > fit("dark", WHITE)
    assert fit("maroon", (90, 15, 25)) == pytest.approx(float(fit("red", (90, 15, 25))))


def test_every_colour_word_of_the_lexicon_has_a_fit() -> None:
    from grounding.lexicon import Kind, phrases

    for phrase, (kind, value) in phrases().items():
        if kind in (Kind.COLOUR, Kind.SHADE):
            assert 0 < fit(value, (120, 80, 60)) <= 1, phrase


def dusk(rgb: tuple[int, int, int]) -> tuple[int, int, int]:
    """A colour in a fifth of the light, bluish."""
    linear = (np.array(rgb) / 255.0) ** 2.2 * [0.16, 0.18, 0.21]
    r, g, b = (linear ** (1 / 2.2) * 255).round().astype(int)
    return int(r), int(g), int(b)


def test_exposure_gives_dusk_its_colours_back() -> None:
    street = Street()
    street.appearance[:] = np.array(dusk((110, 110, 110)), np.uint8)[:, None, None]
    colours = [WHITE, WHITE, SILVER, GREY, BLACK, RED]
    for i, rgb in enumerate(colours):
        street.car(f"car {i}", 5.0 + 6 * i, 3.0, dusk(rgb))
    assert name(dusk(WHITE)).startswith("grey")
    exposure = street.scene().exposure
    assert fit("white", dusk(WHITE), exposure) > 0.8
    assert name(dusk(GREY), exposure).startswith("grey")
    assert name(dusk(BLACK), exposure).startswith("black")
    assert name(dusk(RED), exposure).startswith("red")
    road = exposure.lab(dusk((110, 110, 110)))
    assert np.hypot(road[1], road[2]) < 2


def test_exposure_needs_enough_to_go_by() -> None:
    street = Street()
    street.known[:] = False
    assert exposure_of(street.bev(), np.array([[50.0, 50, 50]])).gain.tolist() == [1, 1, 1]


def test_bright_scenes_are_not_changed() -> None:
    bev = Street().bev()
    assert exposure_of(bev, np.full((6, 3), 250.0)).gain == pytest.approx(np.ones(3))


def test_exposure_is_checked() -> None:
    assert DAYLIGHT.gain.tolist() == [1, 1, 1]
    for gain in (np.ones(2), np.array([1.0, 0.0, 1.0]), np.array([1.0, np.nan, 1.0])):
        with pytest.raises(ShapeError, match="exposure gain"):
            Exposure(gain)
