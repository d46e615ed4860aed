"""How the vehicle of a command drives: on ahead of us, away from a place beside it, or towards us."""

from __future__ import annotations

import re

import numpy as np

from appocc.motion_state import DRIVING_MPS, MOVING_MPS
from grounding.goal.limits import PARKING_ACTIONS
from grounding.query import Query
from grounding.road.car_paths import CarRoute
from grounding.road.lane_model import LANE_M
from grounding.road.road_map import RoadMap
from grounding.scene_object import SceneObject

# Words of a gap that is too small.
_MORE_DISTANCE = re.compile(
    r"\b(?:more|greater|bigger) (?:\w+ )?(?:distance|space|room|gap)\b"
    r"|\b(?:further|farther) back\b|\b(?:drop|hold|fall) back\b"
)
# Relations of a place on the way to a vehicle.
TOWARDS = ("none", "toward", "near", "at")


def drives_away(query: Query, item: SceneObject) -> bool:
    """Return whether a place to stand is asked for beside a vehicle that drives on."""
    stands = query.action in ("park", "pull_over", "stop") and query.relation != "same_as"
    # Who parks stays longer than one that creeps in a queue.
    most_mps = MOVING_MPS if query.action in PARKING_ACTIONS else DRIVING_MPS
    said = item.speed_mps is None and query.referent is not None and "moving" in query.referent.qualifiers
    return stands and query.trigger is None and (said or (item.speed_mps or 0.0) > most_mps)


def is_followed(query: Query, item: SceneObject, road: RoadMap) -> bool:
    """Return whether to stop at a vehicle is to follow it, since it drives on ahead of us."""
    stops = query.action == "stop" and query.relation in ("none", "behind")
    return stops and drives_away(query, item) and _drives_before_us(item, road)


def keeps_distance(query: Query, item: SceneObject, road: RoadMap) -> bool:
    """Return whether to avoid a vehicle is to follow it at a distance, since it drives on ahead of us."""
    avoids = query.action == "avoid" and query.relation == "none"
    return avoids and (item.speed_mps or 0.0) > DRIVING_MPS and _drives_before_us(item, road)


def asks_for_more_distance(query: Query) -> bool:
    """Return whether the gap to a vehicle is to be no smaller than now: "keep a bit more distance"."""
    return _MORE_DISTANCE.search(query.command.lower()) is not None


def is_caught_up_with(query: Query, item: SceneObject, road: RoadMap) -> bool:
    """Return whether to approach a vehicle is to get behind it, since it drives on ahead of us."""
    towards = query.action == "approach" and query.relation in TOWARDS
    return towards and (item.speed_mps or 0.0) > DRIVING_MPS and _drives_before_us(item, road)


def how_it_moves(item: SceneObject) -> str:
    """Return how a vehicle drives, in words."""
    return "moves" if item.speed_mps is None else f"drives at {item.speed_mps:.0f} m/s"


def _drives_before_us(item: SceneObject, road: RoadMap) -> bool:
    """Return whether a vehicle drives ahead of us in our direction, in our lane or the next."""
    along, lateral = (float(each) for each in road.ego_lane.project(item.centre_m))
    return item.front_known and road.heads_our_way(item) and along > 0 and abs(lateral) < 1.5 * LANE_M


def goes_around_traffic(way: CarRoute, road: RoadMap) -> bool:
    """Return whether a way ends beyond a vehicle that drives ahead of us in our lane."""
    end_m = float(road.ego_lane.project(way.points_m[-1])[0])
    for item in road.free_space.objects:
        along_m, lateral_m = (float(each) for each in road.ego_lane.project(item.centre_m))
        leads = (item.speed_mps or 0.0) > DRIVING_MPS and _drives_before_us(item, road)
        if leads and abs(lateral_m) < LANE_M / 2 and along_m < end_m:
            return True
    return False


def meets_oncoming(way: CarRoute, road: RoadMap) -> bool:
    """Return whether a way leads over where vehicles come towards us."""
    towards_m = road.traffic_side * road.ego_lane.project(way.points_m)[1]
    return bool(towards_m.max(initial=-np.inf) + road.ego.width_m / 2 > road.sides.oncoming_m)


def comes_towards_us(item: SceneObject, road: RoadMap) -> bool:
    """Return whether a vehicle drives against our direction, and has not passed us."""
    ahead = float(road.ego_lane.project(item.centre_m)[0]) > -item.length_m
    drives = item.front_known and (item.speed_mps or 0.0) > DRIVING_MPS
    return drives and ahead and road.heads_against_us(item)
