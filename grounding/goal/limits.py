"""Hard limits on goals: where a driver would not go unless the command asks for it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from appocc.checks import BoolArray, FloatArray, IntArray
from appocc.geometry import wrap_angle
from appocc.motion_state import DRIVING_MPS, MOVING_MPS
from grounding.query import Query
from grounding.road.car_paths import MOST_BACK_M
from grounding.road.free_space import gap_m
from grounding.road.kerb import kerb_gap_m
from grounding.road.road_map import RoadMap
from grounding.vocabulary import LANDMARK_KINDS

# Flags in addition to those of the free space and of the search.
OTHER_SIDE, JUNCTION, BEHIND_US, TURNED = 64, 128, 256, 512
# Actions that leave the ego standing, and those of them that leave it alone.
WAITING_ACTIONS, PARKING_ACTIONS = ("park", "pull_over", "wait"), ("park", "pull_over")
# Actions that only go forward, and how much more reversing costs there.
_FORWARD_ACTIONS, _ONLY_FORWARD = ("follow", "change_lane", "overtake"), 6.0
# A goal farther behind us is one that nobody expects.
_BEHIND_M = 8.0
# A goal nearer than this that heads farther away than this angle turns us on the spot.
_NEAR_M, _TURNED_RAD = 13.0, np.radians(95)
# Costs of standing this near to a vehicle that drives, of stopping in a junction, and of heading against the traffic
# beside a vehicle on the other side.
_TRAFFIC_M, _NEAR_TRAFFIC, _IN_JUNCTION, AGAINST_TRAFFIC = 2.0, 1.0, 2.0, 2.5
# Metres backwards beyond those that the command asks for.
_BACK_MORE_M = 5.0
# Costs of a metre backwards that the command does not ask for and of changing gear for it, beyond a little, and least
# cosine of headings with which a place behind us is reached backwards.
_BACKWARDS, _GEAR, _LITTLE_BACK_M, _SAME_WAY = 0.25, 0.3, 0.3, 0.7
# A parked vehicle keeps this clear of a junction.
_CLEAR_M = 2.0
# A parked ego farther than this from the edge of the road stands in the way of others.
_AT_EDGE_M, _SIDE_M = 1.6, 6.0
# A place this near to us is where we are.
_HERE_M = 1.0
# Places on the footprint that are tested, as shares of its length and width.
_FOOTPRINT = np.stack(np.meshgrid(np.linspace(-0.5, 0.5, 7), np.linspace(-0.5, 0.5, 3)), axis=-1).reshape(-1, 2)


@dataclass(frozen=True)
class PlaceLimits:
    """What a command does not ask for, and so a goal must not be.

    Attributes:
        our_side: whether the goal must be on our side of the road.
        clear_of_junctions: whether it must be outside junctions.
        clear_m: how far outside.
        not_behind: whether it must not be far behind us, nor turn us on the spot.
        most_back_m: greatest distance backwards on the way.
        only_forward: whether nobody drives backwards for it: to follow, to overtake, to change lanes.
    """

    our_side: bool = True
    clear_of_junctions: bool = False
    clear_m: float = 0.0
    not_behind: bool = True
    most_back_m: float = MOST_BACK_M
    only_forward: bool = False

    @classmethod
    def of(cls, query: Query, traffic_side: int) -> PlaceLimits:
        """Return the limits of a command, where traffic drives on the right (1) or left (-1)."""
        oncoming = "left" if traffic_side > 0 else "right"
        asks_side = query.goal_side == oncoming or query.relation in ("opposite", f"{oncoming}_of")
        turns_round = query.direction == "around"
        referent, backs = query.referent, query.manoeuvre == "back"
        asks_back = turns_round or backs or (referent is not None and "behind_ego" in referent.qualifiers)
        named = {LANDMARK_KINDS.get(part.noun) for part in query.secondary}
        # Who names a vehicle at a junction asks for a place there.
        names_junction = query.referent is not None and bool(named & {"junction", "crossing", "traffic light"})
        return cls(
            our_side=not (asks_side or turns_round or "car park" in named),
            clear_of_junctions=query.action in WAITING_ACTIONS and not names_junction,
            clear_m=_CLEAR_M if query.action in PARKING_ACTIONS else 0.0,
            not_behind=not asks_back,
            most_back_m=max(MOST_BACK_M, (query.distance_m or 0.0) + _BACK_MORE_M) if backs else MOST_BACK_M,
            only_forward=query.action in _FORWARD_ACTIONS,
        )

    def flags(self, road: RoadMap, cells: IntArray, heading_rad: FloatArray) -> IntArray:
        """Return the violations (N,) of poses: cells (N, 2) and headings (N,)."""
        found = np.zeros(len(cells), np.int64)
        if self.our_side:
            found |= OTHER_SIDE * road.is_oncoming_side(cells, heading_rad)
        if self.clear_of_junctions:
            near = road.junction_distance_m[tuple(cells.T)] <= self.clear_m
            moved_m = np.hypot(*(road.grid.centre_of(cells) - road.start.xy_m).T)
            stands = abs(road.speed_mps or 0.0) < MOVING_MPS
            here = (moved_m < _HERE_M) & stands  # who stands there may wait there
            found |= JUNCTION * ((near | _touches(road.crossings, road, cells, heading_rad)) & ~here)
        if self.not_behind:
            offset = road.grid.centre_of(cells) - road.start.xy_m
            found |= BEHIND_US * (offset @ road.start.ahead < -_BEHIND_M)
            turned = np.abs(wrap_angle(heading_rad - road.start.heading_rad)) > _TURNED_RAD
            found |= TURNED * (turned & (np.hypot(*offset.T) < _NEAR_M))
        return found


def _touches(area: BoolArray, road: RoadMap, cells: IntArray, heading_rad: FloatArray) -> BoolArray:
    """Return whether the footprint at poses, cells (N, 2) and headings (N,), touches an area (X, Y)."""
    if not area.any():
        return np.zeros(len(cells), np.bool_)
    along, across = (_FOOTPRINT * [road.ego.length_m, road.ego.width_m] / road.grid.cell_m).T
    cos, sin = np.cos(heading_rad)[:, None], np.sin(heading_rad)[:, None]
    points = np.stack([along * cos - across * sin, along * sin + across * cos], axis=-1) + cells[:, None]
    i, j = np.clip(np.rint(points).astype(np.int64), 0, np.array(area.shape) - 1).transpose(2, 0, 1)
    return np.asarray(area[i, j].any(axis=1))


def standing_cost(query: Query, road: RoadMap, cells: IntArray, heading_rad: FloatArray) -> FloatArray | float:
    """Return the cost (N,) of standing in a junction or close to traffic, if the ego stands in the end."""
    if query.action not in (*WAITING_ACTIONS, "stop"):
        return 0.0
    cost = np.where((road.junctions | road.crossings)[tuple(cells.T)], _IN_JUNCTION, 0.0)
    for item in road.free_space.objects:
        if (item.speed_mps or 0.0) > DRIVING_MPS:
            gap = gap_m(item, road.ego, road.grid.centre_of(cells), heading_rad)
            cost = np.maximum(cost, _NEAR_TRAFFIC * (gap < _TRAFFIC_M))
    return cost


def reversing_cost(
    limits: PlaceLimits, road: RoadMap, cells: IntArray, heading_rad: FloatArray
) -> FloatArray | float:
    """Return the cost (N,) of driving backwards to poses, unless the command asks for what is behind us."""
    if not limits.not_behind:
        return 0.0
    back_m = road.cars_with().backwards_to(cells, heading_rad)
    offset = road.grid.centre_of(cells) - road.start.xy_m
    same_way = np.cos(heading_rad - road.start.heading_rad) > _SAME_WAY
    back_m = np.maximum(np.where(np.isfinite(back_m), back_m, 0.0), same_way * -(offset @ road.start.ahead))
    times = _ONLY_FORWARD if limits.only_forward else 1.0
    return np.where(back_m > _LITTLE_BACK_M, times * (_GEAR + _BACKWARDS * back_m), 0.0)


NO_LIMITS = PlaceLimits(our_side=False, not_behind=False)


def stands_at_edge(road: RoadMap, cell: tuple[int, int], heading_rad: float) -> bool:
    """Return whether the ego stands at an edge of the road in a cell, out of the way of others."""
    at, heading = np.array([cell]), np.array([heading_rad])
    return any(float(kerb_gap_m(road, at, heading, side, _SIDE_M)[0]) <= _AT_EDGE_M for side in (1, -1))


def is_in_the_road(cell: tuple[int, int], heading_rad: float, road: RoadMap) -> bool:
    """Return whether others have to drive around who parks in a cell: it is neither at an edge nor in a car park."""
    return not road.car_parks[cell] and not stands_at_edge(road, cell, heading_rad)
