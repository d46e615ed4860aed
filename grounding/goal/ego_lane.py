"""Goal candidates without a reference vehicle: the ego lane, the next lane, the road edge and the present pose."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from appocc.checks import FloatArray, IntArray
from appocc.geometry import wrap_angle
from appocc.motion_state import DRIVING_MPS, MOVING_MPS
from grounding.goal.candidates import CandidateSet, DistanceRange
from grounding.road.free_space import TAKEN, round_heading
from grounding.road.kerb import kerb_gap_m
from grounding.road.lane_model import LANE_M
from grounding.road.road_map import RoadMap

# Decelerations to stop comfortably, and at most; distance of a place to stop at and of the last one, beyond that.
_COMFORT_MPS2, _HARD_MPS2, _STOP_MORE_M = 2.0, 5.0, 17.0
# Where the ego stops if its speed is unknown.
_STOP_M = DistanceRange(0.0, 8.0, 25.0)
# Greatest lateral offset in the ego lane, and standard deviation of its cost.
_IN_LANE_M, _LATERAL_M = 1.6, 0.6
# Tolerance of the next lane's offset; distance of a lane change and standard deviation of its cost.
_LANE_SLACK_M, CHANGE_M, _CHANGE_SPREAD_M = 1.2, DistanceRange(8.0, 15.0, 25.0), 6.0
# Least share of road in a lane, and share of parked vehicles from which on it is their row.
_LANE_SHARE, _PARKED_SHARE = 0.9, 0.25
# Least share of the cells beside us on the side of oncoming traffic, for a lane of it.
_ONCOMING_SHARE = 0.5
# Cost of candidates beyond an obstacle in the lane.
_BEYOND = 3.0
# Gap to the road edge: preferred, standard deviation of its cost, and how much greater it may be.
_EDGE_M, _EDGE_SPREAD_M, _MAX_EDGE_M = 0.3, 0.5, 1.2
# Where gaps at the kerb are counted, and the least stretch without a free place between two of them.
_GAPS_M, _GAP_BREAK_M = DistanceRange(0.0, 0.0, 60.0), 2.0
# Cost of a junction, where the confidence of the road axis is below the second value.
_JUNCTION, _CONFIDENT = 4.0, 0.75
# Costs of the edge of a crossing road, and of another road beyond the end of the ego lane.
_CROSSING_ROAD, _OTHER_ROAD = 6.0, 1.0


def is_standing(road: RoadMap) -> bool:
    """Return whether the ego certainly stands."""
    return road.speed_mps is not None and abs(road.speed_mps) < MOVING_MPS


def stopping_range(road: RoadMap) -> DistanceRange:
    """Return how far ahead the ego stops at its speed: braking hard, comfortably, and at the latest."""
    if road.speed_mps is None:
        return _STOP_M
    twice = max(road.speed_mps, 0.0) ** 2 / 2
    comfort_m = twice / _COMFORT_MPS2
    return DistanceRange(twice / _HARD_MPS2, comfort_m, comfort_m + _STOP_MORE_M)


def propose_in_lane(road: RoadMap, ahead: DistanceRange, words: str) -> list[CandidateSet]:
    """Propose candidates in the ego lane, some distance ahead."""
    return [_along_lane(road, 0.0, _IN_LANE_M, ahead, 4.0, words)]


def propose_in_lane_of(road: RoadMap, offset_m: float, ahead: DistanceRange, words: str) -> CandidateSet:
    """Propose candidates in the lane at a lateral offset from ours, some distance ahead."""
    return _along_lane(road, offset_m, _LANE_SLACK_M, ahead, 4.0, words)


def propose_next_lane(road: RoadMap, side: str | None) -> list[CandidateSet]:
    """Propose candidates in the lane to the left or right of the ego lane (None: either)."""
    sides = [(name, sign) for name, sign in (("left", 1.0), ("right", -1.0)) if side in (name, None)]
    found = []
    for name, sign in sides:
        words, offset_m = f"one lane to the {name}", _offset_of_lane(road, sign)
        lane = _along_lane(road, offset_m, _LANE_SLACK_M, CHANGE_M, _CHANGE_SPREAD_M, words)
        if is_oncoming_lane(road, name):  # a junction has no sides, the lane that leads there has
            lane = lane.subset(~road.junctions[tuple(lane.cells.T)])
        found.append(lane)
    return found


def is_oncoming_lane(road: RoadMap, side: str) -> bool:
    """Return whether the next lane on one side is that of oncoming traffic, beside us and outside junctions."""
    offset_m = _offset_of_lane(road, 1.0 if side == "left" else -1.0)
    beside = (np.abs(road.along_m) < CHANGE_M.least_m) & (np.abs(road.lateral_m - offset_m) < road.grid.cell_m)
    cells = np.argwhere(beside & road.drivable & ~road.junctions)
    headings = road.ego_lane.heading_rad(road.along_m[tuple(cells.T)])
    return len(cells) > 0 and bool(road.is_oncoming_side(cells, headings).mean() > _ONCOMING_SHARE)


def _offset_of_lane(road: RoadMap, sign: float) -> float:
    """Return the lateral offset of the next lane on one side: where vehicles drive in it, else one lane's width."""
    offsets_m = [sign * LANE_M]
    for item in road.free_space.objects:
        along_m, lateral_m = (float(each) for each in road.ego_lane.project(item.centre_m))
        near = abs(along_m) < CHANGE_M.most_m and abs(lateral_m - sign * LANE_M) < _LANE_SLACK_M
        if road.heads_as_we_do(item) and near and (item.speed_mps or 0.0) > DRIVING_MPS:
            offsets_m.append(lateral_m)
    return float(np.median(offsets_m[1:] or offsets_m))


