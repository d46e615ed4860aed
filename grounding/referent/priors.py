"""What is not said and yet likely: where people speak of vehicles, and which ones an action is about."""

from __future__ import annotations

import numpy as np

from appocc.checks import BoolArray, FloatArray
from grounding.query import Query, Referent
from grounding.referent.fuzzy import bell, rises
from grounding.referent.object_table import Crowd
from grounding.referent.ordinals import counting_words
from grounding.referent.predicates import ahead, facing, own_lane, standing

# A vehicle behind the ego counts a fifth, less where they are counted; one beside the picture a bit less.
_BEHIND, _BEHIND_COUNTS, _ASIDE = 0.2, 0.15, 0.8
# One that others hide is hardly spoken of; in a row on our path it is, by some, and it is counted.
_HIDDEN, _HIDDEN_IN_ROW, _HIDDEN_COUNTS, _ROW_M = 0.2, 0.6, 0.85, 4.5
_CORNER, _ENOUGH = 0.1, 0.7
_HOUSES, _HOUSE_M = 0.6, 15.0
# Beyond this, metres beside our path, is another street.
_OTHER_STREET_M, _OTHER_STREET = 16.0, 0.4
# Few speak of what lies farther ahead or aside than this; the fall beyond it is slow.
_NEAR_M, _FALL_M = 10.0, 45.0
_SIDEWAYS_M, _SIDEWAYS_FALL_M = 6.0, 16.0
# Where any will do, the near one does.
_ANY_M = 15.0
# The least that a hint leaves of a vehicle.
_LEAST = 0.3
_SOON_S, _WALKS_MPS = (0.0, 2.0, 4.0), 1.2


def membership(referent: Referent, crowd: Crowd) -> FloatArray:
    """(N,) 0..1: how likely a thing counts where things are counted: not behind us, hidden, or in another street."""
    aside = np.abs(crowd.sideways_m)
    hidden = _HIDDEN_COUNTS * _in_row(crowd)
    result = hidden + (1 - hidden) * _seen(crowd)
    if not {"leftmost", "rightmost", "farthest"} & {*referent.qualifiers}:
        result = result * (1 - (1 - _OTHER_STREET) * rises(aside, _OTHER_STREET_M, 2.0))
    if not _behind_is_meant(referent):
        result = result * np.where(_is_behind(crowd), _BEHIND_COUNTS, 1.0)
    return result


def place(query: Query, referent: Referent, crowd: Crowd) -> FloatArray:
    """(N,) logarithms: a mild liking for what is seen, near, near our path and to the front."""
    behind = _behind_is_meant(referent)
    away = np.abs(crowd.along_m) if behind else np.maximum(crowd.along_m, 0)
    in_row = _HIDDEN_IN_ROW * np.ones(len(crowd))
    if {"ahead", "own_lane"} & {*referent.qualifiers} or query.action in ("follow", "overtake"):
        # Of a queue in our lane the first one is "the car ahead".
        in_row = in_row * (1 - own_lane(crowd) / 2)
    hidden = _HIDDEN + (in_row - _HIDDEN) * _in_row(crowd)
    result = np.log(hidden + (1 - hidden) * _seen(crowd))
    result = result - (np.maximum(np.abs(crowd.sideways_m) - _SIDEWAYS_M, 0) / _SIDEWAYS_FALL_M) ** 2 / 2
    if not {"farthest", "last"} & set(referent.qualifiers):
        result = result - (np.maximum(away - _NEAR_M, 0) / _FALL_M) ** 2 - away / 200
    if not behind:
        # Where things are counted, those behind us count less already.
        if not counting_words(referent.qualifiers):
            result = result + np.where(_is_behind(crowd), np.log(_BEHIND), 0.0)
        x, y = crowd.xy_m.T
        seen = rises(x + 2 - np.abs(y), 0.0, 1.5)
        result = result + np.log(_ASIDE + (1 - _ASIDE) * seen)
    if not referent.definite:
        result = result - crowd.distance_m / _ANY_M
    return result


def _is_behind(crowd: Crowd) -> BoolArray:
    return np.asarray(crowd.xy_m[:, 0] < crowd.ego.centre_m - 2.5)


def _seen(crowd: Crowd) -> FloatArray:
    """(N,) whether a driver notices them: a corner is not enough, and not all has to be seen.

    Beside roads stand houses: what lies across much ground that is no road is likely hidden.
    """
    past_houses = 1 - _HOUSES * rises(crowd.off_road_m, _HOUSE_M, 1.5)
    return np.asarray(((crowd.visible - _CORNER) / (_ENOUGH - _CORNER)).clip(0, 1)) * past_houses


def _in_row(crowd: Crowd) -> FloatArray:
    """(N,) whether they stand in line on our path or right beside it."""
    return bell(np.maximum(np.abs(crowd.sideways_m) - _ROW_M, 0), 1.5)


def _behind_is_meant(referent: Referent) -> bool:
    return bool({"behind_ego", "passing"} & {*referent.qualifiers, *referent.qualifiers_optional})


def of_action(query: Query, crowd: Crowd) -> FloatArray:
    """(N,) logarithms: how well things suit what is to be done, mild beside what is said of them."""
    stands = standing(crowd)
    fit = np.ones(len(crowd))
    if query.action == "follow":
        waits = 0.25 + 0.55 * own_lane(crowd)
        fit = (1 - stands + stands * waits) * (1 - 0.8 * facing(crowd)) * (0.4 + 0.6 * (crowd.along_m > 0))
        fit = fit * (0.6 + 0.4 * bell(crowd.sideways_m, 4.0))
    elif query.action == "overtake":
        fit = (0.15 + 0.85 * own_lane(crowd)) * ahead(crowd) * (1 - 0.8 * facing(crowd))
    elif query.action in ("give_way", "wait") and query.trigger != "leave":
        # People who are let pass stand at the kerb; vehicles move.
        fit = _crosses(crowd) * (1 - 0.7 * stands * crowd.vehicle)
    elif query.action in ("avoid", "slow_down"):
        fit = np.maximum(_crosses(crowd), bell(crowd.sideways_m, 4.0)) * (crowd.along_m > 0)
    elif query.action in ("park", "pull_over"):
        fit = 0.15 + 0.85 * stands
    elif query.action == "stop" and query.relation not in ("none", "at", "toward"):
        fit = 0.5 + 0.5 * stands
    if query.trigger in ("pass", "turn", "merge") and query.action not in ("give_way", "wait"):
        fit = fit * (1 - 0.85 * stands)
    return np.asarray(np.log(_LEAST + (1 - _LEAST) * fit))


def _crosses(crowd: Crowd) -> FloatArray:
    """(N,) whether things come into our way within seconds; what drives before us is in nobody's way."""
    speed = np.maximum(np.nan_to_num(crowd.speed_mps, nan=1.0), np.where(crowd.vehicle, 0.0, _WALKS_MPS))
    lateral = speed * np.sin(crowd.turn_rad)
    nearest = np.min([np.abs(crowd.sideways_m + lateral * seconds) for seconds in _SOON_S], axis=0)
    leads = bell(crowd.sideways_m, 2.0) * np.cos(crowd.turn_rad).clip(0) * (crowd.along_m > 0)
    across = 0.5 + 0.5 * np.abs(np.sin(crowd.turn_rad))
    return np.asarray(across * (0.3 + 0.7 * bell(np.maximum(nearest - 3, 0), 3.0)) * (1 - 0.7 * leads))
