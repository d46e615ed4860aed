from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import ArrayLike
from skimage.color import rgb2lab
from street import BLACK, BLUE, GREEN, GREY, RED, SILVER, WHITE, YELLOW, Street
from tolerances import assert_rounded

from appocc.bevmap import BEVMap
from appocc.checks import FloatArray
from appocc.colours import (
    DAYLIGHT,
    WORDS,
    Exposure,
    exposure_of,
    exposures_of,
    fit,
    gains_of,
    lab_from_rgb,
    name,
    names,
    word_probabilities,
)
from appocc.errors import ShapeError
from appocc.geometry import footprints
from appocc.srgb import linear_from_srgb
from benchmarks.colour_words import Group, either, named_groups, read_named, shares

LAB_TERMS = 20  # of a power, a matrix, a root and differences of numbers up to 500


def test_colours_are_those_of_scikit_image() -> None:
    steps = np.array([0, 1, 5, 10, 11, 12, 40, 100, 128, 200, 254, 255], np.uint8)
    rgb = np.stack(np.meshgrid(steps, steps, steps), axis=-1).reshape(-1, 3)
    expected = rgb2lab(rgb[None] / 255)[0]
    assert_rounded(lab_from_rgb(rgb), expected, LAB_TERMS, 500)
    assert_rounded(lab_from_rgb(rgb.astype(np.float64)), expected, LAB_TERMS, 500)


def test_lab_is_that_of_skimage() -> None:
    rgb = np.random.default_rng(0).integers(0, 256, (500, 3)).astype(np.uint8)
    assert_rounded(lab_from_rgb(rgb), rgb2lab(rgb[None])[0], LAB_TERMS, 500)


def test_linear_light_of_bytes_is_that_of_numbers() -> None:
    every = np.arange(256)
    linear = linear_from_srgb(every.astype(np.uint8))
    assert linear.tolist() == linear_from_srgb(every).tolist()
    np.testing.assert_allclose(linear[[0, 1, 188, 255]], [0, 1 / 255 / 12.92, 0.502886, 1], atol=1e-6)


def test_fractions_and_unknown_colours_pass() -> None:
    rgb = np.array([[[10.25, 99.5, 200.75], [np.nan] * 3]])
    assert_rounded(lab_from_rgb(rgb)[:, :1], rgb2lab(rgb[:, :1] / 255), LAB_TERMS, 500)
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
    assert_rounded(probabilities.sum(axis=-1), np.ones((40, 25)), probabilities.shape[-1])
    assert probabilities.min() > 0


def test_neighbours_overlap_and_opposites_do_not() -> None:
    assert fit("white", SILVER) > 0.15
    assert fit("grey", SILVER) > 0.15
    assert fit("silver", WHITE) > 0.1
    assert fit("white", BLACK) < 0.05
    assert fit("red", BLUE) < 0.05
    # White paint in half the light lies below sunlit silver: it must not lose its name.
    assert fit("white", (176, 176, 178)) > 0.25


def test_in_a_scene_silver_grey_and_white_stay_alive_beside_each_other() -> None:
    light = Exposure(np.ones(3))
    silver = dict(zip(WORDS, word_probabilities((184, 184, 184), light).tolist(), strict=True))
    assert silver["silver"] > 0.25
    assert silver["white"] > 0.2
    assert silver["grey"] > 0.1
    assert silver["black"] < 0.05
    assert min(fit(word, (184, 184, 184), light) for word in ("silver", "grey", "white")) > 0.25
    assert fit("grey", BLACK, light) > 0.1 > fit("white", BLACK, light)


def test_the_colour_that_a_word_fits_best_has_a_fit_of_one() -> None:
    steps = np.arange(0, 256, 5)
    rgb = np.stack(np.meshgrid(steps, steps, steps), axis=-1).reshape(-1, 3)
    for light in (DAYLIGHT, Exposure(np.ones(3))):
        for word in WORDS:
            fits = fit(word, rgb, light)
            assert 0.9 < fits.max() <= 1, word
            probabilities = word_probabilities(rgb, light)[:, WORDS.index(word)]
            assert probabilities[fits.argmax()] == pytest.approx(probabilities.max(), rel=0.05)


def test_a_colour_without_hue_is_no_hue_word() -> None:
    greys = np.repeat(np.arange(0, 256, 5)[:, None], 3, axis=1)
    assert word_probabilities(greys)[:, 4:].max() < 0.01


