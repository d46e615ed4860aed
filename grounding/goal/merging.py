"""Moving in behind a vehicle that drives in the lane beside ours, once it is ahead of us."""

from __future__ import annotations

import numpy as np

from appocc.ego_vehicle import EgoVehicle
from appocc.motion_state import DRIVING_MPS
from grounding.goal import ego_lane
from grounding.goal.candidates import CandidateSet, DistanceRange
from grounding.query import Query
from grounding.road.lane_model import LANE_M
from grounding.road.road_map import RoadMap
from grounding.scene_object import SceneObject

# A shift to one side takes this much more of our lane than two arcs of the turning circle.
_SHIFT_ROOM = 1.3
# Actions that get us behind a vehicle, lateral offsets of the lanes beside ours, how far behind us it may come up.
_ACTIONS, _BESIDE_M, _COMES_UP_M = ("follow", "change_lane", "approach"), (LANE_M / 2, 2.5 * LANE_M), 25.0
# How much farther than the shift takes the place is at best, and at most.
_PREFERRED_M, _FURTHER_M = 2.0, 12.0


def shift_length_m(aside_m: float, ego: EgoVehicle) -> float:
    """Return how far we drive until we are to one side by some metres: two arcs of the turning circle, and some."""
    return float(_SHIFT_ROOM * 2 * np.sqrt(ego.turning_radius_m * abs(aside_m)))


def moves_in_behind(query: Query, item: SceneObject, road: RoadMap) -> bool:
    """Return whether a command is to get behind a vehicle that drives beside us, and is ahead of us in a moment."""
    behind = query.action == "follow" or query.relation == "behind"
    if not (behind and query.action in _ACTIONS and query.distance_m is None and item.front_known):
        return False
    aside_m = float(road.ego_lane.project(item.centre_m)[1])
    beside = _BESIDE_M[0] < abs(aside_m) < _BESIDE_M[1] and (item.speed_mps or 0.0) > DRIVING_MPS
    # The place at a follower's distance would be where we are already, or too near to change over to.
    gap_m = road.style.following_gap_m(item.speed_mps) if query.action == "change_lane" else 0.0
    most_m = shift_length_m(aside_m, road.ego) + max(_PREFERRED_M, gap_m)
    return beside and road.heads_our_way(item) and -_COMES_UP_M < road.gap_ahead_m(item) < most_m


def propose_merging(item: SceneObject, road: RoadMap) -> CandidateSet:
    """Propose candidates in the lane of a vehicle that drives beside us, behind where it is in a moment."""
    aside_m = float(road.ego_lane.project(item.centre_m)[1])
    shift_m = shift_length_m(aside_m, road.ego)
    behind_m = road.gap_ahead_m(item) - road.style.stop_gap_m
    most_m = shift_m + _FURTHER_M if behind_m < shift_m else min(behind_m, shift_m + _FURTHER_M)
    ahead = DistanceRange(shift_m, min(shift_m + _PREFERRED_M, most_m), most_m)
    return ego_lane.propose_in_lane_of(road, aside_m, ahead, "in its lane, behind it")
