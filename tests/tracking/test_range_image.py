"""What nearer boxes hide from the ego."""

from __future__ import annotations

import numpy as np
import pytest

from tracking.range_image import RangeImage

CAR_M, TRUCK_M = (1.8, 4.5), (2.5, 12.0)


def hidden(
    xy_m: tuple[float, float],
    *,
    box_xy_m: tuple[float, float] = (10.0, 0.0),
    yaw_rad: float = 0.0,
    solid: bool = True,
) -> float:
    """Share of a car that one truck hides."""
    image = RangeImage(np.array([box_xy_m]), np.array([yaw_rad]), np.array([TRUCK_M]), np.array([solid]))
    return float(image.hidden(np.array([xy_m]), np.array([CAR_M]))[0])


@pytest.mark.parametrize("bearing_rad", [0.0, 1.0, np.pi, -2.0])
def test_a_car_behind_a_truck_is_hidden_in_all_directions(bearing_rad: float) -> None:
    ahead = np.array([np.cos(bearing_rad), np.sin(bearing_rad)])
    near, far = tuple((10 * ahead).tolist()), tuple((20 * ahead).tolist())
    assert hidden(far, box_xy_m=near, yaw_rad=bearing_rad) == 1
    assert hidden(near, box_xy_m=far, yaw_rad=bearing_rad) == 0


def test_a_car_is_hidden_by_parts() -> None:
    """The right edge of the truck, seen at 10 m, is 2.5 m to the right at 20 m."""
    assert hidden((20, -2.5)) == pytest.approx(0.5, abs=0.1)
    assert hidden((20, -4.0)) == 0


def test_a_truck_hides_more_from_its_side() -> None:
    assert hidden((20, 8)) == 0
    assert hidden((20, 8), yaw_rad=np.pi / 2) == 1


def test_boxes_hide_together_what_none_hides_alone() -> None:
    xy_m, size_m = np.array([(10.0, 0.5), (10.0, -0.5)]), np.full((2, 2), 1.0)
    image = RangeImage(xy_m, np.zeros(2), size_m, np.ones(2, np.bool_))
    assert image.hidden(np.array([[20.0, 0.0]]), np.array([CAR_M]))[0] == 1


def test_weak_boxes_and_neighbours_hide_nothing() -> None:
    assert hidden((20, 0), solid=False) == 0
    assert hidden((11, 0)) == 0


def test_without_objects_or_boxes() -> None:
    none = np.zeros((0, 2))
    image = RangeImage(none, np.zeros(0), none, np.zeros(0, np.bool_))
    assert image.hidden(np.array([[20.0, 0.0]]), np.array([CAR_M])).tolist() == [0]
    assert not len(image.hidden(none, none))
