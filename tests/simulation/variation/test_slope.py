"""Scenery on a slope: in the frame of the ground it stands along gravity, and houses keep their floors level."""

from __future__ import annotations

import numpy as np
import pytest
from made_truth_town import box_mesh

from appocc.checks import BoolArray, FloatArray
from appocc.simulation.mesh import Material, Mesh, join_meshes
from appocc.simulation.variation.slope import Slope, draw_slope, lean_scenery

SLOPE = (0.06, -0.03)
HOUSE = box_mesh((20.0, 5.0, 3.0), (12.0, 8.0, 6.0), material=Material.BRICK, tag=2)
LAMP = box_mesh((4.0, -6.0, 2.5), (0.3, 0.3, 0.3), material=Material.SIGNAL, tag=5)
POLE = box_mesh((4.0, -6.0, 2.0), (0.1, 0.1, 4.0), material=Material.METAL)


def up(slope: Slope) -> FloatArray:
    """Direction against gravity, seen from ground that rises by the slope along x and y."""
    direction = np.array([*slope, 1.0])
    return np.asarray(direction / np.linalg.norm(direction))


def leaned(mesh: Mesh) -> FloatArray:
    return lean_scenery(mesh, SLOPE).vertices_m.astype(np.float64)


def at_the_top(mesh: Mesh) -> BoolArray:
    return np.asarray(mesh.vertices_m[:, 2] > mesh.vertices_m[:, 2].mean())


def test_walls_stand_along_gravity_and_floors_lie_across_it() -> None:
    points, top = leaned(HOUSE), at_the_top(HOUSE)
    wall = points[top].mean(axis=0) - points[~top].mean(axis=0)
    np.testing.assert_allclose(wall / np.linalg.norm(wall), up(SLOPE), atol=1e-3)
    heights = points @ up(SLOPE)
    assert np.ptp(heights[top]) < 0.05  # of a house that is 12 m long, on ground that rises by 0.8 m under it
    assert np.ptp(heights[~top]) < 0.05


def test_no_house_stands_above_the_ground() -> None:
    bottom = leaned(HOUSE)[~at_the_top(HOUSE), 2]
    assert bottom.max() == pytest.approx(0, abs=1e-5)
    assert bottom.min() == pytest.approx(-(12 * 0.06 + 8 * 0.03), abs=1e-4)


def test_poles_lean_and_lamps_stay_on_them() -> None:
    points, top = leaned(POLE), at_the_top(POLE)
    pole = points[top].mean(axis=0) - points[~top].mean(axis=0)
    np.testing.assert_allclose(pole / np.linalg.norm(pole), up(SLOPE), atol=1e-3)
    assert points[~top, 2].max() == pytest.approx(0, abs=1e-6)
    lamp = leaned(LAMP).mean(axis=0)
    np.testing.assert_allclose(lamp, [4 + 2.5 * SLOPE[0], -6 + 2.5 * SLOPE[1], 2.5], atol=1e-5)


def test_faces_stay_and_level_ground_changes_nothing() -> None:
    scenery = join_meshes([HOUSE, POLE, LAMP])
    np.testing.assert_array_equal(lean_scenery(scenery, SLOPE).faces, scenery.faces)
    assert lean_scenery(scenery, (0.0, 0.0)) is scenery


def test_slopes_are_those_of_streets() -> None:
    drawn = np.array([draw_slope(np.random.default_rng(seed)) for seed in range(400)])
    assert np.abs(drawn).max() <= 0.09
    np.testing.assert_allclose(drawn.mean(axis=0), 0, atol=0.01)
    np.testing.assert_allclose(drawn.std(axis=0), 0.035, atol=0.006)
