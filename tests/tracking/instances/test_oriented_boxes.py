from __future__ import annotations

import numpy as np
import pytest

from appocc.checks import FloatArray
from tracking.instances.oriented_boxes import OrientedBoxes, fit_oriented_boxes, is_vehicle_shaped, size_deviation


def rectangle(length_m: float, width_m: float, yaw_rad: float, cell_m: float) -> FloatArray:
    """Centres of the cells of a grid that lie in a rectangle around (3, -2)."""
    steps = np.arange(-20, 20, cell_m)
    xy = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    along, across = xy @ [np.cos(yaw_rad), np.sin(yaw_rad)], xy @ [-np.sin(yaw_rad), np.cos(yaw_rad)]
    return np.asarray(xy[(np.abs(along) < length_m / 2) & (np.abs(across) < width_m / 2)] + [3.0, -2.0])


@pytest.mark.parametrize("yaw_rad", [0.0, 0.5, 1.2, -0.7])
def test_a_rectangle_is_measured(yaw_rad: float) -> None:
    xy = rectangle(4.7, 1.9, yaw_rad, 0.05)
    shapes = fit_oriented_boxes(xy, np.zeros(len(xy), np.int64), 1, 0.05)
    np.testing.assert_allclose(shapes.centroid_m, [[3.0, -2.0]], atol=0.05)
    np.testing.assert_allclose(shapes.yaw_rad, yaw_rad, atol=0.01)
    np.testing.assert_allclose([shapes.length_m[0], shapes.width_m[0]], [4.7, 1.9], atol=0.06)
    np.testing.assert_allclose(shapes.area_m2, 4.7 * 1.9, rtol=0.03)


def test_one_cell_measures_one_cell() -> None:
    shapes = fit_oriented_boxes(np.array([[5.0, 6.0]]), np.zeros(1, np.int64), 1, 0.4)
    np.testing.assert_allclose([shapes.length_m[0], shapes.width_m[0], shapes.area_m2[0]], [0.4, 0.4, 0.16])


def test_groups_do_not_mix() -> None:
    xy = np.array([[0.0, 0.0], [0.4, 0.0], [0.0, 8.0], [0.0, 8.4], [0.0, 8.8]])
    shapes = fit_oriented_boxes(xy, np.array([0, 0, 1, 1, 1]), 2, 0.4)
    np.testing.assert_allclose(shapes.centroid_m, [[0.2, 0.0], [0.0, 8.4]])
    np.testing.assert_allclose(shapes.length_m, [0.8, 1.2])
    np.testing.assert_allclose(shapes.yaw_rad, [0.0, -np.pi / 2])


@pytest.mark.parametrize(
    ("length_m", "width_m", "fill", "expected"),
    [
        (4.6, 1.9, 1.0, True),
        (12.0, 2.9, 1.0, True),  # a bus
        (9.8, 1.9, 1.0, False),  # two cars bumper to bumper
        (4.9, 4.5, 1.0, False),  # two cars side by side
        (18.0, 2.5, 1.0, False),
        (9.0, 4.0, 1.0, False),
        (4.6, 1.9, 0.7, False),  # an L
    ],
)
def test_what_can_be_one_vehicle(length_m: float, width_m: float, fill: float, expected: bool) -> None:
    length, width = np.array([length_m]), np.array([width_m])
    shapes = OrientedBoxes(np.zeros((1, 2)), np.zeros(1), length, width, fill * length * width)
    assert is_vehicle_shaped(shapes)[0] == expected


@pytest.mark.parametrize(
    ("length_m", "width_m", "expected"),
    [
        (4.6, 1.9, 0.0),
        (2.3, 1.9, np.log(2)),
        (4.6, 0.95, np.log(2)),
        (6.0, 2.2, 0.2),
        (11.5, 2.7, 0.4),
        (23.0, 5.4, 0.4 + 2 * np.log(2)),
    ],
)
def test_odd_is_what_is_unlike_all_usual_vehicles(length_m: float, width_m: float, expected: float) -> None:
    length, width = np.array([length_m]), np.array([width_m])
    shapes = OrientedBoxes(np.zeros((1, 2)), np.zeros(1), length, width, length * width)
    np.testing.assert_allclose(size_deviation(shapes), [expected], atol=1e-12)
