from __future__ import annotations

import numpy as np
import pytest
import torch
from made_surface import surface_of
from numpy.typing import ArrayLike
from tolerances import assert_rounded

from appocc.checks import FloatArray
from appocc.groundtruth import store
from appocc.groundtruth.colouring import LANE, NO_CAMERA, OTHER, ROAD, UNLABELLED, ColouredPoints
from appocc.groundtruth.surface import ExposureGains, GroundSurface, exposure_gains

ORIGIN = np.array([1000.0, -2000.0, 5.0])
EVEN = ExposureGains(np.ones((4, 3)))


def points(xyz: ArrayLike, rgb: ArrayLike, camera: ArrayLike = 0, ground: ArrayLike = UNLABELLED) -> ColouredPoints:
    places = np.asarray(xyz, np.float32).reshape(-1, 3)
    n = len(places)
    colours = np.broadcast_to(np.asarray(rgb, np.uint8), (n, 3)).copy()
    return ColouredPoints(
        places,
        colours,
        np.broadcast_to(np.asarray(camera, np.uint8), n).copy(),
        np.broadcast_to(np.asarray(ground, np.uint8), n).copy(),
    )


def seen_by(pairs: list[tuple[int, int]], exposure: FloatArray, count: int = 20_000) -> ColouredPoints:
    """Points of random colours that two cameras see at once, each with its own exposure; a few wild ones."""
    rng = np.random.default_rng(1)
    rows: list[tuple[FloatArray, FloatArray, int]] = []
    for number, pair in enumerate(pairs):
        xyz = rng.uniform(-20, 20, (count, 3)) + 100 * number
        true = rng.uniform(40, 160, (count, 3))
        for camera in pair:
            rgb = true * exposure[camera] + rng.normal(0, 2, (count, 3))
            rgb[: count // 10] = rng.uniform(0, 255, (count // 10, 3))
            rows.append((xyz, np.clip(rgb, 0, 255), camera))
    cameras = np.concatenate([np.full(len(row[0]), row[2]) for row in rows])
    return points(np.concatenate([row[0] for row in rows]), np.concatenate([row[1] for row in rows]), cameras)


def test_gains_even_out_known_exposures() -> None:
    exposure = np.array([[1.0, 1.0, 1.0], [1.12, 1.1, 1.08], [0.93, 0.95, 0.97], [1.0, 1.0, 1.0]])
    sweep = seen_by([(0, 1), (1, 2)], exposure)
    factors = exposure_gains([sweep], 4).factors
    evened = factors[:3] * exposure[:3]
    np.testing.assert_allclose(evened, np.tile(evened.mean(axis=0), (3, 1)), atol=0.02)
    # The brightness on the whole stays: camera 1 has half of the rows, the others a quarter each.
    assert_rounded([0.25, 0.5, 0.25] @ np.log(factors[:3]), np.zeros(3), 20_000, size=1.0)
    assert factors[3].tolist() == [1, 1, 1]  # shares nothing with anyone


def test_gains_go_no_further_than_their_bound() -> None:
    exposure = np.array([[0.6] * 3, [1.0] * 3])
    factors = exposure_gains([seen_by([(0, 1)], exposure)], 2).factors
    assert_rounded(factors, [[1.2] * 3, [1 / 1.2] * 3], 20_000)


def test_gains_need_enough_points_of_unsaturated_colours() -> None:
    exposure = np.array([[1.1] * 3, [1.0] * 3])
    assert (exposure_gains([seen_by([(0, 1)], exposure, 29)], 2).factors == 1).all()
    assert (exposure_gains([seen_by([(0, 1)], exposure, 200)], 2).factors != 1).all()
    dark = seen_by([(0, 1)], exposure * 0.01)
    glaring = seen_by([(0, 1)], exposure * 100)
    for sweep in (dark, glaring):
        regular = np.tile(np.arange(20_000) >= 2000, 2)  # the wild ones say something
        kept = points(sweep.xyz_m[regular], sweep.rgb[regular], sweep.camera[regular])
        assert (exposure_gains([kept], 2).factors == 1).all()


def test_gains_of_few_points_are_drawn_towards_none() -> None:
    exposure = np.array([[1.1] * 3, [1.0] * 3])
    few, many = (exposure_gains([seen_by([(0, 1)], exposure, n)], 2).factors[1, 0] for n in (60, 20_000))
    assert 1.001 < few < 1.01 < 1.04 < many < 1.06


def test_gains_of_points_that_two_sweeps_share_by_chance_do_not_count() -> None:
    one = points(np.random.default_rng(2).uniform(0, 9, (100, 3)), (50, 50, 50), 0)
    other = points(one.xyz_m, (100, 100, 100), 1)
    assert (exposure_gains([one, other], 2).factors == 1).all()


def test_gains_without_cameras() -> None:
    assert exposure_gains([], 0).factors.shape == (0, 3)


def test_surface_places_and_colours() -> None:
    surface = surface_of(
        [points([[0.01, 0.02, 0.1], [0.09, 0.08, 0.2], [-0.05, 0.55, 0.0]], (10, 20, 30))], ORIGIN, EVEN
    )
    order = np.argsort(surface.xyz_m[:, 0])
    assert_rounded(surface.xyz_m[order] - ORIGIN, [[-0.05, 0.55, 0.0], [0.05, 0.05, 0.15]], 2, dtype=torch.float32)
    assert surface.rgb.tolist() == [[10, 20, 30]] * 2
    assert surface.coloured.all()
    assert not surface.labelled.any()


def test_surface_evens_out_the_cameras() -> None:
    place = np.tile([[0.05, 0.05, 0.0]], (10, 1))
    sweeps = [points(place, (100, 100, 100), 0), points(place + np.array([0.4, 0, 0]), (120, 120, 120), 1)]
    gains = ExposureGains(np.array([[1.1] * 3, [1.1 / 1.2] * 3]))
    assert_rounded(surface_of(sweeps, ORIGIN, gains).rgb, np.full((2, 3), 110), 20)
    bright = surface_of([points(place, (250, 250, 250))], ORIGIN, ExposureGains(np.full((1, 3), 1.2)))
    assert bright.rgb.tolist() == [[255, 255, 255]]


def test_overhanging_objects_are_not_ground() -> None:
    rng = np.random.default_rng(3)
    xy = rng.uniform(0, 4, (4000, 2))
    road = points(np.column_stack([xy, rng.normal(0, 0.02, 4000)]), (90, 90, 90))
    leaves = points(np.column_stack([xy, rng.uniform(2.5, 6, 4000)]), (20, 160, 30))
    echo = points(np.column_stack([xy[:50], np.full(50, -3.0)]), (255, 0, 255))  # a mirror image below the road
    surface = surface_of([leaves, road, echo], ORIGIN, EVEN)
    assert len(surface.xyz_m) > 1300
    assert np.abs(surface.xyz_m[:, 2] - ORIGIN[2]).max() < 0.1
    assert (surface.rgb == 90).all()


def test_a_slope_is_ground() -> None:
    xy = np.random.default_rng(4).uniform(0, 10, (5000, 2))
    slope = points(np.column_stack([xy, 0.15 * xy[:, 0]]), (90, 90, 90))
    surface = surface_of([slope], ORIGIN, EVEN)
    np.testing.assert_allclose(surface.xyz_m[:, 2] - ORIGIN[2], 0.15 * (surface.xyz_m[:, 0] - ORIGIN[0]), atol=0.02)


@pytest.mark.parametrize(
    "outliers", [[(255, 255, 255), (250, 240, 250)], [(0, 0, 0), (3, 0, 2)], [(0, 0, 0), (255, 255, 255)]]
)
def test_colours_withstand_outliers(outliers: list[tuple[int, int, int]]) -> None:
    place = [[0.05, 0.05, 0.0]]
    sweeps = [points(place, (100 + i, 90 + i, 80 + i)) for i in range(6)] + [points(place, rgb) for rgb in outliers]
    surface = surface_of(sweeps, ORIGIN, EVEN)
    assert (np.abs(surface.rgb[0] - [102.5, 92.5, 82.5]) <= 2).all()


@pytest.mark.parametrize(
    ("rgb", "expected"), [([10], 10), ([10, 20], 15), ([10, 20, 60], 20), ([10, 20, 40, 200], 30)]
)
def test_colours_of_few_observations(rgb: list[int], expected: float) -> None:
    sweeps = [points([[0.05, 0.05, 0]], (value,) * 3) for value in rgb]
    assert surface_of(sweeps, ORIGIN, EVEN).rgb.tolist() == [[expected] * 3]


def test_points_that_no_camera_saw_have_no_colour() -> None:
    sweeps = [points([[0.05, 0.05, 0]], (0, 0, 0), NO_CAMERA), points([[0.45, 0.05, 0]], (50, 60, 70))]
    sweeps.append(points([[0.45, 0.05, 0]], (0, 0, 0), NO_CAMERA))
    surface = surface_of(sweeps, ORIGIN, EVEN)
    order = np.argsort(surface.xyz_m[:, 0])
    assert surface.coloured[order].tolist() == [False, True]
    assert surface.rgb[order[1]].tolist() == [50, 60, 70]


def labels(*ground: int) -> GroundSurface:
    """The surface of one fine cell with these labels."""
    return surface_of([points([[0.05, 0.05, 0]] * len(ground), (9, 9, 9), 0, list(ground))], ORIGIN, EVEN)


def test_shares_of_labels() -> None:
    surface = labels(ROAD, LANE, OTHER, ROAD)
    assert (surface.labelled.item(), surface.road.item(), surface.lane.item()) == (True, 0.75, 0.25)


def test_sweeps_without_labels_take_no_part_in_the_shares() -> None:
    """NuScenes labels key frames at 2 Hz, and has sweeps at 20 Hz."""
    surface = labels(ROAD, *[UNLABELLED] * 9)
    assert (surface.labelled.item(), surface.road.item(), surface.lane.item()) == (True, 1.0, 0.0)
    nothing = labels(UNLABELLED)
    assert (nothing.labelled.item(), nothing.road.item()) == (False, 0.0)


def test_strips_make_no_difference(monkeypatch: pytest.MonkeyPatch) -> None:
    """Points of some sweeps, many on the edges of cells, on ground that has steps."""
    rng = np.random.default_rng(6)
    sweeps = []
    for _ in range(4):
        place = rng.uniform(-6, 6, (20_000, 3)) * [1, 0.1, 0.05]
        place[::3, 0] = np.round(place[::3, 0] / 0.4) * 0.4
        place[:, 2] += np.where(np.floor(place[:, 0] / 0.4) % 2, 0.0, 1.0)
        sweeps.append(points(place, tuple(rng.integers(0, 255, 3).tolist())))
    found = []
    for cells in (10_000, 4, 7):
        monkeypatch.setattr(store, "_STRIP_CELLS", cells)
        found.append(surface_of(sweeps, ORIGIN, EVEN))
    for part in range(len(GroundSurface._fields)):
        assert np.array_equal(found[0][part], found[1][part])
        assert np.array_equal(found[0][part], found[2][part])


def test_an_empty_surface() -> None:
    for sweeps in ([], [points(np.zeros((0, 3)), (0, 0, 0))]):
        surface = surface_of(sweeps, ORIGIN, EVEN)
        assert [len(part) for part in surface] == [0] * 6
        assert surface.xyz_m.shape == (0, 3)
