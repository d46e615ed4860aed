"""Fuzzy predicates: membership 0..1 of every object in each word of a referent; 0.5 where a value is unknown."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from appocc.checks import FloatArray
from appocc.colours import fit
from grounding.query import Exclusion, Landmark, Referent
from grounding.referent.class_fit import fit_noun
from grounding.referent.fuzzy import UNKNOWN, falling, fill_unknown, gaussian, rising
from grounding.referent.object_table import ObjectTable
from grounding.referent.scene import NEUTRAL_LIGHT, SceneModel
from grounding.road.lane_model import LANE_M
from grounding.vocabulary import COLOURS

# Share of vehicles that people call by each colour: the fit of a vehicle of unknown colour.
_COLOUR_FREQUENCY = {"white": 0.35, "black": 0.3, "grey": 0.3, "silver": 0.3, "dark": 0.4, "light": 0.4}
_RARE_COLOUR_FREQUENCY = 0.045
# From above a motorcycle shows its rider's colour more than its own. Shorter objects count as ridden.
_LEAST_RIDDEN_FIT, _RIDDEN_LENGTH_M = 0.25, 2.6
# Vehicles of a class are large above these lengths, and small below those.
_LARGE_M = {"car": 4.75, "van": 5.6, "truck": 6.5, "bus": 11.5, "motorcycle": 2.2}
_SMALL_M = {"car": 4.25, "van": 5.0, "truck": 5.9, "bus": 8.0, "motorcycle": 2.0}
# Vehicles of a row are this much in line; midpoint and scale of the gap between them.
_ROW_SIGMA_M, _ROW_GAP_M = 1.2, (12.0, 2.0)
# A vehicle within these drives straight.
_STRAIGHT_YAW_RATE_RADPS, _STRAIGHT_SLANT_RAD = 0.12, 0.2


def is_standing(table: ObjectTable) -> FloatArray:
    """Return the degree (N,) to which objects are standing."""
    return fill_unknown(falling(table.speed_mps, 0.6, 0.12))


def is_facing_ego(table: ObjectTable) -> FloatArray:
    """Return the degree (N,) to which objects head against the ego's direction of travel."""
    return np.where(table.front_known, rising(np.abs(table.relative_heading_rad), 2.1, 0.1), UNKNOWN)


def is_ahead(table: ObjectTable) -> FloatArray:
    """Return the degree (N,) to which objects are ahead of the ego and not next to it; highest in the ego lane."""
    x, y = table.xy_m.T
    before = rising(x, 4.0, 0.6) * rising(x - 0.6 * np.abs(y), 0.0, 1.5)
    return before * (0.75 + 0.25 * gaussian(table.lateral_m, LANE_M))


def _is_behind_ego(table: ObjectTable) -> FloatArray:
    """Return the degree (N,) to which objects are behind the ego."""
    x, y = table.xy_m.T
    return rising(-x, 1.0, 0.6) * falling(x - np.abs(y), 1.0, 1.5)


def _is_beside_ego(table: ObjectTable) -> FloatArray:
    """Return the degree (N,) to which objects are next to the ego."""
    x, y = table.xy_m.T
    return falling(np.abs(x - table.ego.centre_m), 4.5, 0.8) * falling(np.abs(y), 2 * LANE_M, 1.0)


def _is_in_row(table: ObjectTable) -> FloatArray:
    """Return the degree (N,) to which objects stand in a row: another one stands in line, near by."""
    standing = is_standing(table) * table.is_vehicle
    apart_m = np.abs(table.along_m[:, None] - table.along_m) - (table.size_m[:, :1] + table.size_m[:, 0]) / 2
    in_line = gaussian(table.lateral_m[:, None] - table.lateral_m, _ROW_SIGMA_M) * falling(apart_m, *_ROW_GAP_M)
    np.fill_diagonal(in_line, 0.0)
    return np.asarray(standing * np.max(in_line * standing, axis=1, initial=0.0))


def in_own_lane(table: ObjectTable) -> FloatArray:
    """Return the degree (N,) to which objects are in the ego lane."""
    return falling(np.abs(table.lateral_m), LANE_M / 2, 0.25)


def _make_side_predicate(sign: int) -> Callable[[ObjectTable], FloatArray]:
    """Make the predicate "on the left" (1) or "on the right" (-1) of the ego; higher on that side of its lane."""

    def fits_side(table: ObjectTable) -> FloatArray:
        lane_side = rising(sign * table.lateral_m, 1.0, 0.35)
        return rising(sign * table.xy_m[:, 1], 1.0, 0.35) * (0.6 + 0.4 * lane_side)

    return fits_side


