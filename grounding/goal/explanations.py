"""Explanations of a place in words: where it is, what stood against better ones, and the way there."""

from __future__ import annotations

import numpy as np

from appocc.checks import FloatArray
from appocc.ego_vehicle import EgoVehicle
from appocc.motion_state import MOVING_MPS
from grounding.goal.candidates import GoalCandidate
from grounding.goal.limits import PARKING_ACTIONS, is_in_the_road
from grounding.goal.search import LEAVES_ROAD, CandidateSearch
from grounding.query import Query
from grounding.road.car_paths import CarRoute
from grounding.road.road_map import RoadMap
from grounding.scene_object import SceneObject

# A goal closer than this to the ideal candidate is not reported as moved.
_MOVED_M = 0.6
# A goal within this lateral offset of the ego lane is reported as behind the ego, if it is.
_IN_LANE_M = 1.5
# A gap that differs by more from the one asked for is told.
_TOLD_GAP_M = 0.35
# How the reasons begin that warn of a step, and are told with any later one.
WARNINGS = ("that takes hard braking", "it is too near for us")
# A stop that takes a greater deceleration is told.
_HARD_MPS2 = 3.5
# A way that turns by more is a turn in the road; reversing less than this is not worth a word.
_TURN_ROUND_RAD, _LITTLE_M = np.radians(150), 0.5


def explain_target(search: CandidateSearch, chosen: GoalCandidate) -> list[str]:
    """Return where the chosen candidate is, and the constraints that ruled out better ones."""
    road = search.road
    reasons = [f"the place is {chosen.describe()}"]
    ideal = search.unconstrained_best(chosen.candidates)
    if ideal is not None:
        moved = float(np.linalg.norm(np.subtract(ideal.cell, chosen.cell)) * road.grid.cell_m)
        if moved > _MOVED_M:
            reasons.append(f"moved {moved:.1f} m from the best place, which {search.explain_violation(ideal)}")
    # Sets with the same words differ only in their headings.
    other_sets = [each for each in search.candidate_sets if each.words != chosen.candidates.words]
    others = [other for each in other_sets if (other := search.unconstrained_best(each))]
    better = min(others, key=lambda other: other.cost, default=chosen)
    violation = search.explain_violation(better) if better.cost < chosen.cost - 1e-9 else LEAVES_ROAD
    if violation != LEAVES_ROAD:  # the kerb side of a vehicle at the kerb is no place that anybody thinks of
        reasons.append(f"{better.candidates.words} would be better, but the best place there {violation}")
    return [*reasons, *explain_behind_us(chosen.cell, road)]


def explain_behind_us(cell: tuple[int, int], road: RoadMap) -> list[str]:
    """Return how far a place in our lane is behind us; empty for other places."""
    along_m, lateral_m = float(road.along_m[cell]), float(road.lateral_m[cell])
    behind = along_m < -_MOVED_M and abs(lateral_m) < _IN_LANE_M
    return [f"that is {-along_m:.1f} m behind where we are now"] if behind else []


def explain_gap(query: Query, chosen: GoalCandidate) -> list[str]:
    """Return how far the gap is from the one that is asked for."""
    gaps = chosen.candidates.gap_m
    measured = query.referent is not None and query.distance_of == "referent"  # gaps at a landmark are ahead of us
    if query.distance_m is None or not measured or gaps is None:
        return []
    more_m = float(gaps[chosen.index]) - query.distance_m
    if abs(more_m) < _TOLD_GAP_M:
        return []
    return [f"that is {abs(more_m):.1f} m {'more' if more_m > 0 else 'less'} than asked for"]


def explain_second_row(query: Query, cell: tuple[int, int], heading_rad: float, road: RoadMap) -> list[str]:
    """Return the warning for a parking place that is not at the edge of the road."""
    if query.action not in PARKING_ACTIONS or not is_in_the_road(cell, heading_rad, road):
        return []
    return ["it is not at the edge of the road: others have to drive around us"]


def explain_way(way: CarRoute) -> str:
    """Return length and reversing of a way in words."""
    words = f"the way there is {way.length_m:.0f} m"
    if way.turned_rad > _TURN_ROUND_RAD:
        words += ", with a turn in the road"
    return f"{words}, {way.backwards_m:.0f} m of it backwards" if way.backwards_m > _LITTLE_M else words


def explain_braking(query: Query, way: CarRoute, road: RoadMap) -> list[str]:
    """Return that a place to stop takes hard braking at our speed; empty where it does not."""
    stops = query.action in (*PARKING_ACTIONS, "stop", "give_way", "approach")
    speed = max(road.speed_mps or 0.0, 0.0)
    hard = speed**2 / 2 > _HARD_MPS2 * max(way.length_m, _LITTLE_M)
    return [f"that takes hard braking: we drive at {speed:.0f} m/s"] if stops and hard and way.backwards_m < 1 else []


def explain_speed(query: Query, item: SceneObject | None, road: RoadMap) -> list[str]:
    """Return that a vehicle to overtake is no slower than we are; empty where it is, or a speed is unknown."""
    theirs, ours = None if item is None else item.speed_mps, road.speed_mps
    if query.action != "overtake" or theirs is None or ours is None or theirs < max(ours, MOVING_MPS):
        return []
    return [f"it drives at {theirs:.0f} m/s, we at {max(ours, 0.0):.0f}: to pass it we have to be faster"]


def gap_beyond_m(place_m: FloatArray, heading_rad: float, ego: EgoVehicle, item: SceneObject) -> float:
    """Return the gap along a heading between us at a place (2,) and a vehicle; negative: we are short of it.

    Zero where we are beside it.
    """
    offset_m = float((place_m - item.centre_m) @ [np.cos(heading_rad), np.sin(heading_rad)])
    gap_m = max(abs(offset_m) - (item.length_m + ego.length_m) / 2, 0.0)
    return float(np.copysign(gap_m, offset_m))


def explain_from(
    place_m: FloatArray, heading_rad: float, ego: EgoVehicle, item: SceneObject, name: str = "it"
) -> str:
    """Return where a place (2,) is, measured from a vehicle, which has a name in the sentence."""
    if gap_m := gap_beyond_m(place_m, heading_rad, ego, item):
        return f"the place is {abs(gap_m):.1f} m {'beyond' if gap_m > 0 else 'short of'} {name}"
    left_m = float((place_m - item.centre_m) @ [-np.sin(heading_rad), np.cos(heading_rad)])
    gap_m = max(abs(left_m) - (item.width_m + ego.width_m) / 2, 0.0)
    return f"the place is {'left' if left_m > 0 else 'right'} of {name}, {gap_m:.1f} m away from it"
