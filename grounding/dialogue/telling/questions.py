"""Answers to questions to the car: what is asked is decided by the words, and the scene and the plan answer it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from appocc.motion_state import MOVING_MPS
from grounding.answer import Answer
from grounding.dialogue.conversation import Conversation
from grounding.dialogue.fragments import only_named, read_description
from grounding.dialogue.telling.measures import (
    describe_facing,
    describe_gap,
    describe_heading,
    describe_one,
    describe_size,
    describe_way,
    find_ahead,
    way_to,
)
from grounding.dialogue.telling.phrases import describe_goal
from grounding.dialogue.telling.reports import (
    NOT_KNOWN,
    aside,
    ask_again,
    count,
    keep,
    propose,
    tell_goal,
    tell_reasons,
    tell_room,
    tell_seen,
    tell_vehicle,
    unknown,
)
from grounding.language import Reading, WordCategory
from grounding.language.questions import Question, read_question
from grounding.query import Query, Referent
from grounding.referent.resolver import MAX_CANDIDATES, Candidate, find_all, resolve
from grounding.referent.scene import SceneModel
from grounding.requests import Request
from grounding.scene_object import SceneObject

# Most vehicles that are told of where the words fit several.
_MOST_TOLD = 3
# Centres of vehicles next to each other are at most this far apart.
_TOGETHER_M = 8.0
# What holds of every place that is found.
_KEPT = "the place is on the road, and clear of all vehicles that are seen"
# Words that describe a thing, besides its place.
_DESCRIBING = (
    *(WordCategory.NOUN, WordCategory.MAKE, WordCategory.MODEL, WordCategory.PERSON, WordCategory.COLOUR),
    *(WordCategory.ONE, WordCategory.SUPERLATIVE, WordCategory.ORDINAL),
)
_BEFORE = (f"{NOT_KNOWN}: what it did before",)
_Teller = Callable[[Conversation, str, Question], Answer | None]


@dataclass(frozen=True, eq=False)
class _Things:
    """The vehicles and people that a question is about.

    Attributes:
        found: they, best first.
        reasons: why there is none.
    """

    found: tuple[Candidate, ...] = ()
    reasons: tuple[str, ...] = ()

    @property
    def items(self) -> list[SceneObject]:
        """The objects."""
        return [one.item for one in self.found]


def answer_question(talk: Conversation, text: str) -> Answer | None:
    """Answer a question to the car; None for another sentence, and for what only its context tells."""
    question = read_question(text, talk.grounder.lexicon)
    if question is None or not question.kind:
        return None
    if question.limit:
        return unknown(talk, text, question.limit)
    answer = _ANSWERS.get(question.kind)  # a kind that only tells more of another one is not asked alone
    return answer(talk, text, question) if answer else None


def _names(talk: Conversation, words: str) -> bool:
    """Return whether some words describe a thing by more than a pronoun or a place."""
    return bool(words) and any(one.category in _DESCRIBING for one in talk.read(words).tokens)


def _describe(talk: Conversation, words: str) -> Reading | None:
    """Return the description of a thing in some words; None if they describe none: a pronoun, or a place alone."""
    if not _names(talk, words):
        return None
    # "What vans are there?" after "the yellow van": a noun is not like what was spoken of, "the red one" is.
    nouns = any(one.category in (WordCategory.NOUN, WordCategory.PERSON) for one in talk.read(words).tokens)
    if reading := read_description(words, None if nouns else talk.antecedent, talk.readings):
        return reading
    named = only_named(talk.read(words).tokens)  # "it the blue car"
    return None if named is None else Reading(Query("", referent=named))


def _describe_place(talk: Conversation, words: str) -> Reading | None:
    """Return the description of vehicles at a place: "in front of us"; None for other words."""
    reading = _describe(talk, f"vehicles {words}")
    named = reading.query.referent if reading is not None else None
    placed = reading is not None and (reading.query.secondary or (named is not None and named.qualifiers))
    return reading if placed else None


def _describe_any(talk: Conversation, words: str) -> Reading | None:
    """Return the description of a thing, or of vehicles at a place: "in front of the bus" is no bus."""
    tokens = talk.read(words).tokens if words else ()
    placed = any(one.category in (WordCategory.RELATION, WordCategory.WHERE) for one in tokens[:1])
    first = _describe_place(talk, words) if placed else _describe(talk, words)
    return first or (_describe(talk, words) if placed else _describe_place(talk, words))


def _find(talk: Conversation, question: Question) -> _Things:
    """Find what a question is about: a vehicle that it describes, else the one that is spoken of."""
    reading = _describe(talk, question.words)
    if reading is None:
        tokens = talk.read(question.words).tokens if question.words else ()
        points = any(one.category in (WordCategory.PRONOUN, WordCategory.THAT) for one in tokens)
        of_us = question.of_us and not points
        return _Things() if of_us or talk.meant is None else _Things((talk.meant,))
    spoken_of = None if reading.query.secondary else talk.in_focus(reading.query)
    if spoken_of is not None:
        return _Things((spoken_of,))
    found = resolve(reading.query, talk.scene)
    if found.status == "not_found" or not found.candidates:
        return _Things(reasons=found.reasons)
    if found.status == "ambiguous" and len(found.candidates) == 1:
        sought = reading.query.referent
        unsure = f"nothing here is certainly '{sought.phrase() if sought else question.words}'"
        return _Things(reasons=(unsure, describe_one(found.candidates[0].item, talk.scene)))
    several = found.status == "ambiguous"
    things = found.candidates[: _MOST_TOLD if several else 1]
    if not several and reading.query.referent is not None:
        talk.state = replace(talk.state, focus=(things[0], reading.query.referent))
    return _Things(tuple(things))


def _tell_each(
    talk: Conversation, text: str, question: Question, tell: Callable[[SceneObject, SceneModel], str]
) -> Answer | None:
    """Tell a property of each thing that a question is about; None if it is about none."""
    things = _find(talk, question)
    told = [tell(item, talk.scene) for item in things.items] or things.reasons
    return aside(talk, text, *told) if told else None


def _tell_size(talk: Conversation, text: str, question: Question) -> Answer | None:
    if not question.words and not question.of_us and way_to(talk.state.goal) is not None:
        return _tell_duration(talk, text, question)  # "how long?"
    ego = talk.scene.ego
    told = _tell_each(talk, text, question, describe_size)
    return told or aside(talk, text, f"we are {ego.length_m:.1f} m long and {ego.width_m:.1f} m wide")


def _tell_description(talk: Conversation, text: str, question: Question) -> Answer | None:
    told = _tell_each(talk, text, question, describe_one)
    return told or (tell_goal(talk, text) if question.of_us else None)


def _tell_facing(talk: Conversation, text: str, question: Question) -> Answer | None:
    told = _tell_each(talk, text, question, describe_facing)
    goal = talk.state.goal.target if talk.state.goal is not None else None
    if told is None and goal is not None:
        return aside(talk, text, f"at the goal we face {describe_heading(goal.heading_ego_rad)}")
    return told


def _tell_distance(talk: Conversation, text: str, question: Question) -> Answer | None:
    """Tell how far away a vehicle is; the goal, if no other vehicle is named."""
    way_m = way_to(talk.state.goal)
    things = _Things() if way_m is not None and not question.words else _find(talk, question)
    told = [describe_one(item, talk.scene) for item in things.items] or [*things.reasons]
    chosen = {step.chosen.item.id for step in talk.state.plan if step.chosen is not None}
    if way_m is not None and (not things.found or things.found[0].item.id in chosen):
        told.append(f"the way to the goal is {way_m:.0f} m")
    return aside(talk, text, *told) if told else unknown(talk, text, "a distance without a goal or a vehicle")


def _tell_duration(talk: Conversation, text: str, question: Question) -> Answer:
    way_m, goal = way_to(talk.state.goal), talk.state.goal
    others = _describe(talk, question.words) is not None
    if others or goal is None or way_m is None or goal.pace is not None:
        return unknown(talk, text, "how long it takes, and what others will do")
    return aside(talk, text, describe_way(way_m))


def _tell_motion(talk: Conversation, text: str, question: Question, moving: bool) -> Answer | None:
    """Tell whether a vehicle moves, or stands; what we do, if it is about us."""
    if "which" in question.kinds:
        return None
    things = _find(talk, question)
    if not things.found and not things.reasons:
        return _tell_waiting(talk, text, question)
    if len(things.found) != 1:
        return _tell_description(talk, text, question)
    (item,) = things.items
    moves = item.speed_mps is not None and item.speed_mps >= MOVING_MPS
    known = not question.event and (moves or item.is_standing)
    answer = ("yes: " if moves == moving else "no: ") if known else ""
    return aside(talk, text, f"{answer}{describe_one(item, talk.scene)}", *(_BEFORE if question.event else ()))


def _tell_same(talk: Conversation, text: str, question: Question) -> Answer | None:
    """Tell whether a vehicle is one that was spoken of, or that a plan is or was about."""
    state, before = talk.state, talk.meant
    things = _find(talk, question)
    if before is None or not things.found:
        return aside(talk, text, *things.reasons) if things.reasons else None
    chosen = (step.chosen for plan in (state.plan, *state.earlier) for step in plan)
    known = {one.item.id for one in (before, *chosen) if one is not None}
    same = [one for one in things.items if one.id in known]
    told = describe_one(same[0] if same else before.item, talk.scene)
    return aside(talk, text, f"yes: it is {told}" if same else f"no: we speak of {told}")


def _tell_waiting(talk: Conversation, text: str, question: Question) -> Answer:
    """Tell what holds us up: who is ahead in our lane, and what the plan waits for."""
    ahead, goal = find_ahead(talk.scene), talk.state.goal
    here = "nothing is seen ahead of us in our lane"
    told = [here if ahead is None else f"ahead of us: {describe_one(ahead, talk.scene)}"]
    waits = goal is not None and any(one.pace == "standing" for one in (goal, *goal.steps))
    if goal is None:
        told.append("no command is set")
    elif waits:
        told += describe_goal(goal)
    elif ahead is None:
        told.append("nothing that is seen holds us up")
    return aside(talk, text, *told)


def _tell_why(talk: Conversation, text: str, question: Question) -> Answer | None:
    """Tell why we are slow or stand, or the reasons of the plan; of others, what they do and that it is open why."""
    state = [one for one in question.kinds if one in ("slow", "moving", "standing", "facing")]
    if not state:
        return None if _describe(talk, question.words) else tell_reasons(talk, text)
    things = _Things() if question.of_us else _find(talk, question)
    if things.found or things.reasons:
        tell = describe_facing if "facing" in state else describe_one
        told = [tell(item, talk.scene) for item in things.items] or things.reasons
        return aside(talk, text, *told, f"{NOT_KNOWN}: why others do so")
    if "facing" in state:
        return _tell_facing(talk, text, question)
    reasoned = "moving" in state and "slow" not in state  # "why are we going there"
    return tell_reasons(talk, text) if reasoned else _tell_waiting(talk, text, question)


def _tell_gap(talk: Conversation, text: str, question: Question) -> Answer | None:
    """Tell the gap at the goal, or at the place that is offered."""
    about = talk.state.question or talk.state.goal
    place = None if about is None else about.target or about.plan.nearest
    if _names(talk, question.words):
        return tell_room(talk, text, question.words)  # "how big is the gap between the van and the bus?"
    if place is None:
        return unknown(talk, text, "a gap without a goal")
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
    return propose(talk, text, [Request(reading=Reading(Query(text, "park", ("park",))))])


def _tell_room(talk: Conversation, text: str, question: Question) -> Answer | None:
    return tell_room(talk, text, question.words)


def _count(talk: Conversation, text: str, question: Question) -> Answer | None:
    reading = _describe(talk, question.words)
    return count(talk, text, "", reading) if reading is not None else None


def _tell_found(talk: Conversation, text: str, question: Question) -> Answer | None:
    """Tell which vehicles or people fit a description, and whether any does; the best one is "it" then."""
    asked = talk.state.question
    which = "which" in question.kinds
    if which and asked is not None and asked.question and len(asked.candidates) > 1:
        return ask_again(talk, text)
    if which and not question.words:
        return tell_seen(talk, text)
    reading = _describe_any(talk, question.words)
    sought = reading.query.referent if reading is not None else None
    if reading is None or sought is None or ("who" in question.kinds and sought.anaphora):
        return None  # also "who's that in the red?", which asks for a person
    plural = any(one.form == "plural" for one in reading.tokens if one.category in _DESCRIBING)
    one_only = which and not plural
    here = [] if reading.query.secondary else _all_like(talk, sought)
    if "together" in question.kinds:
        here = [one for one in here if any(one is not other and _are_together(one, other) for other in here)]
    found = resolve(replace(reading.query, referent=replace(sought, definite=one_only)), talk.scene)
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


def _tell_plan(talk: Conversation, text: str, question: Question) -> Answer | None:
    return tell_goal(talk, text) if talk.state.goal or talk.state.question else None


def _tell_open(talk: Conversation, text: str, question: Question) -> Answer:
    return keep(talk, text)


_ANSWERS: Mapping[str, _Teller] = {
    "why": _tell_why,
    "waiting": _tell_waiting,
    "duration": _tell_duration,
    "count": _count,
    "distance": _tell_distance,
    "gap": _tell_gap,
    "spot": _tell_spot,
    "room": _tell_room,
    "size": _tell_size,
    "same": _tell_same,
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
