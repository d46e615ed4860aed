"""Spatial relations: they follow the direction of the road and not the axes of the grid."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from street import Street

from appocc.checks import FloatArray
from grounding.referent.object_table import ObjectTable
from grounding.referent.spatial_relations import fit_between, fit_relation

ALL = ("behind", "in_front_of", "before", "past", "left_of", "right_of", "opposite", "near", "next_to", "same_as")


class Straight:
    """A lane model with one constant direction."""

    def __init__(self, angle_rad: float) -> None:
        self.angle_rad = angle_rad

    def direction_rad(self, xy_m: FloatArray) -> FloatArray:
        return np.full(len(xy_m), self.angle_rad)


def table(angle_rad: float = 0.0) -> ObjectTable:
    """Make cars along a road that is rotated around the ego: one in the centre, then one on each side of it.

    No two are equally far along, where rounding would decide who is nearer.
    """
    street = Street().car("it", 12, 0).car("left", 11.6, 3).car("right", 12.5, -3)
    made = street.car("ahead", 19, 0.5).car("back", 5, 0).car("far", 30, 5).scene().table
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    lanes: Any = Straight(angle_rad)
    turned = made.xy_m @ np.array([[cos, sin], [-sin, cos]])
    return replace(made, xy_m=turned, yaw_rad=made.yaw_rad + angle_rad, lanes=lanes)


IT = np.zeros(1, np.int64)


@pytest.mark.parametrize(
    ("relation", "name"),
    [("left_of", 1), ("right_of", 2), ("in_front_of", 3), ("past", 3), ("behind", 4), ("before", 4)],
)
def test_relations_select_the_object_on_that_side(relation: str, name: int) -> None:
    fit = fit_relation(relation, table(), IT)[:, 0]
    others = np.delete(fit, name)
    assert fit[name] > 0.5
    assert others.max() < 0.2


@pytest.mark.parametrize("relation", ALL)
@pytest.mark.parametrize("angle_rad", [0.7, -2.2])
def test_relations_do_not_depend_on_the_road_direction_in_the_grid(relation: str, angle_rad: float) -> None:
    every = np.arange(len(table()))
    straight, turned = (fit_relation(relation, each, every) for each in (table(), table(angle_rad)))
    np.testing.assert_allclose(turned, straight, atol=1e-9)
    np.testing.assert_allclose(fit_between(table(angle_rad), every), fit_between(table(), every), atol=1e-9)
