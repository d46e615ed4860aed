"""Priors over referents: salience by position and visibility, and plausibility for the commanded action."""

from __future__ import annotations

import numpy as np

from appocc.checks import BoolArray, FloatArray
from grounding.query import Query, Referent
from grounding.referent.fuzzy import gaussian, rising
from grounding.referent.object_table import ObjectTable
from grounding.referent.ordinals import find_ordinals, is_plural
from grounding.referent.predicates import in_own_lane, is_ahead, is_facing_ego, is_standing
from grounding.vocabulary import PERSON_NOUNS

# Weight of an object behind the ego, also when objects are counted, and of one outside the forward field of view.
_BEHIND, _BEHIND_COUNTED, _OUT_OF_VIEW = 0.2, 0.15, 0.8
# Weight of an occluded object; in a queue on the ego path it is higher, and higher still when objects are counted.
_OCCLUDED, _OCCLUDED_IN_QUEUE, _OCCLUDED_COUNTED, _QUEUE_M = 0.2, 0.6, 0.85, 4.5
# Visible share at which an object starts to be noticed, and at which it is noticed for certain.
_LEAST_VISIBLE, _FULLY_NOTICED = 0.1, 0.7
# Buildings likely occlude objects behind this much off-road ground.
_BUILDING_OCCLUSION, _BUILDING_M = 0.6, 15.0
# Objects at a larger lateral offset belong to another street.
OTHER_STREET_M, _OTHER_STREET = 16.0, 0.4
# Salience falls beyond these distances along and across the lane, with these scales.
_NEAR_M, _NEAR_SCALE_M = 10.0, 45.0
_LATERAL_M, _LATERAL_SCALE_M = 6.0, 16.0
# Distance scale of an indefinite referent: of "any car" the nearest is preferred.
_INDEFINITE_SCALE_M = 15.0
# Least plausibility of an object for an action.
_LEAST_PLAUSIBILITY = 0.3
_YIELDING = ("give_way", "wait")
# The same where the motion of a vehicle all but decides, and plausibility of following a parked one.
_LEAST_PLAUSIBILITIES: dict[str | None, float] = {
    "follow": 0.05,
    "park": 0.15,
    "pull_over": 0.15,
    "wait": 0.15,
    "change_lane": 0.1,
}
_PARKED_FOLLOWED = 0.05
# The same of one that is to pass us.
_LEAST_PASSING = 0.05
# Relations to vehicles that stand in line with the place, and plausibility of one on the other side than the place.
_ALONG_SIDE, _OTHER_SIDE = ("behind", "in_front_of", "before", "past", "between"), 0.1
# How much less plausible a vehicle that faces us, across the road, is to stop at.
_ACROSS = 0.3
# Plausibility of stopping at "the car ahead" where that is none in our lane.
_NOT_LEADING = 0.15
# A vehicle that drives our way this far ahead does not pass us any more.
_AWAY_M = 8.0
# Those who are meant together are this near to each other; salience of one alone where several are meant.
GROUP_M, _ALONE = 6.0, 0.2
# Prediction times for crossing the ego path, and the speed of people who stand.
_PREDICTION_TIMES_S, _WALKING_MPS = (0.0, 2.0, 4.0), 1.2


def counting_prior(referent: Referent, table: ObjectTable) -> FloatArray:
    """Return the probability (N,) that each object is counted by ordinals.

    It is low behind the ego, when occluded, and in another street.
    """
    offset = np.abs(table.lateral_m)
    occluded = _OCCLUDED_COUNTED * _in_queue(table)
    result = occluded + (1 - occluded) * _noticed(table)
    if not {"leftmost", "rightmost", "farthest"} & {*referent.qualifiers}:
        result = result * (1 - (1 - _OTHER_STREET) * rising(offset, OTHER_STREET_M, 2.0))
    if not includes_behind(referent):
        result = result * np.where(is_behind(table), _BEHIND_COUNTED, 1.0)
    return result


