"""Answers about how we get to the goal and stand there: backwards, in the way of others, and what is beside us."""

from __future__ import annotations

import re

import numpy as np

from appocc.checks import FloatArray
from grounding.answer import Answer
from grounding.dialogue.conversation import Conversation
from grounding.dialogue.telling.measures import describe_one, gap_ends_m
from grounding.dialogue.telling.place import describe_kerb, kerb_gap, place_of, standing_place
from grounding.dialogue.telling.reports import aside, unknown
from grounding.dialogue.telling.things import NAMING
from grounding.goal.limits import is_in_the_road
from grounding.goal.planner import Target
from grounding.language import WordCategory
from grounding.language.questions import Question
from grounding.referent.scene import SceneModel
from grounding.scene_object import SceneObject

# Less than this backwards is not told; a place nearer than this ahead leaves no way to turn in forwards; no vehicle
# within this of us in line leaves the place open.
_LITTLE_M, _NEAR_M, _OPEN_M = 0.5, 8.0, 20.0
# Room that a door needs, and the largest distance of what is beside us.
_DOOR_M, _BESIDE_M = 0.8, 4.0
# A gap shorter than this many lengths of us is entered backwards.
_SHORT_GAP = 2.0
_NO_GOAL = "where we will stand, without a goal"
_SIDES = {"left": 1.0, "right": -1.0}
_PLACING = (WordCategory.RELATION, WordCategory.WHERE, WordCategory.SIDE)
# Words of a vehicle that only its place tells.
_PLAIN = (WordCategory.NOUN, WordCategory.ONE, WordCategory.THE, WordCategory.TO)
# Relations to a place that are along our way.
_ALONG = {"behind": -1.0, "before": -1.0, "in_front_of": 1.0, "past": 1.0, "ahead": 1.0}


def tell_reversing(talk: Conversation, text: str, question: Question) -> Answer | None:
    """Tell how much of the way to the goal is backwards, and why."""
    about, place = talk.state.goal or talk.state.question, place_of(talk)
    if about is None or place is None:
        return unknown(talk, text, "a way without a goal")
    ways = [one.plan.way for one in (about.steps or (about,)) if one.plan.way is not None]
    back_m = sum(way.backwards_m for way in ways)
    if not ways:  # a place that is only offered
        behind = float(place.ego_m[0]) < talk.scene.ego.centre_m
        return aside(talk, text, f"yes: {_why_backwards(place, talk.scene)}") if behind else None
    if back_m < _LITTLE_M:
        return aside(talk, text, "no: the way there goes forwards only")
    yes = "" if "why" in question.kinds else "yes: "
    return aside(talk, text, f"{yes}{back_m:.0f} m of the way are backwards", _why_backwards(place, talk.scene))


def _why_backwards(place: Target, scene: SceneModel) -> str:
    """Return why a way to a place is not forwards alone."""
    ahead_m, left_m = float(place.ego_m[0] - scene.ego.centre_m), float(place.ego_m[1])
    if ahead_m < 0:
        return f"the place is {-ahead_m:.0f} m behind where we are"
    before_m, behind_m = gap_ends_m(place, scene)
    length_m = before_m + behind_m + place.ego.length_m
    if length_m < _SHORT_GAP * place.ego.length_m:
        return f"the gap is {length_m:.1f} m long, we are {place.ego.length_m:.1f} m: too short to turn in forwards"
    if ahead_m < _NEAR_M:
        aside_m = f"{abs(left_m):.0f} m to the {'left' if left_m > 0 else 'right'}"
        return f"the place is {ahead_m:.0f} m ahead and {aside_m}: too near to turn in forwards"
    return "no better way into the place was found"


def tell_blocking(talk: Conversation, text: str, question: Question) -> Answer | None:
    """Tell whether others have to drive around us at the goal, or whether we are at the edge of the road there."""
    place = standing_place(talk)
    if place is None:
        return unknown(talk, text, _NO_GOAL)
    edge, road = kerb_gap(place, talk.scene), talk.scene.road
    if edge is None or road is None:
        return aside(talk, text, describe_kerb(place, talk.scene))
    at_edge = not is_in_the_road(place.cell, place.heading_ego_rad, road)
    yes = "" if question.kind == "passing" else "yes: " if at_edge == (question.kind == "verge") else "no: "
    where = "at the edge of the road" if at_edge else "in the road: others have to drive around us"
    return aside(talk, text, f"{yes}the place is {where}", describe_kerb(place, talk.scene))