def test_unknown_colours_have_no_words() -> None:
    rgb = np.array([WHITE, [np.nan] * 3, RED])
    assert np.isnan(word_probabilities(rgb)).all(axis=1).tolist() == [False, True, False]
    assert np.isnan(fit("dark red", rgb)).tolist() == [False, True, False]
    assert np.isnan(fit("dark", rgb)).tolist() == [False, True, False]
    assert names(rgb) == ("white", "", "red")
    assert name([np.nan] * 3) == ""
    assert names(np.zeros((0, 3))) == ()


def test_shades_and_synonyms() -> None:
    assert fit("dark blue", (20, 30, 80)) > fit("light blue", (20, 30, 80))
    assert fit("light grey", (170, 170, 170)) > fit("dark grey", (170, 170, 170))
    assert fit("dark", BLACK) > 0.9 > 0.1 > fit("dark", WHITE)
    assert_rounded(fit("maroon", (90, 15, 25)), fit("red", (90, 15, 25)))


def test_beige_and_tan_are_no_shades_of_brown_white_or_silver() -> None:
    for word, rgb in (("beige", (215, 200, 170)), ("tan", (190, 160, 120))):
        others = [fit(word, other) for other in (WHITE, SILVER, BLACK, (100, 60, 35), (235, 200, 40))]
        assert fit(word, rgb) > 0.8 > 0.3 > max(others)


def test_every_colour_word_of_the_lexicon_has_a_fit() -> None:
    from grounding.language.syntax.lexicon import default_phrases
    from grounding.language.syntax.word_categories import WordCategory
    from grounding.vocabulary import COLOURS

    for phrase, (kind, value) in default_phrases().items():
        if kind in (WordCategory.COLOUR, WordCategory.SHADE):
            assert 0 < fit(COLOURS.get(value, value), (120, 80, 60)) <= 1, phrase


def dusk(rgb: tuple[int, int, int]) -> tuple[int, int, int]:
    """A colour in a fifth of the light, bluish."""
    linear = (np.array(rgb) / 255.0) ** 2.2 * [0.16, 0.18, 0.21]
    r, g, b = (linear ** (1 / 2.2) * 255).round().astype(int)
    return int(r), int(g), int(b)


def at_dusk(colours: list[tuple[int, int, int]]) -> tuple[BEVMap, FloatArray]:
    """A street at dusk, and the colours of its vehicles."""
    street = Street()
    street.appearance[:] = np.array(dusk((110, 110, 110)), np.uint8)[:, None, None]
    return street.bev(), np.array([dusk(rgb) for rgb in colours], np.float64)


def luminance(light: Exposure) -> float:
    return float(light.gain @ [0.212671, 0.715160, 0.072169])


def test_exposure_gives_dusk_its_colours_back() -> None:
    colours = [WHITE, WHITE, SILVER, GREY, BLACK, RED, WHITE, BLACK]
    bev, rgb = at_dusk(colours)
    assert name(dusk(WHITE)).startswith("grey")
    light = exposure_of(bev, rgb)
    assert fit("white", dusk(WHITE), light) > 0.8
    paints = ("white", "white", "silver", "grey", "black", "red", "white", "black")
    assert all(paint in said for paint, said in zip(paints, names(rgb, light), strict=True))
    road = light.lab(dusk((110, 110, 110)))
    assert np.hypot(road[1], road[2]) < 2


def test_exposure_needs_something_to_go_by() -> None:
    street = Street()
    street.known[:] = False
    nothing = exposure_of(street.bev(), np.zeros((0, 3)))
    assert_rounded(nothing.gain, np.ones(3))
    unknown = exposure_of(street.bev(), np.full((4, 3), np.nan))
    assert_rounded(unknown.gain, np.ones(3))
    lone = exposure_of(street.bev(), np.array([[50.0, 50, 50]]))
    assert 0.5 < luminance(lone) < 2
    assert name((50, 50, 50), lone).startswith(("black", "grey"))


def test_a_road_alone_tells_the_light() -> None:
    day, night = Street(), Street()
    night.appearance[:] = 30
    gains = [luminance(exposure_of(street.bev(), np.zeros((0, 3)))) for street in (day, night)]
    assert gains[1] > 4 * gains[0]


def test_too_little_road_is_no_evidence() -> None:
    street = Street()
    street.road_known[:] = False
    street.road_known[95:105, 95:104] = True
    assert_rounded(exposure_of(street.bev(), np.zeros((0, 3))).gain, np.ones(3))