def has_kerb_lane(road: RoadMap) -> bool:
    """Return whether there is a lane between ours and the kerb on our side, and no row of parked vehicles."""
    offset_m = -road.traffic_side * LANE_M
    there = (road.along_m >= CHANGE_M.least_m) & (road.along_m <= CHANGE_M.most_m)
    there &= np.abs(road.lateral_m - offset_m) <= road.ego.width_m / 2
    taken = (road.free_space.cell_flags & TAKEN) > 0
    is_lane = there.any() and road.drivable[there].mean() > _LANE_SHARE
    return bool(is_lane and taken[there].mean() < _PARKED_SHARE)


def _along_lane(
    road: RoadMap, offset_m: float, slack_m: float, ahead: DistanceRange, spread_m: float, words: str
) -> CandidateSet:
    """Return candidates at a lateral offset from the ego lane, some distance ahead."""
    along, lateral = road.along_m, road.lateral_m
    last_m = min(ahead.most_m, road.ego_lane.end_m)
    preferred_m = min(ahead.preferred_m, _behind_queue_m(road, offset_m))
    least_m = min(ahead.least_m, preferred_m)
    region = (along >= least_m) & (along <= last_m) & (np.abs(lateral - offset_m) <= slack_m)
    cells = np.argwhere(region)
    cost = ((along[region] - preferred_m) / spread_m) ** 2 + ((lateral[region] - offset_m) / _LATERAL_M) ** 2
    # The ego stays behind obstacles in the lane; traffic ahead drives on.
    in_lane = (along > 0) & (np.abs(lateral - offset_m) < road.ego.width_m / 2)
    stays = road.after_traffic() or road
    blocked = in_lane & ((stays.free_space.cell_flags & TAKEN) > 0)
    cost += _BEYOND * (along[region] > np.min(along[blocked], initial=np.inf))
    heading = road.blend_headings(cells, road.ego_lane.heading_rad(along[region]))
    return CandidateSet(words, cells, cost, heading, along[region], "ahead")


def _behind_queue_m(road: RoadMap, offset_m: float) -> float:
    """Return the place behind the first vehicle that creeps along a lane ahead of us; infinite without one."""
    places_m = [np.inf]
    for item in road.free_space.objects:
        along_m, lateral_m = (float(each) for each in road.ego_lane.project(item.centre_m))
        creeps = MOVING_MPS < (item.speed_mps or 0.0) <= DRIVING_MPS
        if creeps and along_m > item.length_m and abs(lateral_m - offset_m) < LANE_M / 2:
            places_m.append(road.gap_ahead_m(item) - road.style.stop_gap_m)
    return max(min(places_m), 0.0)


def propose_on_any_road(road: RoadMap, ahead: DistanceRange, words: str) -> list[CandidateSet]:
    """Propose candidates at a path length on any road, where the ego lane ends; less turning is better."""
    length = road.paths.length_m
    region = (length >= ahead.least_m) & (length <= ahead.most_m)
    cells, heading = np.argwhere(region), road.direction_rad[region]
    bearing = np.arctan2(*(road.grid.centre_of(cells) - road.ego_lane.origin_m).T[::-1])
    turned, aside = heading - road.start.heading_rad, bearing - road.start.heading_rad
    cost = ((length[region] - ahead.preferred_m) / 4.0) ** 2 + 2.0 * (2 - np.cos(turned) - np.cos(aside))
    cost += junction_cost(road, cells) + (road.half_road_offset_m(cells, heading) / 1.5) ** 2
    return [CandidateSet(words, cells, cost + _OTHER_ROAD, heading)]


def propose_at_edge(road: RoadMap, side: str, ahead: DistanceRange, gap_m: float = _EDGE_M) -> list[CandidateSet]:
    """Propose candidates at the road edge on one side, some distance ahead and best at a gap to the edge."""
    sign = 1 if side == "left" else -1
    along, lateral = road.along_m, road.lateral_m
    last_m = min(ahead.most_m, road.ego_lane.end_m)
    region = road.drivable & (along >= ahead.least_m) & (along <= last_m) & (sign * lateral >= -1.0)
    region &= np.abs(lateral) <= 16.0
    cells = np.argwhere(region)
    lane_rad = road.ego_lane.heading_rad(along[region])
    heading = road.blend_headings(cells, lane_rad, weight=0.05)
    side_m = kerb_gap_m(road, cells, heading, sign, 3.0 + gap_m)
    off_m = along[region] - ahead.preferred_m
    cost = np.minimum(((side_m - gap_m) / _EDGE_SPREAD_M) ** 2, 16.0)
    cost += np.where(off_m < 0, off_m / 3.0, off_m / 12.0) ** 2
    cost += junction_cost(road, cells) + _CROSSING_ROAD * np.sin(heading - lane_rad) ** 2
    words = f"at the {side} edge of the road"
    found = CandidateSet(words, cells, cost, heading, along[region], "ahead")
    return [found.subset(side_m - gap_m < _MAX_EDGE_M)]


