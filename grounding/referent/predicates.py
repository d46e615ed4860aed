"""Soft predicates: how well things fit what is said of them, 0..1; what is unknown stays half open."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from appocc.checks import FloatArray
from appocc.colours import fit
from grounding.query import Exclusion, Landmark, Referent
from grounding.referent.class_fit import of_noun
from grounding.referent.fuzzy import UNKNOWN, bell, falls, half_open, rises
from grounding.referent.object_table import Crowd
from grounding.referent.scene import NEUTRAL, Scene
from grounding.road.lane_model import LANE_M
from grounding.vocabulary import COLOURS

# How many of ten vehicles people call so; the rest share the rest. What has no known colour fits as well as chance.
_COMMON_PAINT = {"white": 0.35, "black": 0.3, "grey": 0.3, "silver": 0.3, "dark": 0.4, "light": 0.4}
_RARE_PAINT = 0.045
# From above a motorcycle is rather its rider's colour than its own.
_RIDDEN, _RIDDEN_M = 0.25, 2.6
_LARGE_M = {"car": 4.75, "van": 5.6, "truck": 6.5, "bus": 11.5, "motorcycle": 2.2}
_SMALL_M = {"car": 4.25, "van": 5.0, "truck": 5.9, "bus": 8.0, "motorcycle": 2.0}
# Within these a vehicle drives straight on.
_STRAIGHT_RADPS, _STRAIGHT_RAD = 0.12, 0.2


def standing(crowd: Crowd) -> FloatArray:
    """(N,) whether they stand."""
    return half_open(falls(crowd.speed_mps, 0.6, 0.12))


def facing(crowd: Crowd) -> FloatArray:
    """(N,) whether their fronts point against our direction of travel."""
    return np.where(crowd.front_known, rises(np.abs(crowd.turn_rad), 2.1, 0.1), UNKNOWN)


def ahead(crowd: Crowd) -> FloatArray:
    """(N,) whether they are before us rather than beside us, best in our own lane."""
    x, y = crowd.xy_m.T
    before = rises(x, 4.0, 0.6) * rises(x - 0.6 * np.abs(y), 0.0, 1.5)
    return before * (0.75 + 0.25 * bell(crowd.sideways_m, LANE_M))


def _behind_ego(crowd: Crowd) -> FloatArray:
    x, y = crowd.xy_m.T
    return rises(-x, 1.0, 0.6) * falls(x - np.abs(y), 1.0, 1.5)


def own_lane(crowd: Crowd) -> FloatArray:
    """(N,) whether they are in our lane."""
    return falls(np.abs(crowd.sideways_m), LANE_M / 2, 0.25)


def _on_side(sign: int) -> Callable[[Crowd], FloatArray]:
    """To the left (1) or right (-1) as we see it; on a bend better also of our lane."""

    def fits_side(crowd: Crowd) -> FloatArray:
        of_lane = rises(sign * crowd.sideways_m, 1.0, 0.35)
        return rises(sign * crowd.xy_m[:, 1], 1.0, 0.35) * (0.6 + 0.4 * of_lane)

    return fits_side


def _opposite_side(crowd: Crowd) -> FloatArray:
    """Where the traffic comes towards us, or what heads against us there."""
    sign = 1 if crowd.lanes.oncoming_left else -1
    highest = crowd.lanes.highest if sign > 0 else -crowd.lanes.lowest
    beyond = rises(sign * crowd.sideways_m, LANE_M * (highest + 0.5), 0.4)
    return beyond * (0.6 + 0.4 * facing(crowd))


def _lane(crowd: Crowd, lane: int) -> FloatArray:
    return falls(np.abs(crowd.sideways_m - lane * LANE_M), LANE_M / 2, 0.3)


def _side_lane(sign: int) -> Callable[[Crowd], FloatArray]:
    """The lane to our left (1) or right (-1); where there is none, ours is that lane."""

    def fits_lane(crowd: Crowd) -> FloatArray:
        outermost = crowd.lanes.highest if sign > 0 else -crowd.lanes.lowest
        result = np.maximum(0.6 * _lane(crowd, sign), 0.3 * _lane(crowd, 2 * sign))
        for lane in range(1, outermost + 1):
            result = np.maximum(result, (1.0 if lane in (1, outermost) else 0.8) * _lane(crowd, sign * lane))
        return np.maximum(result, (0.3 if outermost else 0.6) * own_lane(crowd))

    return fits_lane


def _middle_lane(crowd: Crowd) -> FloatArray:
    middle = (crowd.lanes.lowest + crowd.lanes.highest) / 2
    return bell(crowd.sideways_m / LANE_M - middle, 0.5)


def _other_lane(crowd: Crowd) -> FloatArray:
    return (1 - own_lane(crowd)) * falls(np.abs(crowd.sideways_m), 2.6 * LANE_M, 0.6)


def _moving(crowd: Crowd) -> FloatArray:
    return 1 - standing(crowd)


def _parked(crowd: Crowd) -> FloatArray:
    """Standing, and rather at the side of the road than in a lane in front of us."""
    return standing(crowd) * (1 - 0.4 * own_lane(crowd))


def _stopped(crowd: Crowd) -> FloatArray:
    """Standing, or about to."""
    slowing = rises(-crowd.acceleration_mps2, 1.0, 0.2) * falls(crowd.speed_mps, 3.0, 0.4)
    slow = half_open(falls(crowd.speed_mps, 1.0, 0.35))
    return np.maximum(slow, 0.7 * np.nan_to_num(slowing))


def _oncoming(crowd: Crowd) -> FloatArray:
    return facing(crowd) * (0.1 + 0.9 * _moving(crowd))


def _turning(sign: int) -> Callable[[Crowd], FloatArray]:
    """To the left (1), to the right (-1), to either side (0): by its yaw rate, else by its slant to the road."""

    def fits_turn(crowd: Crowd) -> FloatArray:
        rate, slant = crowd.yaw_rate_radps, np.sin(crowd.turn_rad) * np.sign(np.cos(crowd.turn_rad))
        rate, slant = (np.abs(rate), np.abs(slant)) if sign == 0 else (sign * rate, sign * slant)
        by_rate = rises(rate, _STRAIGHT_RADPS, 0.04)
        by_slant = np.where(crowd.front_known, 0.15 + 0.6 * rises(slant, _STRAIGHT_RAD, 0.06), UNKNOWN)
        # One that waits before a turn stands at a slant.
        moves = np.maximum(_moving(crowd), 0.5 * rises(np.abs(slant), 2 * _STRAIGHT_RAD, 0.1))
        return np.where(np.isnan(rate), by_slant, by_rate) * moves

    return fits_turn


def _leaving(crowd: Crowd) -> FloatArray:
    """Starting from the side of the road: slow, at a slant or gaining speed; who stands there may be about to."""
    slow = half_open(rises(crowd.speed_mps, 0.3, 0.1) * falls(crowd.speed_mps, 4.0, 0.5))
    starts = np.maximum(
        rises(np.abs(np.sin(crowd.turn_rad)), 0.12, 0.04), np.nan_to_num(crowd.acceleration_mps2) > 0.4
    )
    return (1 - 0.6 * own_lane(crowd)) * np.maximum(slow * (0.5 + 0.5 * starts), 0.3 * standing(crowd))


def _passing(crowd: Crowd) -> FloatArray:
    """Moving beside us or just before us, in another lane, the way we go."""
    beside = bell(np.maximum(np.abs(crowd.along_m - 5) - 12, 0), 6.0)
    return _moving(crowd) * beside * (1 - 0.8 * own_lane(crowd)) * (1 - 0.6 * facing(crowd))


def _braking(crowd: Crowd) -> FloatArray:
    return half_open(rises(-crowd.acceleration_mps2, 0.8, 0.2)) * (0.4 + 0.6 * _moving(crowd))


QUALIFIERS: Mapping[str, Callable[[Crowd], FloatArray]] = {
    "left_side": _on_side(1),
    "right_side": _on_side(-1),
    "opposite_side": _opposite_side,
    "own_lane": own_lane,
    "left_lane": _side_lane(1),
    "right_lane": _side_lane(-1),
    "middle_lane": _middle_lane,
    "other_lane": _other_lane,
    "ahead": ahead,
    "behind_ego": _behind_ego,
    "parked": _parked,
    "stopped": _stopped,
    "moving": _moving,
    "oncoming": _oncoming,
    "turning": _turning(0),
    "turning_left": _turning(1),
    "turning_right": _turning(-1),
    "leaving": _leaving,
    "passing": _passing,
    "braking": _braking,
}


def of_size(qualifier: str, noun: str, crowd: Crowd) -> FloatArray:
    """(N,) whether they are large or small, as things go that the noun names."""
    length = crowd.size_m[:, 0]
    if qualifier == "large":
        return rises(length, _LARGE_M.get(noun, 5.4), 0.3)
    return falls(length, _SMALL_M.get(noun, 4.5), 0.2)


def of_colour(colour: str, scene: Scene) -> FloatArray:
    """(N,) whether they have a colour; what has no known one fits as well as chance, half where none is known.

    A word that stands for no colour tells nothing.
    """
    crowd = scene.crowd
    known = np.isfinite(scene.paint_rgb).all(axis=1)
    if not known.any():
        return np.full(len(crowd), UNKNOWN)
    result = np.full(len(crowd), _COMMON_PAINT.get(colour.split()[-1], _RARE_PAINT))
    try:
        term = " ".join(COLOURS.get(word, word) for word in colour.split())
        result[known] = fit(term, scene.paint_rgb[known], NEUTRAL)
    except ValueError:
        return np.full(len(crowd), UNKNOWN)
    ridden = np.array([kind in ("motorcycle", "bicycle") for kind in crowd.kind], np.bool_)
    ridden |= crowd.size_m[:, 0] < _RIDDEN_M
    return np.where(ridden, _RIDDEN + (1 - _RIDDEN) * result, result)


def described(part: Landmark | Exclusion) -> Referent:
    """A further thing that a command names, as one that could be meant."""
    return Referent(part.noun, part.noun.replace("_", " "), part.colour, part.qualifiers)


def fits(referent: Referent, scene: Scene) -> dict[str, FloatArray]:
    """Every predicate of a referent but its ordinals and superlatives, and how well each thing (N,) fits it."""
    crowd = scene.crowd
    result = {referent.head: of_noun(referent.noun, referent.head, crowd)}
    if referent.colour:
        result[referent.colour] = of_colour(referent.colour, scene)
    for qualifier in referent.qualifiers:
        word = qualifier.replace("_", " ")
        if qualifier in QUALIFIERS:
            result[word] = QUALIFIERS[qualifier](crowd)
        elif qualifier in ("large", "small"):
            result[word] = of_size(qualifier, referent.noun, crowd)
    return result
