"""Reference frames of a vehicle: axes for "behind", "left of" and "before", and nearby cells measured in them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from appocc.checks import BoolArray, FloatArray, IntArray
from appocc.geometry import wrap_angle
from grounding.goal.candidates import CandidateSet
from grounding.road.free_space import gap_m, round_heading
from grounding.road.road_map import RoadMap, align_axis
from grounding.scene_object import SceneObject

# A vehicle at a larger angle to our direction faces us.
_FACING_RAD = np.radians(120)
# A vehicle within this lateral distance of the line straight on is in or beside our path.
_OUR_PATH_M = 4.5
# The ego lane passes a vehicle up to this lateral offset.
_MAX_LATERAL_M = 15.0
# A vehicle at a larger angle to the road axis is across the road.
_ACROSS_RAD = np.radians(40)
# Weight of the vehicle's own axis against the road axis, with and without a known front.
_OWN_AXIS, _OWN_AXIS_UNSURE = 0.7, 0.3


@dataclass(frozen=True, eq=False)
class ReferenceVehicle:
    """The vehicle that a spatial relation refers to, on its road.

    Attributes:
        item: the vehicle.
        road: the road map.
        reach_m: cells are considered up to this distance from its centre along x and y.
    """

    item: SceneObject
    road: RoadMap
    reach_m: float

    @cached_property
    def travel_rad(self) -> float:
        """Our direction of travel at the vehicle."""
        return self.road.direction_at(self.item.centre_m)

    @cached_property
    def faces_us(self) -> bool:
        """Whether the vehicle points against our direction of travel."""
        return self.item.front_known and float(abs(wrap_angle(self.item.yaw_rad - self.travel_rad))) > _FACING_RAD

    @cached_property
    def is_standing(self) -> bool:
        """Whether the vehicle stands, or its speed is unknown."""
        return self.item.is_standing is not False

    @cached_property
    def lane_position(self) -> tuple[float, float]:
        """Along-track distance and lateral offset of the vehicle relative to the ego lane."""
        along, lateral = self.road.ego_lane.project(self.item.centre_m)
        return float(along), float(lateral)

    @cached_property
    def beside_ego_lane(self) -> bool:
        """Whether the ego lane passes the vehicle."""
        along, lateral = self.lane_position
        lane = self.road.ego_lane
        return bool(lane.start_m < along < lane.end_m and abs(lateral) < _MAX_LATERAL_M)

    @cached_property
    def near_our_path(self) -> bool:
        """Whether the vehicle is in or beside our path, straight ahead of or behind the ego."""
        start = self.road.start
        x, y = self.item.centre_m - start.xy_m
        return abs(float(y * start.ahead[0] - x * start.ahead[1])) < _OUR_PATH_M

    @cached_property
    def is_across(self) -> bool:
        """Whether the vehicle stands across the road."""
        return bool(abs(np.sin(self.item.yaw_rad - self.travel_rad)) > np.sin(_ACROSS_RAD))

    @cached_property
    def viewed_rad(self) -> float:
        """Longitudinal or lateral half-axis of the vehicle closest to our direction: at most 45 degrees from it.

        A quarter turn to its left is then the half-axis closest to our left, whatever the yaw of the vehicle.
        """
        turned = (self.item.yaw_rad - self.travel_rad + np.pi / 4) % (np.pi / 2) - np.pi / 4
        return float(wrap_angle(self.travel_rad + turned))

    @cached_property
    def cells(self) -> IntArray:
        """(N, 2) cells of the map within reach."""
        grid = self.road.grid
        low = np.clip(grid.cell_of(self.item.centre_m - self.reach_m), 0, grid.shape)
        high = np.clip(grid.cell_of(self.item.centre_m + self.reach_m) + 1, 0, grid.shape)
        box = np.meshgrid(np.arange(low[0], high[0]), np.arange(low[1], high[1]), indexing="ij")
        return np.stack(box, axis=-1).reshape(-1, 2)

    @cached_property
    def xy_m(self) -> FloatArray:
        """(N, 2) centres of the cells."""
        return self.road.grid.centre_of(self.cells)

    @cached_property
    def lane_coordinates(self) -> tuple[FloatArray, FloatArray]:
        """Along-track distance and lateral offset of the cells relative to the ego lane, (N,) each."""
        i, j = self.cells.T
        return self.road.along_m[i, j], self.road.lateral_m[i, j]

    @cached_property
    def road_heading_rad(self) -> FloatArray:
        """(N,) heading along the road axis in our direction."""
        i, j = self.cells.T
        axis = self.road.tracer.axis_rad[i, j]
        with_ours = np.cos(axis - self.travel_rad)
        aligned = np.where(with_ours >= 0, axis, axis + np.pi)
        # On a crossing road, the direction in which the shortest path arrives.
        return np.asarray(np.where(np.abs(with_ours) > 0.5, aligned, self.road.direction_rad[i, j]))

    @cached_property
    def aligned_heading_rad(self) -> FloatArray:
        """(N,) heading in line with or parallel to the vehicle: between its axis and the road axis."""
        own_rad = align_axis(self.item.yaw_rad, self.travel_rad)
        if self.is_across:
            return np.full(len(self.cells), own_rad)
        i, j = self.cells.T
        weight = _OWN_AXIS if self.item.front_known else _OWN_AXIS_UNSURE
        confidence = self.road.axis_confidence[i, j]
        both = confidence * np.exp(2j * self.road_heading_rad) + weight * np.exp(2j * own_rad)
        turn = wrap_angle(np.angle(both) - 2 * own_rad) / 2
        return np.asarray(wrap_angle(own_rad + turn))

    def offsets(self, forward_rad: float) -> tuple[FloatArray, FloatArray]:
        """Return offsets of the cells from the vehicle's centre, (N,) forwards and (N,) to the left."""
        offset = self.xy_m - self.item.centre_m
        cos, sin = np.cos(forward_rad), np.sin(forward_rad)
        return offset[:, 0] * cos + offset[:, 1] * sin, offset[:, 1] * cos - offset[:, 0] * sin

    def ego_side(self, forward_rad: float) -> float:
        """Return the side of the vehicle on which we pass, in a direction: 1 for left, -1 for right."""
        if self.beside_ego_lane:
            return 1.0 if self.lane_position[1] <= 0 else -1.0
        x, y = self.road.ego_lane.origin_m - self.item.centre_m
        return 1.0 if y * np.cos(forward_rad) - x * np.sin(forward_rad) >= 0 else -1.0

    def half_extent_m(self, angle_rad: float) -> float:
        """Return half of the vehicle's extent along a direction."""
        turned = angle_rad - self.item.yaw_rad
        return float(abs(np.cos(turned)) * self.item.length_m + abs(np.sin(turned)) * self.item.width_m) / 2

    def ego_half_extent_m(self, turned_rad: FloatArray) -> FloatArray:
        """Return half of the ego's extent (N,) along directions (N,) relative to its heading."""
        ego = self.road.ego
        return np.asarray(np.abs(np.cos(turned_rad)) * ego.length_m + np.abs(np.sin(turned_rad)) * ego.width_m) / 2

    def gaps_m(self, heading_rad: FloatArray) -> FloatArray:
        """Return gaps (N,) between the vehicle and the ego in the cells at headings (N,)."""
        return gap_m(self.item, self.road.ego, self.xy_m, round_heading(heading_rad))

    def candidates_in(
        self,
        region: BoolArray,
        *,
        words: str,
        cost: FloatArray,
        heading_rad: FloatArray,
        gap_m: FloatArray,
        gap_kind: str,
    ) -> CandidateSet:
        """Return the cells in a region (N,) as candidates; the arrays are (N,) each."""
        return CandidateSet(words, self.cells, cost, heading_rad, gap_m, gap_kind).subset(region)

    def front_direction(self, word: str) -> tuple[float, list[str]]:
        """Return the direction of the front for "behind" and "in front of", and that frame of reference in words."""
        item = self.item
        if not item.front_known:
            return align_axis(item.yaw_rad, self.travel_rad), [
                f"its front is not known: '{word}' is taken along our own direction of travel"
            ]
        if not self.faces_us:
            return item.yaw_rad, []
        if self.is_standing and self.near_our_path:
            return float(wrap_angle(item.yaw_rad + np.pi)), [
                f"it stands facing us beside our path: '{word}' is taken along our direction of travel"
            ]
        end = "far" if word == "behind" else "near"
        return item.yaw_rad, [
            f"it faces us: '{word}' is taken from the vehicle itself, so that the place is at its {end} end"
        ]