def _is_on_opposite_side(table: ObjectTable) -> FloatArray:
    """Return the degree (N,) to which objects are on the side of oncoming traffic, best if they face the ego."""
    sign = 1 if table.lanes.oncoming_left else -1
    highest = table.lanes.highest if sign > 0 else -table.lanes.lowest
    beyond = rising(sign * table.lateral_m, LANE_M * (highest + 0.5), 0.4)
    return beyond * (0.6 + 0.4 * is_facing_ego(table))


def _is_on_own_side(table: ObjectTable) -> FloatArray:
    """Return the degree (N,) to which objects are on the side of the ego's traffic."""
    return 1 - _is_on_opposite_side(table)


def _is_in_lane(table: ObjectTable, lane: int) -> FloatArray:
    """Return the degree (N,) to which objects are in a lane, numbered from the ego lane (0) to the left."""
    return falling(np.abs(table.lateral_m - lane * LANE_M), LANE_M / 2, 0.3)


def _make_lane_predicate(sign: int) -> Callable[[ObjectTable], FloatArray]:
    """Make the predicate "in the left lane" (1) or "in the right lane" (-1); the ego lane may be that lane."""

    def fits_lane(table: ObjectTable) -> FloatArray:
        outermost = table.lanes.highest if sign > 0 else -table.lanes.lowest
        result = np.maximum(0.6 * _is_in_lane(table, sign), 0.3 * _is_in_lane(table, 2 * sign))
        for lane in range(1, outermost + 1):
            result = np.maximum(result, (1.0 if lane in (1, outermost) else 0.8) * _is_in_lane(table, sign * lane))
        return np.maximum(result, (0.3 if outermost else 0.6) * in_own_lane(table))

    return fits_lane


def _is_in_middle_lane(table: ObjectTable) -> FloatArray:
    middle = (table.lanes.lowest + table.lanes.highest) / 2
    return gaussian(table.lateral_m / LANE_M - middle, 0.5)


def _is_in_other_lane(table: ObjectTable) -> FloatArray:
    return (1 - in_own_lane(table)) * falling(np.abs(table.lateral_m), 2.6 * LANE_M, 0.6)


def _is_moving(table: ObjectTable) -> FloatArray:
    return 1 - is_standing(table)


def _is_parked(table: ObjectTable) -> FloatArray:
    """Return the degree (N,) to which objects are parked: standing, and less likely so in the ego lane."""
    return is_standing(table) * (1 - 0.4 * in_own_lane(table))


def _is_stopped(table: ObjectTable) -> FloatArray:
    """Return the degree (N,) to which objects stand or decelerate at low speed; in the ego lane none is parked."""
    slowing = rising(-table.acceleration_mps2, 1.0, 0.2) * falling(table.speed_mps, 3.0, 0.4)
    slow = fill_unknown(falling(table.speed_mps, 1.0, 0.35))
    return np.maximum(slow, 0.7 * np.nan_to_num(slowing)) * (0.6 + 0.4 * in_own_lane(table))


def _is_oncoming(table: ObjectTable) -> FloatArray:
    comes = 0.2 + 0.8 * rising(table.xy_m[:, 0], -4.0, 0.5)  # one behind us has passed
    return is_facing_ego(table) * (0.1 + 0.9 * _is_moving(table)) * comes


def _faces_same_way(table: ObjectTable) -> FloatArray:
    return 1 - is_facing_ego(table)


def _make_turn_predicate(sign: int) -> Callable[[ObjectTable], FloatArray]:
    """Make the predicate "turning" left (1), right (-1) or either way (0): by yaw rate, else by slant to the road."""

    def fits_turn(table: ObjectTable) -> FloatArray:
        rate, heading = table.yaw_rate_radps, table.relative_heading_rad
        slant = np.sin(heading) * np.sign(np.cos(heading))
        rate, slant = (np.abs(rate), np.abs(slant)) if sign == 0 else (sign * rate, sign * slant)
        by_rate = rising(rate, _STRAIGHT_YAW_RATE_RADPS, 0.04)
        by_slant = np.where(table.front_known, 0.15 + 0.6 * rising(slant, _STRAIGHT_SLANT_RAD, 0.06), UNKNOWN)
        # A vehicle that waits to turn stands at a slant.
        turning = np.maximum(_is_moving(table), 0.5 * rising(np.abs(slant), 2 * _STRAIGHT_SLANT_RAD, 0.1))
        return np.where(np.isnan(rate), by_slant, by_rate) * turning

    return fits_turn