def log_salience(query: Query, referent: Referent, table: ObjectTable) -> FloatArray:
    """Return the log salience (N,): visible objects near the ego, near its path and in front of it are preferred."""
    behind = includes_behind(referent) or query.manoeuvre == "back" or _awaits_passing(query)
    distance = np.abs(table.along_m) if behind else np.maximum(table.along_m, 0)
    in_queue = _OCCLUDED_IN_QUEUE * np.ones(len(table))
    if {"ahead", "own_lane"} & {*referent.qualifiers} or query.action in ("follow", "overtake"):
        # In a queue in the ego lane "the car ahead" is the first one.
        in_queue = in_queue * (1 - in_own_lane(table) / 2)
    occluded = _OCCLUDED + (in_queue - _OCCLUDED) * _in_queue(table)
    result = np.log(occluded + (1 - occluded) * _noticed(table))
    result = result - (np.maximum(np.abs(table.lateral_m) - _LATERAL_M, 0) / _LATERAL_SCALE_M) ** 2 / 2
    if not {"farthest", "last"} & set(referent.qualifiers):
        result = result - (np.maximum(distance - _NEAR_M, 0) / _NEAR_SCALE_M) ** 2 - distance / 200
    if not behind:
        # Counting down-weights objects behind the ego already.
        if not find_ordinals(referent.qualifiers):
            result = result + np.where(is_behind(table), np.log(_BEHIND), 0.0)
        x, y = table.xy_m.T
        in_view = rising(x + 2 - np.abs(y), 0.0, 1.5)
        result = result + np.log(_OUT_OF_VIEW + (1 - _OUT_OF_VIEW) * in_view)
    if referent.noun in PERSON_NOUNS and is_plural(referent.head):
        result = result + np.where(_stands_alone(table), np.log(_ALONE), 0.0)
    if not referent.definite:
        result = result - table.distance_m / _INDEFINITE_SCALE_M
    return result


def _stands_alone(table: ObjectTable) -> BoolArray:
    """Return whether objects (N,) have nobody of their kind beside them."""
    apart_m = np.linalg.norm(table.xy_m[:, None] - table.xy_m, axis=-1)
    others = (table.is_vehicle[:, None] == table.is_vehicle) & ~np.eye(len(table), dtype=np.bool_)
    return np.asarray(~((apart_m < GROUP_M) & others).any(axis=1))


def is_behind(table: ObjectTable) -> BoolArray:
    """Return whether objects (N,) are behind the ego."""
    return np.asarray(table.xy_m[:, 0] < table.ego.centre_m - 2.5)


def _noticed(table: ObjectTable) -> FloatArray:
    """Return the degree (N,) to which the driver notices objects, by their visible share.

    Objects behind much off-road ground are likely occluded by buildings, which no map shows.
    """
    past_buildings = 1 - _BUILDING_OCCLUSION * rising(table.off_road_sight_m, _BUILDING_M, 1.5)
    share = (table.visible_share - _LEAST_VISIBLE) / (_FULLY_NOTICED - _LEAST_VISIBLE)
    return np.asarray(share.clip(0, 1)) * past_buildings


def _in_queue(table: ObjectTable) -> FloatArray:
    """Return the degree (N,) to which objects are in a queue on the ego path or directly next to it."""
    return gaussian(np.maximum(np.abs(table.lateral_m) - _QUEUE_M, 0), 1.5)


def includes_behind(referent: Referent) -> bool:
    """Return whether the words of a referent allow a vehicle behind the ego."""
    return bool({"behind_ego", "passing"} & {*referent.qualifiers, *referent.qualifiers_optional})