@pytest.mark.parametrize("count", [1, 2, 5, 20, 50])
def test_black_vehicles_alone_are_not_made_white(count: int) -> None:
    rgb = np.tile(np.array([BLACK], np.float64), (count, 1)) + np.arange(count)[:, None] % 7
    light = exposure_of(Street().bev(), rgb)
    assert all("black" in said for said in names(rgb, light))
    assert fit("white", rgb, light).max() < 0.2


@pytest.mark.parametrize("count", [1, 2, 5, 20, 50])
def test_white_vehicles_alone_stay_white(count: int) -> None:
    rgb = np.tile(np.array([WHITE], np.float64), (count, 1)) - np.arange(count)[:, None] % 7
    light = exposure_of(Street().bev(), rgb)
    assert all(said.startswith("white") for said in names(rgb, light))


@pytest.mark.parametrize(("rgb", "word"), [(RED, "red"), (YELLOW, "yellow"), (BLUE, "blue")])
def test_a_fleet_of_one_hue_keeps_it(rgb: tuple[int, int, int], word: str) -> None:
    fleet = np.tile(np.array([rgb], np.float64), (12, 1))
    assert set(names(fleet, exposure_of(Street().bev(), fleet))) == {word}


def test_light_that_tints_everything_is_told_by_vehicles() -> None:
    street = Street()
    street.known[:] = False
    tinted = np.array([WHITE, SILVER, GREY, BLACK, WHITE, SILVER, GREY, WHITE], np.float64) * [1.0, 0.92, 0.85]
    light = exposure_of(street.bev(), tinted)
    before, after = (np.hypot(*np.moveaxis(each.lab(tinted), -1, 0)[1:]) for each in (DAYLIGHT, light))
    assert (after[:3] < 0.6 * before[:3]).all()


def test_unknown_colours_say_nothing_of_the_light() -> None:
    bev, rgb = at_dusk([WHITE, SILVER, GREY, BLACK])
    more = np.concatenate([rgb, [[np.nan, 3.0, 4.0]], np.full((2, 3), np.nan)])
    assert exposure_of(bev, more).gain.tolist() == exposure_of(bev, rgb).gain.tolist()


def test_exposure_of_twice_the_light_is_half() -> None:
    rgb = np.array([WHITE, SILVER, GREY, BLACK, WHITE, GREY, BLACK, RED], np.float64)
    whole, half = Street(), Street()
    whole.appearance[:], half.appearance[:] = 110, 81  # half the linear light
    dimmed = 255 * (linear_from_srgb(rgb) / 2) ** (1 / 2.4)  # near enough
    ratio = luminance(exposure_of(half.bev(), dimmed)) / luminance(exposure_of(whole.bev(), rgb))
    assert ratio == pytest.approx(2, rel=0.25)


def shaded_street() -> tuple[BEVMap, FloatArray, FloatArray]:
    """A street whose left side lies in orange shade: the map, colours and outlines of four cars a side."""
    street, paints = Street(), (WHITE, GREY, BLACK, WHITE)
    shade, bright = np.array([0.3, 0.28, 0.24]), np.ones(3)
    rgb, places = [], []

    def lit(paint: ArrayLike, light: FloatArray) -> tuple[int, int, int]:
        red, green, blue = (int(v) for v in 255 * (linear_from_srgb(paint) * light) ** (1 / 2.4))
        return red, green, blue

    for side, light in ((4.0, shade), (-4.0, bright)):
        shaded = street.grid.centres()[0, :, 1] > 1.5
        street.appearance[:, :, shaded == (side > 0)] = np.array(lit((110, 110, 110), light), np.uint8)[:, None, None]
        for i, paint in enumerate(paints):
            x_m = 6.0 + 8 * i
            street.car(f"{side} {i}", x_m, side, lit(paint, light))
            rgb.append(lit(paint, light))
            places.append([x_m, side])
    outlines = footprints(np.array(places), np.zeros(8), np.tile([4.4, 1.8], (8, 1)))
    return street.bev(), np.array(rgb, np.float64), outlines


def test_shade_and_lamps_are_told_by_the_road_beside() -> None:
    bev, rgb, outlines = shaded_street()
    one, each = exposure_of(bev, rgb), exposures_of(bev, rgb, outlines)
    said = [name(colour, light) for colour, light in zip(rgb, each, strict=True)]
    assert all("white" in said[i] for i in (0, 3, 4, 7))
    assert said[2] == said[6] == "black"
    assert fit("white", rgb[0], each[0]) > 1.5 * fit("white", rgb[0], one)
    ratio = each[0].gain / each[4].gain
    assert (ratio > 1.5).all()
    assert ratio[2] > ratio[0]