def _is_leaving(table: ObjectTable) -> FloatArray:
    """Return the degree (N,) to which objects pull out from the roadside.

    They are slow, and at a slant or accelerating; the degree is low for standing objects.
    """
    slow = fill_unknown(rising(table.speed_mps, 0.3, 0.1) * falling(table.speed_mps, 4.0, 0.5))
    starts = np.maximum(
        rising(np.abs(np.sin(table.relative_heading_rad)), 0.12, 0.04), np.nan_to_num(table.acceleration_mps2) > 0.4
    )
    return (1 - 0.6 * in_own_lane(table)) * np.maximum(slow * (0.5 + 0.5 * starts), 0.3 * is_standing(table))


def _is_passing(table: ObjectTable) -> FloatArray:
    """Return the degree (N,) to which objects pass the ego: moving next to it or just ahead, in another lane."""
    alongside = gaussian(np.maximum(np.abs(table.along_m - 5) - 12, 0), 6.0)
    return _is_moving(table) * alongside * (1 - 0.8 * in_own_lane(table)) * (1 - 0.6 * is_facing_ego(table))


def _is_braking(table: ObjectTable) -> FloatArray:
    return fill_unknown(rising(-table.acceleration_mps2, 0.8, 0.2)) * (0.4 + 0.6 * _is_moving(table))


QUALIFIERS: Mapping[str, Callable[[ObjectTable], FloatArray]] = {
    "left_side": _make_side_predicate(1),
    "right_side": _make_side_predicate(-1),
    "opposite_side": _is_on_opposite_side,
    "own_side": _is_on_own_side,
    "own_lane": in_own_lane,
    "left_lane": _make_lane_predicate(1),
    "right_lane": _make_lane_predicate(-1),
    "middle_lane": _is_in_middle_lane,
    "other_lane": _is_in_other_lane,
    "ahead": is_ahead,
    "behind_ego": _is_behind_ego,
    "beside_ego": _is_beside_ego,
    "in_row": _is_in_row,
    "parked": _is_parked,
    "stopped": _is_stopped,
    "moving": _is_moving,
    "oncoming": _is_oncoming,
    "same_way": _faces_same_way,
    "facing_us": is_facing_ego,
    "turning": _make_turn_predicate(0),
    "turning_left": _make_turn_predicate(1),
    "turning_right": _make_turn_predicate(-1),
    "leaving": _is_leaving,
    "passing": _is_passing,
    "braking": _is_braking,
}


def fit_size(qualifier: str, noun: str, table: ObjectTable) -> FloatArray:
    """Return the degree (N,) to which objects are "large" or "small" for the class that a noun names."""
    length = table.size_m[:, 0]
    if qualifier == "large":
        return rising(length, _LARGE_M.get(noun, 5.4), 0.3)
    return falling(length, _SMALL_M.get(noun, 4.5), 0.2)


def fit_colour(colour: str, scene: SceneModel) -> FloatArray:
    """Return the membership (N,) of objects in a colour.

    An object of unknown colour gets the frequency of the colour, or 0.5 if no object has a known colour. A word that
    names no colour gives 0.5 for all.
    """
    table = scene.table
    known = np.isfinite(scene.paint_rgb).all(axis=1)
    if not known.any():
        return np.full(len(table), UNKNOWN)
    result = np.full(len(table), _COLOUR_FREQUENCY.get(colour.split()[-1], _RARE_COLOUR_FREQUENCY))
    try:
        term = " ".join(COLOURS.get(word, word) for word in colour.split())
        result[known] = fit(term, scene.paint_rgb[known], NEUTRAL_LIGHT)
    except ValueError:
        return np.full(len(table), UNKNOWN)
    ridden = np.array([name in ("motorcycle", "bicycle") for name in table.class_names], np.bool_)
    people = np.array([name == "person" for name in table.class_names], np.bool_)
    ridden |= (table.size_m[:, 0] < _RIDDEN_LENGTH_M) & ~people
    return np.where(ridden, _LEAST_RIDDEN_FIT + (1 - _LEAST_RIDDEN_FIT) * result, result)


def to_referent(part: Landmark | Exclusion) -> Referent:
    """Turn a landmark or an exclusion into a referent, to score it as one."""
    return Referent(part.noun, part.noun.replace("_", " "), part.colour, part.qualifiers)


def fit_words(referent: Referent, scene: SceneModel) -> dict[str, FloatArray]:
    """Return the membership (N,) of objects in each word of a referent except its ordinals and superlatives."""
    table = scene.table
    result = {referent.head: fit_noun(referent.noun, referent.head, table)}
    if referent.colour:
        result[referent.colour] = fit_colour(referent.colour, scene)
    for qualifier in referent.qualifiers:
        word = qualifier.replace("_", " ")
        if qualifier in QUALIFIERS:
            result[word] = QUALIFIERS[qualifier](table)
        elif qualifier in ("large", "small"):
            result[word] = fit_size(qualifier, referent.noun, table)
    return result