def log_action_prior(query: Query, table: ObjectTable) -> FloatArray:
    """Return the log plausibility (N,) of objects for the commanded action; mild compared with the words."""
    standing = is_standing(table)
    fit = np.ones(len(table))
    if query.action == "follow":
        waiting = _PARKED_FOLLOWED + (0.8 - _PARKED_FOLLOWED) * in_own_lane(table)
        fit = (1 - standing + standing * waiting) * (1 - 0.8 * is_facing_ego(table))
        fit = fit * (0.4 + 0.6 * (table.along_m > 0))
        fit = fit * (0.6 + 0.4 * gaussian(table.lateral_m, 4.0))
    elif query.action == "overtake":
        fit = (0.15 + 0.85 * in_own_lane(table)) * is_ahead(table) * (1 - 0.8 * is_facing_ego(table))
    elif query.action == "approach" and query.relation == "toward":
        leads = in_own_lane(table) * (1 - standing) * (table.along_m > 0) * (1 - is_facing_ego(table))
        fit = 0.4 + 0.6 * leads
    elif query.action == "change_lane":
        fit = (1 - 0.8 * is_facing_ego(table)) * (1 - 0.7 * standing)
        if query.direction in ("left", "right"):  # who drives in that lane
            there = rising((1 if query.direction == "left" else -1) * table.lateral_m, 0.5, 0.3)
            fit = fit * (_OTHER_SIDE + (1 - _OTHER_SIDE) * there)
    elif _awaits_passing(query):
        # Who drives away ahead of us has passed, who drives behind us in our lane stays there, and who comes towards
        # us is in our way only where the road is narrow.
        stays = in_own_lane(table) * (table.along_m < 0)
        away = (table.along_m > _AWAY_M) * (1 - is_facing_ego(table)) * (np.cos(table.relative_heading_rad) > 0)
        fit = (1 - standing) * (1 - 0.7 * away) * (1 - 0.3 * is_facing_ego(table)) * (1 - 0.7 * stays)
    elif query.action in _YIELDING and query.trigger in ("clear", "turn") and _is_of_vehicles(query):
        fit = (1 - 0.85 * standing) * (0.4 + 0.6 * in_own_lane(table))
    elif query.action in _YIELDING and query.trigger not in ("leave", "stop"):
        # Pedestrians who get the right of way may wait at the kerb; vehicles move.
        fit = _crosses_ego_path(table) * (1 - 0.7 * standing * table.is_vehicle)
    elif query.action == "avoid" and query.distance_m is not None:  # whose distance we keep is ahead of us
        fit = _NOT_LEADING + (1 - _NOT_LEADING) * in_own_lane(table) * (table.along_m > 0)
    elif query.action in ("avoid", "slow_down"):
        fit = np.maximum(_crosses_ego_path(table), gaussian(table.lateral_m, 4.0)) * (table.along_m > 0)
    elif query.action in ("park", "pull_over"):
        fit = standing * (1 - _ACROSS * is_facing_ego(table))
    elif query.action == "stop" and query.relation not in ("none", "at", "toward"):
        leads = in_own_lane(table) * (table.along_m > 0)  # one that drives there is followed until it stands
        fit = (0.5 + 0.5 * np.maximum(standing, leads)) * (1 - _ACROSS * is_facing_ego(table))
        if query.referent is not None and "ahead" in query.referent.qualifiers:
            fit = fit * (_NOT_LEADING + (1 - _NOT_LEADING) * leads)
    if query.goal_side is not None and query.relation in _ALONG_SIDE:
        side = 1 if query.goal_side == "left" else -1
        fit = fit * (_OTHER_SIDE + (1 - _OTHER_SIDE) * rising(side * table.lateral_m, 0.5, 0.3))
    # Who awaits that a vehicle stops means one that moves.
    if query.trigger == "stop" or (query.trigger in ("pass", "turn", "merge") and query.action not in _YIELDING):
        fit = fit * (1 - 0.85 * standing)
    least = _LEAST_PLAUSIBILITIES.get(query.action, _LEAST_PLAUSIBILITY)
    least = _LEAST_PASSING if _awaits_passing(query) else least
    return np.asarray(np.log(least + (1 - least) * fit))


def _awaits_passing(query: Query) -> bool:
    """Return whether we wait for a vehicle that passes us."""
    return query.action in _YIELDING and query.trigger == "pass" and _is_of_vehicles(query)


def _is_of_vehicles(query: Query) -> bool:
    return query.referent is not None and query.referent.noun not in PERSON_NOUNS


def _crosses_ego_path(table: ObjectTable) -> FloatArray:
    """Return the degree (N,) to which objects cross the ego path within seconds; a lead vehicle does not."""
    speed = np.maximum(np.nan_to_num(table.speed_mps, nan=1.0), np.where(table.is_vehicle, 0.0, _WALKING_MPS))
    lateral = speed * np.sin(table.relative_heading_rad)
    nearest_m = np.min([np.abs(table.lateral_m + lateral * seconds) for seconds in _PREDICTION_TIMES_S], axis=0)
    leading = gaussian(table.lateral_m, 2.0) * np.cos(table.relative_heading_rad).clip(0) * (table.along_m > 0)
    across = 0.5 + 0.5 * np.abs(np.sin(table.relative_heading_rad))
    return np.asarray(across * (0.3 + 0.7 * gaussian(np.maximum(nearest_m - 3, 0), 3.0)) * (1 - 0.7 * leading))
