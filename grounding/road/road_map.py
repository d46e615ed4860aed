"""The road map of a scene: free space, shortest paths, direction of travel and the ego lane."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
from scipy import ndimage

from appocc.bevmap import LANE, BEVMap
from appocc.checks import BoolArray, FloatArray, IntArray
from appocc.ego_vehicle import EgoVehicle
from appocc.geometry import wrap_angle
from appocc.grid import BEVGrid
from appocc.motion_state import DRIVING_MPS
from grounding.road.car_paths import MOST_BACK_M, CarPaths
from grounding.road.edges import cells_to_edge, cells_to_marking
from grounding.road.free_space import OFF_ROAD, TAKEN, UNKNOWN, FreeSpace, cover_cells
from grounding.road.junctions import find_junctions
from grounding.road.landmarks import NO_LANDMARKS, Landmarks
from grounding.road.lane_model import Centreline
from grounding.road.orientation import estimate_axes, travel_directions
from grounding.road.pose import Pose2D
from grounding.road.routing import ShortestPaths, find_shortest_paths
from grounding.road.sides import TrafficSides
from grounding.road.style import DEFAULT_STYLE, DrivingStyle
from grounding.road.tracing import CentrelineTracer
from grounding.scene_object import SceneObject

# Paths start at the free cell nearest to the ego's centre, which may itself be on a misplaced kerb.
_MAX_START_M = 6.0
# Cells this near to the footprint of the ego count as free.
_START_MARGIN_M = 0.3
# Cells around the box of a vehicle that may be its own on a map.
_EDGE_CELLS = 1
# Greatest holes in the road of a predicted map that are filled, and greatest ones that nobody has seen, cells.
_HOLE_CELLS, _UNSEEN_CELLS = 6, 40
_MAX_EDGE_M, _MAX_HALF_M, _MAX_ROAD_M = 16.0, 12.0, 24.0
# A narrower road is driven in its middle.
_ONE_LANE_M = 5.5
# A place this far beyond the middle of the road is on the other side. A marking this near to half of the width is it.
_MIDDLE_M, _MARKED_M = 0.1, 1.5
# Extra cost of a metre in the narrowest passage, and outside the ego lane.
_NARROW, _WIDE_M, _OFF_LANE, _LANE_M = 0.8, 1.6, 0.3, 3.0
# Positions up to this lateral offset belong to the road of the ego lane if its direction agrees.
_SAME_ROAD_M = 12.0
# Least cosine between directions that agree.
_PARALLEL = 0.7


@dataclass(frozen=True, eq=False, kw_only=True)
class RoadMap:
    """Road geometry of a map; arrays (X, Y) of its grid, ego frame.

    Attributes:
        grid: cells.
        ego: size of the ego vehicle.
        start: pose of the ego.
        free_space: poses at which the ego footprint is valid.
        tracer: traces centrelines; holds the road axis of all cells.
        direction_rad: direction of travel along the shortest path from the ego; behind the ego, towards it.
        axis_confidence: 0..1, agreement of edges, markings and vehicles on the road axis; low in junctions.
        drivable: road cells, with or without vehicles; small holes of predicted maps are filled.
        clearance_m: distance to the nearest cell that is no free road; cells below the ego count as free.
        extra_cost: cost of a metre, beyond one: in narrow passages and outside the ego lane.
        paths: shortest paths from the ego.
        ego_lane: centreline of the ego lane; along-track distance counts from the ego's centre.
        along_m: along-track distance of all cells, by the ego lane.
        lateral_m: lateral offset of all cells from the ego lane; left is positive.
        sides: of the road, by the vehicles on it.
        landmarks: crossings, stop lines and the like, as far as a vector map is known.
        style: gaps that the ego keeps.
        speed_mps: of the ego, forwards; None: unknown.
    """

    grid: BEVGrid
    ego: EgoVehicle
    start: Pose2D
    free_space: FreeSpace
    tracer: CentrelineTracer
    direction_rad: FloatArray
    axis_confidence: FloatArray
    drivable: BoolArray
    clearance_m: FloatArray
    extra_cost: FloatArray
    paths: ShortestPaths
    ego_lane: Centreline
    along_m: FloatArray
    lateral_m: FloatArray
    sides: TrafficSides
    landmarks: Landmarks = NO_LANDMARKS
    style: DrivingStyle = DEFAULT_STYLE
    speed_mps: float | None = None

    @classmethod
    def from_map(
        cls,
        bev: BEVMap,
        objects: Sequence[SceneObject],
        ego: EgoVehicle,
        start: Pose2D | None = None,
        left_hand_traffic: bool | None = None,
        landmarks: Landmarks = NO_LANDMARKS,
        style: DrivingStyle = DEFAULT_STYLE,
        lane: Centreline | None = None,
    ) -> RoadMap:
        """Return the road map of a map and the vehicles on it.

        Args:
            bev: the map.
            objects: vehicles on it.
            ego: size of the ego vehicle.
            start: pose of the ego; None: where it is now.
            left_hand_traffic: whether traffic drives on the left; None: as oncoming vehicles do, else on the right.
            landmarks: of a vector map, ego frame.
            style: gaps that the ego keeps.
            lane: the present lane; from a start beside it, the ego drives on in that lane.
        """
        start = start or Pose2D(ego.centre_m, 0.0)
        grid, free_space = bev.grid, FreeSpace.from_map(bev, objects, ego, style.clearance_m)
        flags = free_space.cell_flags
        soft = not ((bev.occupancy == 0) | (bev.occupancy == 1)).all()
        drivable = _fill_holes((flags & (OFF_ROAD | UNKNOWN)) == 0, unknown=(flags & UNKNOWN) > 0, soft=soft)
        axis, confidence = estimate_axes(grid, drivable, (flags & UNKNOWN) == 0, bev.on[LANE], objects)
        edge_m, marking_m = _distance_m(grid, drivable), _distance_m(grid, ~bev.on[LANE])
        tracer = CentrelineTracer(grid, ego.width_m, axis, confidence, edge_m, marking_m)
        ours = lane.from_beside(start.xy_m, start.heading_rad) if lane is not None else None
        ego_lane = ours or tracer.trace(start.xy_m, start.heading_rad)
        along_m, lateral_m = ego_lane.cell_coordinates(grid)
        clearance = _distance_m(grid, drivable & ((flags & TAKEN) == 0))
        free = clearance > ego.width_m / 2
        extra_cost = _extra_cost(clearance, lateral_m)
        paths = find_shortest_paths(grid, free, extra_cost, _start_cell(grid, free, start.xy_m))
        below = _cells_below(grid, start, ego)
        return cls(
            grid=grid,
            ego=ego,
            start=start,
            free_space=free_space,
            tracer=tracer,
            direction_rad=travel_directions(paths, axis, start),
            axis_confidence=confidence,
            drivable=drivable,
            clearance_m=_distance_m(grid, below | (drivable & ((flags & TAKEN) == 0))),
            extra_cost=extra_cost,
            paths=paths,
            ego_lane=ego_lane,
            along_m=along_m,
            lateral_m=lateral_m,
            sides=TrafficSides.of(objects, ego_lane, left_hand_traffic),
            landmarks=landmarks,
            style=style,
        )

    @cached_property
    def _cars(self) -> dict[float, CarPaths]:
        return {}

    @cached_property
    def _later(self) -> dict[tuple[frozenset[str], bool], RoadMap]:
        return {}

    def cars_with(self, most_back_m: float = MOST_BACK_M) -> CarPaths:
        """Return the poses that the ego reaches as a car drives, with at most some metres backwards."""
        paths = CarPaths(self.grid, self.ego, self.start, self.clearance_m, self.extra_cost, most_back_m)
        return self._cars.setdefault(most_back_m, paths)

    def after_traffic(self, kept: Sequence[SceneObject] = (), places: bool = True) -> RoadMap | None:
        """Return the road map without the vehicles ahead that drive the way we do; None without any.

        They have driven on when we get there. What `kept` holds stays in the way; without `places` all stay where a
        goal may be.
        """
        leaving = [one for one in self.free_space.objects if one not in kept and self._drives_on(one)]
        if not leaving:
            return None
        key = frozenset(one.id for one in leaving), places
        if key not in self._later:  # several commands and candidates share its ways
            self._later[key] = self.without(leaving, places)
        return self._later[key]

    def without(self, leaving: Sequence[SceneObject], places: bool = True) -> RoadMap:
        """Return the road map without vehicles that leave; without `places` they stay where a goal may be."""
        under = ndimage.binary_dilation(cover_cells(self.grid, leaving), iterations=_EDGE_CELLS)
        later = self.free_space.without(leaving, under)
        free = self.drivable & ((later.cell_flags & TAKEN) == 0)
        clearance_m = _distance_m(self.grid, _cells_below(self.grid, self.start, self.ego) | free)
        extra_cost = _extra_cost(clearance_m, self.lateral_m)
        return replace(
            self,
            clearance_m=clearance_m,
            extra_cost=extra_cost,
            free_space=later if places else self.free_space,
        )

    def _drives_on(self, item: SceneObject) -> bool:
        """Return whether a vehicle ahead certainly drives the way we do, also away on a side road."""
        ahead = float((item.centre_m - self.start.xy_m) @ self.start.ahead) > 0
        drives = item.front_known and (item.speed_mps or 0.0) > DRIVING_MPS
        return ahead and drives and (self.heads_as_we_do(item) or self.heads_our_way(item))

    def heads_as_we_do(self, item: SceneObject) -> bool:
        """Return whether the heading of a vehicle is about that of the ego at the start."""
        return bool(np.cos(item.yaw_rad - self.start.heading_rad) > _PARALLEL)

    def heads_our_way(self, item: SceneObject) -> bool:
        """Return whether a vehicle heads in our direction of travel along the road where it is."""
        return bool(np.cos(item.yaw_rad - self.direction_at(item.centre_m)) > _PARALLEL)

    def heads_against_us(self, item: SceneObject) -> bool:
        """Return whether a vehicle heads against our direction of travel along the road where it is."""
        return bool(np.cos(item.yaw_rad - self.direction_at(item.centre_m)) < -_PARALLEL)

    def gap_ahead_m(self, item: SceneObject) -> float:
        """Return the gap along our lane up to a vehicle, bumper to bumper; negative beside and behind us."""
        along_m = float(self.ego_lane.project(item.centre_m)[0])
        return along_m - (item.length_m + self.ego.length_m) / 2

    @cached_property
    def line_behind(self) -> Centreline:
        """The line straight back from the ego; along-track distance counts backwards."""
        back = np.arange(0.0, self.grid.shape[0] * self.grid.cell_m)[:, None]
        return Centreline(self.start.xy_m - back * self.start.ahead, 0.0)

    @cached_property
    def junctions(self) -> BoolArray:
        """(X, Y) cells in junctions: those of the vector map, else those that the road shows."""
        if self.landmarks.knows("junction"):
            return self.landmarks.cells(self.grid, "junction")
        return find_junctions(self.grid, self.drivable, self.tracer.edge_m)

    @property
    def traffic_side(self) -> int:
        """1 for right-hand traffic, -1 for left-hand traffic."""
        return self.sides.side

    @cached_property
    def crossings(self) -> BoolArray:
        """(X, Y) cells in pedestrian crossings of the vector map."""
        return self.landmarks.cells(self.grid, "crossing")

    @cached_property
    def car_parks(self) -> BoolArray:
        """(X, Y) cells in car parks of the vector map."""
        return self.landmarks.cells(self.grid, "car park")

    @cached_property
    def junction_distance_m(self) -> FloatArray:
        """(X, Y) distance to the nearest cell in a junction; zero there."""
        return _distance_m(self.grid, ~self.junctions)

    def is_oncoming_side(self, cells: IntArray, heading_rad: FloatArray) -> BoolArray:
        """(N,) whether cells (N, 2) belong to oncoming traffic of headings (N,): beyond the middle of a wide road.

        The middle is a marking near half of the width, else that half; where vehicles drive our way or towards us,
        they show it. A junction has no sides, nor has a road whose near edge is far away.
        """
        turned = heading_rad + np.pi / 2
        left, right = (self.edge_distance_m(cells, angle, _MAX_ROAD_M) for angle in (turned, turned - np.pi))
        half, cell_m = (left - right) / 2, self.grid.cell_m
        marking = self.tracer.marking_m < cell_m / 2
        middle_m = cells_to_marking(marking, cells, turned, half / cell_m, _MARKED_M / cell_m) * cell_m
        near_side = right if self.traffic_side > 0 else left
        has_sides = (left + right > _ONE_LANE_M) & (near_side < _MAX_ROAD_M)
        by_road = has_sides & (self.traffic_side * middle_m < -_MIDDLE_M)
        theirs, ours, with_us = self._driven_by(cells, heading_rad)
        by_traffic = np.where(theirs, with_us, by_road & ~(ours & with_us))
        return np.asarray(by_traffic & ~self.junctions[tuple(cells.T)])

    def _driven_by(self, cells: IntArray, heading_rad: FloatArray) -> tuple[BoolArray, BoolArray, BoolArray]:
        """Whether cells (N, 2) are where traffic comes towards us, where it drives our way, and headings (N,) too."""
        along_m, lateral_m = (each[tuple(cells.T)] for each in (self.along_m, self.lateral_m))
        turn = np.cos(heading_rad - self.ego_lane.heading_rad(along_m))
        towards_m = self.traffic_side * lateral_m
        on_road = (np.abs(turn) > _PARALLEL) & (along_m < self.ego_lane.end_m)
        theirs = on_road & (towards_m > self.sides.oncoming_m) & (towards_m < _MAX_ROAD_M)
        return theirs, on_road & (towards_m > 0) & (towards_m < self.sides.ours_m), turn > 0

    def edge_distance_m(
        self, cells: IntArray, angle_rad: FloatArray, max_distance_m: float = _MAX_EDGE_M
    ) -> FloatArray:
        """Return distances (N,) from cells (N, 2) in directions (N,) to the road edge; vehicles are not edges."""
        angle = np.broadcast_to(np.asarray(angle_rad, np.float64), len(cells))
        return cells_to_edge(self.drivable, cells, angle, max_distance_m / self.grid.cell_m) * self.grid.cell_m

    def blend_headings(self, cells: IntArray, preferred_rad: FloatArray, weight: float = 0.5) -> FloatArray:
        """Return headings (N,) in cells (N, 2) between the road axis, by its confidence, and preferred ones (N,)."""
        i, j = cells.T
        axis, confidence = self.tracer.axis_rad[i, j], self.axis_confidence[i, j]
        both = confidence * np.exp(2j * axis) + weight * np.exp(2j * preferred_rad)
        return np.asarray(wrap_angle(preferred_rad + wrap_angle(np.angle(both) - 2 * preferred_rad) / 2))

    def half_road_offset_m(self, cells: IntArray, heading_rad: FloatArray) -> FloatArray:
        """Return offsets (N,) of cells (N, 2) from the middle of our half of the road at headings (N,)."""
        left, right = (
            self.edge_distance_m(cells, heading_rad + turn, max_distance_m=_MAX_HALF_M)
            for turn in (np.pi / 2, -np.pi / 2)
        )
        from_edge = np.where(left + right > _ONE_LANE_M, np.clip((left + right) / 4, 1.7, 4.0), (left + right) / 2)
        return (right if self.traffic_side > 0 else left) - from_edge

    def nearest_reachable(self, xy_m: FloatArray) -> tuple[int, int]:
        """Return the reachable cell nearest to a point (2,), or the cell of the point if none is reachable."""
        return self._nearest_of(self._reachable, xy_m)

    @cached_property
    def _reachable(self) -> IntArray:
        return np.stack(np.unravel_index(self.paths.cells, self.grid.shape), axis=-1)

    @cached_property
    def _drivable_cells(self) -> IntArray:
        return np.argwhere(self.drivable)

    def _nearest_of(self, cells: IntArray, xy_m: FloatArray) -> tuple[int, int]:
        at = np.clip(self.grid.cell_of(xy_m), 0, np.array(self.grid.shape) - 1)
        best = cells[np.argmin(((cells - at) ** 2).sum(axis=1))] if len(cells) else at
        return int(best[0]), int(best[1])

    def nearest_drivable(self, xy_m: FloatArray) -> tuple[int, int]:
        """Return the road cell nearest to a point (2,), or the cell of the point if there is no road."""
        return self._nearest_of(self._drivable_cells, xy_m)

    def direction_at(self, xy_m: FloatArray) -> float:
        """Return our direction of travel along the road axis at a point (2,), radians."""
        i, j = np.clip(self.grid.cell_of(xy_m), 0, np.array(self.grid.shape) - 1).tolist()
        axis_rad = float(self.tracer.axis_rad[i, j])
        along, lateral = self.ego_lane.project(xy_m)
        if self.ego_lane.start_m < along < self.ego_lane.end_m and abs(lateral) < _SAME_ROAD_M:
            # A path around an obstacle comes back to it from beyond, so the ego lane decides near itself.
            lane_rad = float(self.ego_lane.heading_rad(along))
            if abs(np.cos(axis_rad - lane_rad)) > _PARALLEL:
                return align_axis(axis_rad, lane_rad)
        return align_axis(axis_rad, self.direction_rad[self.nearest_reachable(xy_m)])


def align_axis(axis_rad: float, reference_rad: float) -> float:
    """Return the direction of an axis that is closer to a reference direction."""
    turned = float(wrap_angle(axis_rad))
    return turned if np.cos(turned - reference_rad) >= 0 else float(wrap_angle(turned + np.pi))


def _extra_cost(clearance_m: FloatArray, lateral_m: FloatArray) -> FloatArray:
    """Return the cost (X, Y) of a metre, beyond one: in narrow passages and outside the ego lane."""
    narrow = np.clip((_WIDE_M - clearance_m) / _WIDE_M, 0.0, 1.0)
    return np.asarray(_NARROW * narrow + _OFF_LANE * (np.abs(lateral_m) > _LANE_M / 2))


def _fill_holes(drivable: BoolArray, unknown: BoolArray, soft: bool) -> BoolArray:
    """Fill small holes in the road: those that nobody has seen, and on a predicted map the others too."""
    label, count = ndimage.label(~drivable)
    size = np.bincount(label.ravel(), minlength=count + 1)
    unseen = np.bincount(label.ravel(), unknown.ravel(), minlength=count + 1) == size
    most = np.where(unseen, _UNSEEN_CELLS, _HOLE_CELLS if soft else 0)
    return np.asarray(drivable | (size <= most)[label])


def _distance_m(grid: BEVGrid, mask: BoolArray) -> FloatArray:
    """Return the distance (X, Y) from each cell to the nearest one outside a mask or off the map."""
    far = cv2.distanceTransform(np.pad(mask.astype(np.uint8), 1), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return far[1:-1, 1:-1].astype(np.float64) * grid.cell_m


def _cells_below(grid: BEVGrid, start: Pose2D, ego: EgoVehicle) -> BoolArray:
    """Return the cells (X, Y) below the ego at a pose, and a margin around it."""
    offset = grid.centres() - start.xy_m
    along, across = offset @ start.ahead, offset @ [-start.ahead[1], start.ahead[0]]
    half = np.array([ego.length_m, ego.width_m]) / 2 + _START_MARGIN_M
    return np.asarray((np.abs(along) <= half[0]) & (np.abs(across) <= half[1]))


def _start_cell(grid: BEVGrid, free: BoolArray, ego_centre_m: FloatArray) -> tuple[int, int] | None:
    """Return the free cell nearest to the ego's centre, None if there is none nearby."""
    cells = np.argwhere(free)
    far = np.hypot(*(grid.centre_of(cells) - ego_centre_m).T)
    if not len(cells) or far.min() > _MAX_START_M:
        return None
    i, j = cells[np.argmin(far)].tolist()
    return i, j