def tell_sides(talk: Conversation, text: str, question: Question) -> Answer | None:
    """Tell how much room there is beside us at the goal: for the doors."""
    place = standing_place(talk)
    if place is None:
        return unknown(talk, text, _NO_GOAL)
    named = [side for side in _SIDES if re.search(rf"\b{side}\b", text.lower())]
    gaps = {side: _find_beside(place, talk.scene, _SIDES[side]) for side in (named if len(named) == 1 else _SIDES)}
    told = [
        f"on our {side}: {f'{gap_m:.1f} m to {describe_one(item, talk.scene)}' if item else 'no vehicle near'}"
        for side, (item, gap_m) in gaps.items()
    ]
    free = [side for side, (item, gap_m) in gaps.items() if gap_m >= _DOOR_M and not (item and item.is_moving)]
    yes = "yes" if len(free) == len(gaps) else f"yes, on our {free[0]} only" if free else "no"
    where = "where we stand" if place_of(talk) is None else "there at the goal"
    return aside(talk, text, f"{yes}: {where}", *told)


def names_one_beside_us(talk: Conversation, words: str) -> bool:
    """Return whether words name the vehicle that is before or behind us at a place: "the car in front"."""
    tokens = talk.read(words).tokens if words else ()
    return bool(tokens) and tokens[-1].category in _PLACING and all(one.category in _PLAIN for one in tokens[:-1])


def tell_beside(talk: Conversation, text: str, question: Question) -> Answer | None:
    """Tell which vehicle stands behind, before or next to us at the goal; None without a goal or such words."""
    place = place_of(talk)
    tokens = talk.read(question.words).tokens if question.words else ()
    related = [i for i, one in enumerate(tokens) if one.category in (WordCategory.RELATION, WordCategory.WHERE)]
    after = tokens[related[-1] + 1 :] if related else ()
    if place is None or not related or any(one.category in NAMING for one in after):
        return None  # "are we parking behind the van?" names another thing
    relation = tokens[related[-1]].value.replace("behind_ego", "behind")
    most_m = _OPEN_M if relation in _ALONG else _BESIDE_M
    if relation in _ALONG:
        found = [_find_in_line(place, talk.scene, _ALONG[relation])]
    else:
        found = [_find_beside(place, talk.scene, sign) for sign in _SIDES.values()]
    told = [f"{describe_one(item, talk.scene)}, {gap_m:.1f} m from us there" for item, gap_m in found if item]
    talk.list_items([item for item, _ in found if item])
    if not told:
        where = {1.0: "in front of", -1.0: "behind"}.get(_ALONG.get(relation, 0.0), "next to")
        return aside(talk, text, f"no: nothing is seen within {most_m:.0f} m {where} the place")
    yes = "yes: " if "exists" in question.kinds else ""
    return aside(talk, text, f"{yes}{told[0]}", *told[1:])


def _find_in_line(place: Target, scene: SceneModel, sign: float) -> tuple[SceneObject | None, float]:
    """Return the vehicle in line with a place, before (1) or behind (-1) us, and the gap; None for none near."""
    forward = np.array([np.cos(place.heading_ego_rad), np.sin(place.heading_ego_rad)])
    return _find_towards(place, scene, sign * forward, place.ego.length_m / 2, place.ego.width_m / 2, _OPEN_M)


def _find_beside(place: Target, scene: SceneModel, sign: float) -> tuple[SceneObject | None, float]:
    """Return the vehicle next to us on the left (1) or right (-1) of a place, and the gap; None for none near."""
    left = np.array([-np.sin(place.heading_ego_rad), np.cos(place.heading_ego_rad)])
    return _find_towards(place, scene, sign * left, place.ego.width_m / 2, place.ego.length_m / 2, _BESIDE_M)


def _find_towards(
    place: Target, scene: SceneModel, towards: FloatArray, ours_m: float, wide_m: float, most_m: float
) -> tuple[SceneObject | None, float]:
    """Return the nearest vehicle in a strip from a place towards a direction, and the gap; None within `most_m`.

    Args:
        place: the place.
        scene: the scene.
        towards: (2,) direction.
        ours_m: how far we reach from the centre of the place in that direction.
        wide_m: half the width of the strip.
        most_m: greatest gap.
    """
    near: tuple[SceneObject | None, float] = (None, most_m)
    for item in scene.table.items:
        offset = item.footprint() - place.ego_m
        along, across = offset @ towards, offset @ np.array([-towards[1], towards[0]])
        gap_m = float(along.min()) - ours_m
        if across.min() < wide_m and across.max() > -wide_m and 0 <= gap_m < near[1]:
            near = item, gap_m
    return near
