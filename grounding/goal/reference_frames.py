"""Around a vehicle: the frames that 'behind', 'left of' and 'before' are taken in, and cells measured in them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from appocc.checks import BoolArray, FloatArray, IntArray
from appocc.ego_vehicle import EGO_LENGTH_M, EGO_WIDTH_M
from appocc.geometry import wrap_angle
from grounding.goal.search import Wish
from grounding.road.free_space import gap_m, whole_steps
from grounding.road.road_map import Road, agreeing
from grounding.scene_object import SceneObject

# Beyond this angle to our direction a vehicle faces us, and within this distance from our path it stands in it.
_FACING_RAD = np.radians(120)
_OUR_PATH_M = 4.5
_STANDS_MPS = 0.5
# Farther from the road's axis it stands across, and one who stands in line with it stands across too.
_ACROSS_RAD = np.radians(40)
# How much the vehicle's own axis counts beside the road's, for one who stands in line with it.
_OWN_AXIS, _OWN_AXIS_UNSURE = 0.7, 0.3


@dataclass(frozen=True)
class Around:
    """A vehicle on a road.

    Attributes:
        item: the vehicle.
        road: the road.
        reach_m: cells are looked at up to so far from its middle.
    """

    item: SceneObject
    road: Road
    reach_m: float

    @cached_property
    def ours_rad(self) -> float:
        """Our direction of travel where the vehicle stands."""
        return self.road.direction_at(self.item.centre_m)

    @cached_property
    def faces_us(self) -> bool:
        """Whether it points against our direction."""
        return self.item.front_known and float(abs(wrap_angle(self.item.yaw_rad - self.ours_rad))) > _FACING_RAD

    @cached_property
    def stands(self) -> bool:
        """Whether it does not move, as far as is known."""
        return self.item.speed_mps is None or self.item.speed_mps < _STANDS_MPS

    @cached_property
    def on_course(self) -> tuple[float, float]:
        """Metres along and aside of our own lane."""
        return self.road.own.place_of(self.item.centre_m)

    @cached_property
    def beside_course(self) -> bool:
        """Whether our own lane leads past it."""
        along, aside = self.on_course
        own = self.road.own
        return bool(own.start_m < along < own.end_m and abs(aside) < 15.0)

    @cached_property
    def in_our_path(self) -> bool:
        """Whether it stands beside or in our path, straight ahead as one sees it."""
        return abs(float(self.item.centre_m[1])) < _OUR_PATH_M

    @cached_property
    def across(self) -> bool:
        """Whether it stands across the road."""
        return bool(abs(np.sin(self.item.yaw_rad - self.ours_rad)) > np.sin(_ACROSS_RAD))

    @cached_property
    def seen_rad(self) -> float:
        """The half-axis of the vehicle, lengthwise or across, nearest to our direction: at most 45 degrees from it.

        A quarter turn to its left is then the half-axis nearest to our left, whichever way the vehicle stands.
        """
        turned = (self.item.yaw_rad - self.ours_rad + np.pi / 4) % (np.pi / 2) - np.pi / 4
        return float(wrap_angle(self.ours_rad + turned))

    @cached_property
    def cells(self) -> IntArray:
        """(N, 2) cells of the map around it."""
        grid = self.road.grid
        low = np.clip(grid.cell_of(self.item.centre_m - self.reach_m), 0, grid.shape)
        high = np.clip(grid.cell_of(self.item.centre_m + self.reach_m) + 1, 0, grid.shape)
        box = np.meshgrid(np.arange(low[0], high[0]), np.arange(low[1], high[1]), indexing="ij")
        return np.stack(box, axis=-1).reshape(-1, 2)

    @cached_property
    def xy_m(self) -> FloatArray:
        """(N, 2) their centres."""
        return self.road.grid.centre_of(self.cells)

    @cached_property
    def course(self) -> tuple[FloatArray, FloatArray]:
        """(N,) metres along our own lane, and aside."""
        along, aside = self.road.own.coordinates
        i, j = self.cells.T
        return along[i, j], aside[i, j]

    @cached_property
    def lane_rad(self) -> FloatArray:
        """(N,) heading along the road, in our direction."""
        i, j = self.cells.T
        axis = self.road.tracer.axis_rad[i, j]
        with_ours = np.cos(axis - self.ours_rad)
        plain = np.where(with_ours >= 0, axis, axis + np.pi)
        # On another road nearby, as one comes to it.
        return np.asarray(np.where(np.abs(with_ours) > 0.5, plain, self.road.direction_rad[i, j]))

    @cached_property
    def in_line_rad(self) -> FloatArray:
        """(N,) heading of one who stands in line with the vehicle or parallel to it: along both, in our direction."""
        own_rad = agreeing(self.item.yaw_rad, self.ours_rad)
        if self.across:
            return np.full(len(self.cells), own_rad)
        i, j = self.cells.T
        weight = _OWN_AXIS if self.item.front_known else _OWN_AXIS_UNSURE
        both = self.road.sure[i, j] * np.exp(2j * self.lane_rad) + weight * np.exp(2j * own_rad)
        turn = wrap_angle(np.angle(both) - 2 * own_rad) / 2
        return np.asarray(wrap_angle(own_rad + turn))

    def offsets(self, forward_rad: float) -> tuple[FloatArray, FloatArray]:
        """(N,) metres of the cells from its middle, forwards and to the left of a direction."""
        offset = self.xy_m - self.item.centre_m
        cos, sin = np.cos(forward_rad), np.sin(forward_rad)
        return offset[:, 0] * cos + offset[:, 1] * sin, offset[:, 1] * cos - offset[:, 0] * sin

    def side_of_us(self, forward_rad: float) -> float:
        """1 if we come along on the left of it in a direction, else -1."""
        if self.beside_course:
            return 1.0 if self.on_course[1] <= 0 else -1.0
        x, y = self.road.own.middle_m - self.item.centre_m
        return 1.0 if y * np.cos(forward_rad) - x * np.sin(forward_rad) >= 0 else -1.0

    def half_m(self, angle_rad: float) -> float:
        """How far it reaches from its middle in a direction."""
        turned = angle_rad - self.item.yaw_rad
        return float(abs(np.cos(turned)) * self.item.length_m + abs(np.sin(turned)) * self.item.width_m) / 2

    def gaps_m(self, heading_rad: FloatArray) -> FloatArray:
        """(N,) metres between the vehicle and the ego in the cells."""
        return gap_m(self.item, self.xy_m, whole_steps(heading_rad))


def ego_half_m(turned_rad: FloatArray) -> FloatArray:
    """How far the ego reaches from its middle in directions, from its heading."""
    return np.asarray(np.abs(np.cos(turned_rad)) * EGO_LENGTH_M + np.abs(np.sin(turned_rad)) * EGO_WIDTH_M) / 2


def front_of(around: Around, word: str) -> tuple[float, list[str]]:
    """Direction of a vehicle's front for 'behind' and 'in front of', and the frame of reference in words."""
    item = around.item
    if not item.front_known:
        return agreeing(item.yaw_rad, around.ours_rad), [
            f"its front is not known: '{word}' is taken along our own direction of travel"
        ]
    if not around.faces_us:
        return item.yaw_rad, []
    if around.stands and around.in_our_path:
        return float(wrap_angle(item.yaw_rad + np.pi)), [
            f"it stands facing us beside our path: '{word}' is taken along our direction of travel"
        ]
    end = "far" if word == "behind" else "near"
    return item.yaw_rad, [
        f"it faces us: '{word}' is taken from the vehicle itself, so that the place is at its {end} end"
    ]


def wish_of(
    words: str, around: Around, region: BoolArray, cost: FloatArray, heading: FloatArray, gap: FloatArray, how: str
) -> Wish:
    """The wish for those of the cells around a vehicle that lie in a region (N,)."""
    return Wish(words, around.cells[region], cost[region], heading[region], gap[region], how)