def propose_in_gap(road: RoadMap, side: str, number: int) -> tuple[list[CandidateSet] | None, list[str]]:
    """Propose candidates in the n-th free stretch of the road edge on one side, counted from where we are."""
    free, numbers = _number_gaps(road, side)
    most = int(numbers.max(initial=0))
    if number > most:
        return None, [f"the map shows {most or 'no'} gap{'s' * (most != 1)} ahead at the {side} edge of the road"]
    gap = free.subset(numbers == number)
    words = f"in gap {number} of {most} at the {side} edge of the road"
    return [replace(gap, words=words, cost=gap.cost - gap.cost.min())], []


def gap_number(road: RoadMap, side: str, cell: tuple[int, int]) -> int:
    """Return which free stretch of the road edge, as `propose_in_gap` counts them, a place is in or just beyond."""
    free, numbers = _number_gaps(road, side)
    before = road.along_m[tuple(free.cells.T)] <= road.along_m[cell]
    return int(numbers[before].max(initial=0))


def _number_gaps(road: RoadMap, side: str) -> tuple[CandidateSet, IntArray]:
    """Return the free candidates (N,) at the road edge on one side, and the number (N,) of their stretch, from 1."""
    (found,) = propose_at_edge(road, side, _GAPS_M)
    free = found.subset(road.free_space.flags(found.cells, round_heading(found.heading_rad)) == 0)
    along_m = road.along_m[tuple(free.cells.T)]
    starts = np.sort(along_m)
    starts = starts[np.diff(starts, prepend=-np.inf) > _GAP_BREAK_M]
    return free, np.searchsorted(starts, along_m, side="right")


def propose_back(road: RoadMap, distance_m: float) -> list[CandidateSet]:
    """Propose candidates straight behind us, to which the ego drives backwards."""
    off = 1 + distance_m / 10
    return [_along_lane(road, 0.0, _IN_LANE_M, DistanceRange(-distance_m - off, -distance_m, -0.4), 1.0, "behind us")]


def propose_here(road: RoadMap) -> list[CandidateSet]:
    """Propose candidates at or near the present pose."""
    cells = road.grid.cell_of(road.start.xy_m) + np.argwhere(np.ones((21, 21))) - 10
    cells = cells[road.grid.contains(cells)]
    distance_m = np.linalg.norm(road.grid.centre_of(cells) - road.start.xy_m, axis=1)
    heading = np.full(len(cells), road.start.heading_rad)
    return [CandidateSet("where we are", cells, (distance_m / 1.0) ** 2, heading)]


def propose_turned_around(road: RoadMap, ahead_m: float) -> list[CandidateSet]:
    """Propose candidates in the opposite lane, heading back, best at a distance ahead."""
    along, lateral = road.along_m, road.lateral_m
    start = road.grid.cell_of(road.ego_lane.origin_m)[None]
    start = np.clip(start, 0, np.array(road.grid.shape) - 1)
    left_m, right_m = (float(road.edge_distance_m(start, np.array([turn]))[0]) for turn in (np.pi / 2, -np.pi / 2))
    # The opposite lane is where vehicles come towards us, else it mirrors the ego lane at the middle of the road.
    across_m = max(road.traffic_side * (left_m - right_m), LANE_M)
    offset_m = road.traffic_side * min(across_m, road.sides.oncoming_m + road.ego.width_m / 2)
    region = (along >= ahead_m - 11.0) & (along <= min(ahead_m + 22.0, road.ego_lane.end_m))
    region &= np.abs(lateral - offset_m) <= 2.5
    cells = np.argwhere(region)
    cost = ((along[region] - ahead_m) / 6.0) ** 2 + ((lateral[region] - offset_m) / 0.8) ** 2
    ahead_rad = road.blend_headings(cells, road.ego_lane.heading_rad(along[region]))
    heading = wrap_angle(ahead_rad + np.pi)
    return [CandidateSet("in the opposite lane, turned around", cells, cost, heading, along[region], "ahead")]


def junction_cost(road: RoadMap, cells: IntArray) -> FloatArray:
    """Return the cost (N,) of cells (N, 2) in a junction."""
    missing = np.maximum(_CONFIDENT - road.axis_confidence[tuple(cells.T)], 0.0)
    return np.asarray(_JUNCTION * missing / _CONFIDENT)
