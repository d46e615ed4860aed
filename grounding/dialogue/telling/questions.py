"""Answers to questions to the car: what is asked is decided by the words, and the scene and the plan answer it."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from appocc.motion_state import MOVING_MPS
from grounding.answer import Answer
from grounding.dialogue.conversation import Conversation
from grounding.dialogue.telling.landmarks import tell_landmarks
from grounding.dialogue.telling.measures import (
    describe_facing,
    describe_gap,
    describe_heading,
    describe_one,
    describe_size,
    describe_way,
    way_to,
)
from grounding.dialogue.telling.phrases import describe_goal
from grounding.dialogue.telling.place import tell_at_place, tell_next, tell_walk
from grounding.dialogue.telling.reports import (
    NOT_KNOWN,
    aside,
    ask_again,
    count,
    keep,
    tell_goal,
    tell_reasons,
    tell_seen,
    tell_vehicle,
    unknown,
)
from grounding.dialogue.telling.room import tell_room, tell_spot
from grounding.dialogue.telling.things import (
    DESCRIBING,
    POINTING,
    Things,
    describe_any,
    describe_thing,
    find_by_it,
    find_things,
    name_unmapped,
    names_thing,
)
from grounding.dialogue.telling.traffic import tell_coming, tell_waiting
from grounding.language import WordCategory
from grounding.language.questions import Question, read_question
from grounding.query import Referent
from grounding.referent.resolver import MAX_CANDIDATES, find_all, resolve
from grounding.referent.scene import SceneModel
from grounding.scene_object import SceneObject

# Centres of vehicles next to each other are at most this far apart.
_TOGETHER_M = 8.0
# What holds of every place that is found.
_KEPT = "the place is on the road, and clear of all vehicles that are seen"
# Kinds that tell what is there; of a choice, each is told.
_FOUND = ("exists", "place", "what", "which")
# What is too small for us where there is room, and the other way round.
_YES_NO, _TURNED = re.compile(r"^(?:yes|no)(?=[:,]|$)"), {"yes": "no", "no": "yes"}
_BEFORE, _LATER = (f"{NOT_KNOWN}: what it did before",), (f"{NOT_KNOWN}: what others will do",)
_Teller = Callable[[Conversation, str, Question], Answer | None]


def answer_question(talk: Conversation, text: str) -> Answer | None:
    """Answer a question to the car; None for another sentence, and for what only its context tells."""
    question = read_question(text, talk.grounder.lexicon)
    if question is None or not question.kind:
        return None
    if "people" in question.kinds and not question.limit and (told := _tell_people(talk, text, question)):
        return told
    if told := tell_landmarks(talk, text, question):
        return told
    if question.limit:
        return unknown(talk, text, question.limit)
    if question.options and question.kind in _FOUND and not names_thing(talk, question.words):
        return _tell_each(talk, text, question, describe_one)
    answer = _ANSWERS.get(question.kind)  # a kind that only tells more of another one is not asked alone
    return answer(talk, text, question) if answer else None


def _tell_each(
    talk: Conversation, text: str, question: Question, tell: Callable[[SceneObject, SceneModel], str]
) -> Answer | None:
    """Tell a property of each thing that a question is about; None if it is about none."""
    things = find_things(talk, question)
    told = [tell(item, talk.scene) for item in things.items] or things.reasons
    return aside(talk, text, *told) if told else None


def _tell_size(talk: Conversation, text: str, question: Question) -> Answer | None:
    if not question.words and not question.of_us and way_to(talk.state.goal) is not None:
        return _tell_duration(talk, text, question)  # "how long?"
    ego = talk.scene.ego
    ours = f"we are {ego.length_m:.1f} m long and {ego.width_m:.1f} m wide"
    told = _tell_each(talk, text, question, describe_size)
    if told is None:
        return aside(talk, text, ours)
    return replace(told, reasons=(*told.reasons, ours)) if question.of_us else told  # "is it wider than us?"


def _tell_description(talk: Conversation, text: str, question: Question) -> Answer | None:
    told = _tell_each(talk, text, question, describe_one)
    return told or (tell_goal(talk, text) if question.of_us else None)


def _tell_facing(talk: Conversation, text: str, question: Question) -> Answer | None:
    told = _tell_each(talk, text, question, describe_facing)
    goal = talk.state.goal.target if talk.state.goal is not None else None
    if told is None and goal is not None:
        way = f"at the goal we face {describe_heading(goal.heading_ego_rad)}"
        return aside(talk, text, *_plan_of(talk), way)
    return told or (tell_goal(talk, text) if question.of_us else None)


def _tell_distance(talk: Conversation, text: str, question: Question) -> Answer | None:
    """Tell how far away a vehicle is; the goal, if no other vehicle is named."""
    at_place = {"there", "kerb"} & {*question.kinds}
    if at_place and (told_there := tell_at_place(talk, text, question)):
        return told_there
    way_m = way_to(talk.state.goal)
    of_goal = way_m is not None and not (question.words or question.options)
    things = Things() if of_goal else find_things(talk, replace(question, of_us=question.of_us and way_m is not None))
    told = [describe_one(item, talk.scene) for item in things.items] or [*things.reasons]
    chosen = {step.chosen.item.id for step in talk.state.plan if step.chosen is not None}
    if way_m is not None and (not things.found or things.found[0].item.id in chosen):
        told.append(f"the way to the goal is {way_m:.0f} m")
    return aside(talk, text, *told) if told else unknown(talk, text, "a distance without a goal or a vehicle")


def _tell_duration(talk: Conversation, text: str, question: Question) -> Answer:
    way_m, goal = way_to(talk.state.goal), talk.state.goal
    others = describe_thing(talk, question.words) is not None
    if others or goal is None or way_m is None or goal.pace is not None:
        return unknown(talk, text, "how long it takes, and what others will do")
    return aside(talk, text, describe_way(way_m))


def _tell_motion(talk: Conversation, text: str, question: Question, moving: bool) -> Answer | None:
    """Tell whether a vehicle moves, or stands; what we do, if it is about us."""
    if "which" in question.kinds:
        return _tell_which_move(talk, text, question, moving)
    if "place" in question.kinds:
        return _tell_facing(talk, text, question)  # "where is it going?"
    things = find_things(talk, question)
    if not things.found and not things.reasons:
        return tell_waiting(talk, text, question)
    if len(things.found) != 1:
        return _tell_description(talk, text, question)
    (item,) = things.items
    moves = item.speed_mps is not None and item.speed_mps >= MOVING_MPS
    later = "future" in question.kinds
    asked = not (question.event or later or {"moving", "standing"} <= {*question.kinds})
    answer = ("yes: " if moves == moving else "no: ") if asked and (moves or item.is_standing) else ""
    unknown_then = _BEFORE if question.event else _LATER if later else ()
    return aside(talk, text, f"{answer}{describe_one(item, talk.scene)}", *unknown_then)


def _tell_which_move(talk: Conversation, text: str, question: Question, moving: bool) -> Answer | None:
    """Tell which vehicles move, or stand; None where one is pointed at: "what is it driving at?"."""
    tokens = talk.read(question.words).tokens if question.words else ()
    if any(one.category in POINTING for one in tokens):
        return None
    thing = "" if names_thing(talk, question.words) else "vehicles"
    named = (one.text for one in tokens if one.category not in (WordCategory.AUX, WordCategory.THE))
    words = " ".join(filter(None, ("the", "moving" if moving else "parked", thing, *named)))
    return _tell_found(talk, text, replace(question, words=words))


def _tell_same(talk: Conversation, text: str, question: Question) -> Answer | None:
    """Tell whether a vehicle is one that was spoken of, or that a plan is or was about."""
    state, before = talk.state, talk.meant
    things = find_things(talk, question)
    if before is None or not things.found:
        return aside(talk, text, *things.reasons) if things.reasons else None
    chosen = (step.chosen for plan in (state.plan, *state.earlier) for step in plan)
    known = {one.item.id for one in (before, *chosen) if one is not None}
    same = [one for one in things.items if one.id in known]
    told = describe_one(same[0] if same else before.item, talk.scene)
    return aside(talk, text, f"yes: it is {told}" if same else f"no: we speak of {told}")


def _tell_why(talk: Conversation, text: str, question: Question) -> Answer | None:
    """Tell why we are slow or stand, or the reasons of the plan; of others, what they do and that it is open why."""
    state = [one for one in question.kinds if one in ("slow", "moving", "standing", "facing", "others")]
    if not state:
        return None if describe_thing(talk, question.words) else tell_reasons(talk, text)
    things = Things() if question.of_us else find_things(talk, question)
    if things.found or things.reasons:
        tell = describe_facing if "facing" in state else describe_one
        told = [tell(item, talk.scene) for item in things.items] or things.reasons
        return aside(talk, text, *told, f"{NOT_KNOWN}: why others do so")
    if "facing" in state:
        return _tell_facing(talk, text, question)
    reasoned = "moving" in state and "slow" not in state  # "why are we going there"
    return tell_reasons(talk, text) if reasoned else tell_waiting(talk, text, question)


def _tell_gap(talk: Conversation, text: str, question: Question) -> Answer | None:
    """Tell the gap at the goal, or at the place that is offered."""
    about = talk.state.question or talk.state.goal
    place = None if about is None else about.target or about.plan.nearest
    if names_thing(talk, question.words):
        return tell_room(talk, text, question.words)  # "how big is the gap between the van and the bus?"
    if place is None:
        others = _tell_each(talk, text, question, describe_one)  # "is he too close?", of one behind us
        return others or unknown(talk, text, "a gap without a goal")
    return aside(talk, text, describe_gap(place, talk.scene))


def _tell_safe(talk: Conversation, text: str, question: Question) -> Answer:
    planned = talk.state.goal is not None and talk.state.goal.target is not None
    told = [_KEPT] if planned else []
    return aside(talk, text, *told, f"{NOT_KNOWN}: signs, rules of parking, and what others will do")


def _tell_sure(talk: Conversation, text: str, question: Question) -> Answer | None:
    goal = talk.state.goal
    if goal is None:
        return None
    return aside(talk, text, f"{goal.confidence:.0%} sure", *goal.reasons)


def _tell_spot(talk: Conversation, text: str, question: Question) -> Answer:
    return tell_spot(talk, text, question.words)


def _tell_room(talk: Conversation, text: str, question: Question) -> Answer | None:
    return tell_room(talk, text, question.words)


def _tell_tight(talk: Conversation, text: str, question: Question) -> Answer | None:
    """Tell whether a place is too small: no, if there is room."""
    told = tell_room(talk, text, question.words)
    return replace(told, reasons=tuple(_YES_NO.sub(lambda one: _TURNED[one[0]], one) for one in told.reasons))


def _tell_people(talk: Conversation, text: str, question: Question) -> Answer | None:
    """Tell who is on foot at a place; None if the question names somebody or something else."""
    if names_thing(talk, question.words):
        return None
    placed = f"people {question.words}"
    words = placed if describe_thing(talk, placed) else "people"
    told = _tell_found(talk, text, replace(question, kinds=("exists",), words=words))
    if told is None or "cross" not in text.lower():
        return told
    return replace(told, reasons=(*told.reasons, f"{NOT_KNOWN}: whether anyone is about to cross"))


def _count(talk: Conversation, text: str, question: Question) -> Answer | None:
    reading = describe_thing(talk, question.words)
    return count(talk, text, "", reading) if reading is not None else None


def _tell_found(talk: Conversation, text: str, question: Question) -> Answer | None:
    """Tell which vehicles or people fit a description, and whether any does; the best one is "it" then."""
    asked = talk.state.question
    which = "which" in question.kinds
    if which and asked is not None and asked.question and len(asked.candidates) > 1:
        return ask_again(talk, text)
    if which and not question.words:
        return tell_seen(talk, text)
    if not which and (unmapped := name_unmapped(talk, question.words)):
        return unknown(talk, text, f"'{unmapped}'")
    reading = describe_any(talk, question.words)
    sought = reading.query.referent if reading is not None else None
    if reading is None or sought is None or ("who" in question.kinds and sought.anaphora):
        return None  # also "who's that in the red?", which asks for a person
    plural = any(one.form == "plural" for one in reading.tokens if one.category in DESCRIBING)
    one_only = which and not plural
    here = [] if reading.query.secondary else _all_like(talk, sought)
    if "together" in question.kinds:
        here = [one for one in here if any(one is not other and _are_together(one, other) for other in here)]
    by_it = find_by_it(talk, question.words, reading)
    found = by_it or resolve(replace(reading.query, referent=replace(sought, definite=one_only)), talk.scene)
    likely = [one for one in found.candidates if one.item in here or reading.query.secondary]
    note = _BEFORE if question.event else ()
    if found.status == "not_found" or not (here or likely):
        near = [describe_one(one.item, talk.scene) for one in found.candidates[:1]]
        unsure = found.reasons if found.status == "not_found" else (f"nothing here is certainly '{sought.phrase()}'",)
        return aside(talk, text, *unsure, *near, *note)
    if likely:
        talk.state = replace(talk.state, focus=(likely[0], sought))
    items = [*dict.fromkeys((*(one.item for one in likely[:1]), *here))]
    told = [describe_one(one, talk.scene) for one in items[: 1 if one_only else MAX_CANDIDATES]]
    more = [f"and {len(items) - len(told)} farther away"] if len(items) > len(told) and not one_only else []
    if which and not one_only:
        told = [f"{len(items)} fit '{sought.phrase()}'", *told]
    elif not which and len(items) >= sought.number:
        told[0] = f"yes: {told[0]}"
    return aside(talk, text, *told, *more, *note)


def _all_like(talk: Conversation, sought: Referent) -> list[SceneObject]:
    """Return all objects that fit a description; if some are of its very class or colour, only these."""
    here = list(find_all(replace(sought, definite=True, number=1), talk.scene))
    here = [one for one in here if one.common_name == sought.noun] or here
    return [one for one in here if sought.colour in (talk.scene.colour_name(one) or "").split()] or here


def _are_together(one: SceneObject, other: SceneObject) -> bool:
    """Return whether two objects stand next to each other, in a row or side by side."""
    return float(np.linalg.norm(one.centre_m - other.centre_m)) < _TOGETHER_M


def _tell_what(talk: Conversation, text: str, question: Question) -> Answer | None:
    if question.words:
        return _tell_found(talk, text, question)
    return tell_vehicle(talk, text) if talk.meant is not None else None


def _plan_of(talk: Conversation) -> tuple[str, ...]:
    """Return the plan in force in words; nothing without one."""
    return describe_goal(talk.state.goal) if talk.state.goal is not None else ()


def _tell_case(talk: Conversation, text: str, question: Question) -> Answer:
    anew = "the plan is made anew from what is seen at each moment"
    return aside(talk, text, *_plan_of(talk), f"{NOT_KNOWN}: what will happen; {anew}")


def _tell_plan(talk: Conversation, text: str, question: Question) -> Answer | None:
    return tell_goal(talk, text) if talk.state.goal or talk.state.question or question.of_us else None


def _tell_open(talk: Conversation, text: str, question: Question) -> Answer:
    return keep(talk, text)


_ANSWERS: Mapping[str, _Teller] = {
    "case": _tell_case,
    "why": _tell_why,
    "waiting": tell_waiting,
    "walk": tell_walk,
    "next": tell_next,
    "duration": _tell_duration,
    "count": _count,
    "distance": _tell_distance,
    "measured": _tell_size,
    "tight": _tell_tight,
    "gap": _tell_gap,
    "spot": _tell_spot,
    "room": _tell_room,
    "size": _tell_size,
    "same": _tell_same,
    "coming": tell_coming,
    "description": _tell_description,
    "facing": _tell_facing,
    "safe": _tell_safe,
    "sure": _tell_sure,
    "plan": _tell_plan,
    "exists": _tell_found,
    "moving": partial(_tell_motion, moving=True),
    "standing": partial(_tell_motion, moving=False),
    "place": _tell_description,
    "what": _tell_what,
    "us": _tell_open,
    "which": _tell_what,
}
