"""Doubts about the place and the colour of the best candidate, which are asked about."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from grounding.query import Query, Referent
from grounding.referent.clarification import describe_one
from grounding.referent.ordinals import is_plural
from grounding.referent.priors import OTHER_STREET_M, includes_behind
from grounding.referent.scene import SceneModel
from grounding.vocabulary import PERSON_NOUNS

# Actions that go forward. They do not mean a vehicle behind us, unless the command says so.
_FORWARD = ("park", "stop", "pull_over", "follow", "approach", "overtake", "drive_past", "turn", "change_lane")
# A vehicle is behind us if its centre is this far behind ours; hidden if less of it than this share is visible.
_BEHIND_M, _HIDDEN_SHARE = 6.0, 0.05
# Below these the colour and the class do not fit the vehicle that fits best.
_LEAST_COLOUR_FIT, _LEAST_CLASS_FIT = 0.12, 0.25


def question_about(
    query: Query, referent: Referent, row: int, word_fits: Mapping[str, float], scene: SceneModel
) -> str:
    """Return the question that settles whether an object is meant, '' if there is no doubt.

    Args:
        query: the command.
        referent: what is sought.
        row: the object, by its row of the object table.
        word_fits: membership of the object in each word.
        scene: the scene.
    """
    if not scene.table.is_vehicle[row] or referent.noun in PERSON_NOUNS:
        return ""
    item = scene.table.items[row]
    coloured = f"{referent.colour or ''} {referent.head}".strip()
    be = "are" if is_plural(referent.head) else "is"
    if _has_other_colour(referent, row, word_fits, scene):
        return f"no {coloured} {be} seen: do you mean {describe_one(item, scene)}?"
    if lacks_class(referent, row, word_fits, scene):
        return f"no {referent.head} {be} seen: do you mean {describe_one(item, scene)}?"
    where = _out_of_sight(query, referent, row, scene)
    return f"there {be} no {coloured} ahead, only {where}: do you mean {describe_one(item, scene)}?" if where else ""


def fits_badly(referent: Referent, row: int, word_fits: Mapping[str, float], scene: SceneModel) -> bool:
    """Return whether an object has another colour or class than the words; arguments as in `question_about`."""
    return _has_other_colour(referent, row, word_fits, scene) or lacks_class(referent, row, word_fits, scene)


def _has_other_colour(referent: Referent, row: int, word_fits: Mapping[str, float], scene: SceneModel) -> bool:
    known = referent.colour is not None and scene.table.items[row].rgb is not None
    return known and word_fits[referent.colour or ""] < _LEAST_COLOUR_FIT


def lacks_class(referent: Referent, row: int, word_fits: Mapping[str, float], scene: SceneModel) -> bool:
    """Return whether an object is of another class than the noun; arguments as in `question_about`."""
    item = scene.table.items[row]
    known = item.class_name != "vehicle" and item.common_name != referent.noun and referent.head in word_fits
    return known and word_fits[referent.head] < _LEAST_CLASS_FIT


def _out_of_sight(query: Query, referent: Referent, row: int, scene: SceneModel) -> str:
    """Return where an object is that a forward action would not expect: behind us, hidden, in another street."""
    table = scene.table
    if query.action not in _FORWARD or query.distance_of == "descriptor":
        return ""
    forward = query.manoeuvre != "back" and not includes_behind(referent)
    if forward and float(table.xy_m[row, 0]) < scene.ego.centre_m - _BEHIND_M:
        return "one behind us"
    described = referent.colour or referent.qualifiers or query.secondary
    if table.visible_share[row] <= _HIDDEN_SHARE and not (described or _in_our_lane(row, scene)):
        return "one that is hidden from here"  # who tells its colour knows of it
    beyond = is_in_other_street(row, scene)
    return "one in another street" if beyond and not referent.qualifiers else ""


def is_in_other_street(row: int, scene: SceneModel) -> bool:
    """Return whether an object, by its row of the object table, is beyond what is no road."""
    table = scene.table
    far = np.abs(table.lateral_m[row]) > OTHER_STREET_M
    return bool(far and table.off_road_sight_m[row] > OTHER_STREET_M / 2)


def _in_our_lane(row: int, scene: SceneModel) -> bool:
    """Return whether an object is in the queue before us, where one vehicle hides the next."""
    return bool(abs(scene.table.lateral_m[row]) < scene.ego.width_m)