def test_places_off_the_road_are_in_the_light_of_all() -> None:
    bev, rgb, outlines = shaded_street()
    away = outlines + np.array([0.0, 25.0])
    outside = outlines + np.array([1000.0, 0.0])
    for far in (away, outside):
        gains = [light.gain.tolist() for light in exposures_of(bev, rgb, far)]
        assert gains == [exposure_of(bev, rgb).gain.tolist()] * 8


def test_exposures_of_nothing_and_of_odd_shapes() -> None:
    bev, rgb, outlines = shaded_street()
    assert exposures_of(bev, np.zeros((0, 3)), np.zeros((0, 4, 2))) == ()
    assert gains_of(bev, np.zeros((0, 3)), np.zeros((0, 4, 2))).shape == (0, 3)
    gains = [light.gain.tolist() for light in exposures_of(bev, rgb, outlines)]
    assert gains_of(bev, rgb, outlines).tolist() == gains
    with pytest.raises(ShapeError, match="footprints_m"):
        exposures_of(bev, rgb, outlines[:3])
    with pytest.raises(ShapeError, match="vehicles_rgb"):
        exposures_of(bev, rgb[:, :2], outlines)
    street = Street()
    street.road_known[:] = False
    lights = exposures_of(street.bev(), rgb, outlines)
    assert [light.gain.tolist() for light in lights] == [exposure_of(street.bev(), rgb).gain.tolist()] * 8


def test_the_veil_takes_light_from_dark_colours_only() -> None:
    veiled, plain = Exposure(np.ones(3), veil=0.2, blur=0.0), Exposure(np.ones(3), veil=0.0, blur=0.0)
    rgb = np.array([[0, 0, 0], [60, 60, 60], [128, 128, 128], [255, 255, 255]])
    loss = plain.lab(rgb)[:, 0] - veiled.lab(rgb)[:, 0]
    assert loss[[0, 3]] == pytest.approx([0, 0], abs=1e-3)
    assert loss[1] > loss[2] > 5


def test_exposure_is_checked() -> None:
    assert DAYLIGHT.gain.tolist() == [1, 1, 1]
    for gain in (np.ones(2), np.array([1.0, 0.0, 1.0]), np.array([1.0, np.nan, 1.0]), np.array([1.0, np.inf, 1.0])):
        with pytest.raises(ShapeError, match="exposure gain"):
            Exposure(gain)
    for veil, blur in ((-0.1, 0.0), (0.0, -1.0), (np.nan, 0.0), (0.0, np.inf)):
        with pytest.raises(ShapeError, match="veil and blur"):
            Exposure(np.ones(3), veil, blur)


# Real vehicles, named by a person -----------------------------------------------------------------------------------


def test_enough_real_vehicles_are_named() -> None:
    named = read_named()
    assert len(named) >= 60
    assert {row.dataset for row in named} == {"pandaset", "nuscenes"}
    assert {row.word for row in named} <= set(WORDS)
    assert {row.second for row in named} <= {"", *WORDS}
    assert all(row.word != row.second and 0 <= row.rgb.min() <= row.rgb.max() <= 255 for row in named)
    assert len({row.word for row in named}) >= 8


def test_real_vehicles_are_named_as_people_do() -> None:
    named = read_named()
    figures = shares(group for groups in named_groups(named).values() for group in groups)
    assert figures.vehicles == len(named)
    assert figures.first >= 0.43
    assert figures.two >= 0.62
    assert figures.pairs >= 0.8
    assert either(named) >= 0.62


def test_shares_count_as_they_say() -> None:
    probabilities = np.full((3, 12), 0.01)
    probabilities[0, :2] = 0.6, 0.3  # black, said black
    probabilities[1, :2] = 0.5, 0.4  # black, said grey
    probabilities[2, 2:4] = 0.3, 0.6  # white, said black
    group = Group(["black", "grey", "black"], probabilities, probabilities)
    figures = shares([group])
    assert figures.vehicles == 3
    assert figures.first == pytest.approx(1 / 3)
    assert figures.two == pytest.approx(2 / 3)
    assert figures.probability == pytest.approx((0.6 + 0.4 + 0.01) / 3)
    assert figures.found == 1.0
    # Black: 0.6 beats 0.5, 0.01 does not; grey: 0.4 beats 0.3 and 0.01.
    assert figures.pairs == pytest.approx((0.5 + 1.0) / 2)
    assert np.isnan(shares([]).first)
