from __future__ import annotations

import numpy as np
import pytest
from made_truth_town import Street, box_mesh, made_street

from appocc.checks import ByteArray, FloatArray
from appocc.geometry import quaternion_from_yaw, transform
from appocc.grid import BEVGrid
from appocc.simulation.mesh import Material, join_meshes
from appocc.simulation.rendering.birdseye import BirdsEyeImage, render_birdseye
from appocc.simulation.rendering.renderer import Renderer
from appocc.simulation.rendering.weather import WEATHERS

GRID = BEVGrid(-20, 20, -20, 20)


@pytest.fixture(scope="module")
def street() -> Street:
    crown = box_mesh((-10, 6, 5), (4, 4, 2), material=Material.FOLIAGE, tint=(30, 60, 20))
    house = box_mesh((10, -12, 3), (8, 8, 6), material=Material.PLAIN, tint=(200, 30, 30))
    return made_street([("car", "sedan", (4.6, 1.8, 1.5), 8, 2, 0.0)], join_meshes([crown, house]))


@pytest.fixture(scope="module")
def renderer(street: Street) -> Renderer:
    made = Renderer(street.town)
    made.set_scene(street.mesh, np.zeros(1, np.uint8), np.zeros(0, np.uint8), WEATHERS["overcast"], None)
    return made


def seen(street: Street, renderer: Renderer, x: float, y: float, yaw: float) -> BirdsEyeImage:
    return render_birdseye(renderer, street.town, GRID, transform(quaternion_from_yaw(yaw), np.array([x, y, 0.0])))


def at(picture: ByteArray, xy: tuple[float, float]) -> FloatArray:
    i, j = GRID.cell_of(np.array(xy))
    return picture[:, i, j].astype(np.float64)


@pytest.fixture(scope="module")
def above(street: Street, renderer: Renderer) -> BirdsEyeImage:
    return seen(street, renderer, 0, 0, 0)


def test_colours_are_at_the_positions_of_objects(above: BirdsEyeImage) -> None:
    picture = above.appearance
    red, green, blue = at(picture, (8.2, 2.2))  # the car
    assert red > 2 * max(green, blue)
    red, green, blue = at(picture, (10.2, -12.2))  # the roof
    assert red > 2 * max(green, blue)
    red, green, blue = at(picture, (-10.2, -12.2))  # grass
    assert green > max(red, blue)
    road, line = at(picture, (-6.2, -2.2)), at(picture, (-6.2, 0.2))
    assert line.min() > road.max() + 20
    assert above.valid.all()


def test_the_image_turns_with_the_ego(street: Street, renderer: Renderer) -> None:
    # From (8, -8) looking north, the car is 10 m ahead, and the house 4 m behind and 2 m to the right.
    picture = seen(street, renderer, 8, -8, np.pi / 2).appearance
    for place in ((10.2, 0.2), (-4.2, -2.2)):
        red, green, blue = at(picture, place)
        assert red > 2 * max(green, blue)


def test_trees_are_excluded_from_one_image_only(above: BirdsEyeImage) -> None:
    inside = GRID.cell_of(np.array([-10.2, 6.2]))
    assert tuple(above.covered[:, inside[0], inside[1]]) != tuple(above.appearance[:, inside[0], inside[1]])
    differs = (above.covered != above.appearance).any(axis=0)
    x, y = np.moveaxis(GRID.centres(), 2, 0)
    assert (np.abs(x[differs] + 10) < 2.7).all()
    assert (np.abs(y[differs] - 6) < 2.7).all()


def test_cells_are_means_over_their_area(street: Street, renderer: Renderer) -> None:
    # The middle of the line, 0.2 m wide, runs through the middle of cells of 0.4 m.
    picture = seen(street, renderer, 0, 0.2, 0).appearance.astype(np.float64)
    line, road = at(picture.astype(np.uint8), (-6.2, -0.2)), at(picture.astype(np.uint8), (-6.2, -2.2))
    full = np.array([235.0] * 3)
    assert (line > road + 20).all()
    assert (line < full).all()


def test_cells_beyond_the_ground_are_invalid(street: Street, renderer: Renderer) -> None:
    above = seen(street, renderer, 40, 0, 0)
    assert (above.valid == (GRID.centres()[..., 0] < 10)).all()


def test_same_state_gives_the_same_image(street: Street, renderer: Renderer, above: BirdsEyeImage) -> None:
    again = seen(street, renderer, 0, 0, 0)
    assert again.appearance.tobytes() == above.appearance.tobytes()
    assert again.covered.tobytes() == above.covered.tobytes()
