"""Polylines, polygon filling and outlines of the ground."""

from __future__ import annotations

import numpy as np
import pytest

from appocc.checks import ByteArray, FloatArray
from appocc.grid import BEVGrid
from appocc.polylines import clean, cut, dashes, length_m, shifted, strip
from appocc.rasterise import polygon_cover
from appocc.simulation.ground.filling import Canvas
from appocc.simulation.ground.noise import tileable_noise
from appocc.simulation.ground.outlines import trace_outlines

BEND = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0]])


def quarter(radius_m: float) -> FloatArray:
    turn = np.linspace(0, np.pi / 2, 60)
    return radius_m * np.stack([np.cos(turn), np.sin(turn)], axis=1)


def test_cut_keeps_corners_and_handles_empty_ranges() -> None:
    np.testing.assert_allclose(cut(BEND, 4.0, 12.0), np.array([[4.0, 0.0], [10.0, 0.0], [10.0, 2.0]]))
    assert len(cut(BEND, 12.0, 4.0)) == 0
    assert length_m(cut(BEND, -5.0, 50.0)) == pytest.approx(20.0)


def test_dashes_cover_three_of_eight_metres() -> None:
    line = np.array([[0.0, 0.0], [80.0, 0.0]])
    pieces = dashes(line, 3.0, 5.0)
    assert [length_m(p) for p in pieces] == pytest.approx([3.0] * 10)
    assert pieces[1][0, 0] - pieces[0][0, 0] == pytest.approx(8.0)


def test_shifted_line_keeps_its_distance_around_bends() -> None:
    inner = shifted(quarter(20.0), 1.6)
    np.testing.assert_allclose(np.hypot(*inner[1:-1].T), 18.4, atol=0.01)
    np.testing.assert_allclose(shifted(BEND, 1.0), np.array([[0.0, 1.0], [9.0, 1.0], [9.0, 10.0]]))


def test_clean_drops_points_that_repeat_and_keeps_the_ends() -> None:
    line = np.array([[0.0, 0.0], [0.0, 0.001], [5.0, 0.0], [5.0, 0.001]])
    assert clean(line).tolist() == [[0.0, 0.0], [5.0, 0.001]]


@pytest.mark.parametrize("angle", [0.0, 0.3, np.pi / 4, 1.9])
def test_thin_lines_have_their_true_area(angle: float) -> None:
    canvas = Canvas(np.zeros(2), np.zeros((400, 400, 1), np.uint8))
    ahead = np.array([np.cos(angle), np.sin(angle)])
    line = np.array([20.03, 20.07]) + np.stack([-15 * ahead, 15 * ahead])
    offset = np.array([-ahead[1], ahead[0]])
    areas = []
    for k in range(7):  # a line along the cells is one or two of them wide: the mean counts
        moved = line + offset * 0.0143 * k
        canvas.raster[:] = 0
        canvas.fill([strip(moved, 0.075, -0.075)], 1)
        areas.append(canvas.raster.sum() * 0.01)
    assert np.mean(areas) == pytest.approx(30 * 0.15, rel=0.08)


def test_neighbouring_areas_neither_overlap_nor_leave_gaps() -> None:
    canvas = Canvas(np.array([-1.0, -3.0]), np.zeros((300, 300, 1), np.uint8))
    canvas.add([strip(quarter(20.0), 1.75, -1.75)], 1)
    assert canvas.raster.max() == 1
    assert canvas.raster.sum() * 0.01 == pytest.approx(np.pi / 2 * 20 * 3.5, rel=0.01)


def test_filling_beyond_the_canvas_is_cut_off() -> None:
    canvas = Canvas(np.zeros(2), np.zeros((10, 10, 1), np.uint8))
    canvas.fill([np.array([[-9.0, -9.0], [9.0, -9.0], [9.0, 0.5], [-9.0, 0.5]])], 7)
    assert (canvas.raster[:5] == 7).all()
    assert (canvas.raster[5:] == 0).all()


def blob() -> ByteArray:
    """A ring with two adjacent holes, a speck in a hole, and a separate bar."""
    mask = np.zeros((120, 160), np.uint8)
    mask[10:100, 10:120] = 1
    mask[30:60, 20:60] = 0
    mask[40:90, 70:110] = 0
    mask[50:55, 80:90] = 1
    mask[5:115, 130:140] = 1
    return mask


def test_outlines_fill_to_the_mask_without_holes() -> None:
    mask = blob()
    grid = BEVGrid(3.0, 19.0, -2.0, 10.0, 0.1)
    total = np.zeros(grid.shape)
    for outline in trace_outlines(mask, np.array([3.0, -2.0])):
        total += polygon_cover(grid, outline)
    filled = total.T >= 0.5
    assert (filled & (mask > 0)).sum() / (filled | (mask > 0)).sum() > 0.99
    assert total.max() < 1.5


def test_noise_tiles_without_a_seam() -> None:
    noise = tileable_noise(np.random.default_rng(4), 256, (32, 16), (1.0, 0.5))
    inside = np.abs(np.diff(noise, axis=0)).mean()
    assert np.abs(noise[0] - noise[-1]).mean() < 2 * inside
    assert np.abs(noise[:, 0] - noise[:, -1]).mean() < 2 * inside
