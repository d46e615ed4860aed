"""Answers to questions to the car: what is asked is decided by the words, and the scene and the plan answer it."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

from grounding.answer import Answer
from grounding.dialogue.conversation import Conversation
from grounding.dialogue.telling.between import split_two, tell_apart, tell_between, tell_gap_to_us
from grounding.dialogue.telling.comparing import tell_against_us, tell_compared
from grounding.dialogue.telling.follow_ups import follow_up
from grounding.dialogue.telling.found import BEFORE, tell_found
from grounding.dialogue.telling.landmarks import tell_landmarks, tell_ways
from grounding.dialogue.telling.measures import (
    describe_facing,
    describe_gap,
    describe_heading,
    describe_one,
    describe_size,
    describe_way,
    way_to,
)
from grounding.dialogue.telling.options import tell_choice, tell_other
from grounding.dialogue.telling.phrases import describe_goal
from grounding.dialogue.telling.place import is_at_it, tell_at_place, tell_next, tell_walk
from grounding.dialogue.telling.reports import (
    NOT_KNOWN,
    aside,
    count,
    keep,
    tell_goal,
    tell_own_speed,
    tell_reasons,
    tell_vehicle,
    unknown,
)
from grounding.dialogue.telling.room import answer_room, answer_spot, answer_tight, tell_gap_between, tell_room
from grounding.dialogue.telling.stance import (
    names_one_beside_us,
    tell_beside,
    tell_blocking,
    tell_reversing,
    tell_sides,
)
from grounding.dialogue.telling.things import (
    POINTING,
    Things,
    describe_thing,
    find_things,
    names_thing,
)
from grounding.dialogue.telling.traffic import (
    UNSURE,
    tell_coming,
    tell_lane,
    tell_pace,
    tell_safe,
    tell_turning,
    tell_waiting,
)
from grounding.language import WordCategory
from grounding.language.questions import Question, read_question
from grounding.language.replies import says_no
from grounding.referent.scene import SceneModel
from grounding.scene_object import SceneObject

# Kinds that tell what is there; of a choice, each is told.
_FOUND = ("exists", "place", "what", "which")
# Kinds about room at a place.
_OF_ROOM = ("room", "gap", "tight", "spot")
# Kinds that are about the doors, where somebody gets out.
_OF_DOORS = ("room", "gap", "tight", "safe")
# Kinds of a question that only asks whether we move: "are we still standing?"
_OF_OUR_MOTION = {"moving", "standing", "us", "slow"}
# People named by their age, which is not known.
_AGES = re.compile(
    r"\b(?:kids?|child(?:ren)?|toddlers?|teenagers?|elderly|old (?:m[ae]n|lady|ladies|woman|people))\b"
)
# A remark that names a thing, before a question about it: "I need a shot of the red car, where is it?".
_REMARK = re.compile(
    r"^(?P<lead>\w.*? )(?P<thing>(?:the|that|this|those) (?:\w+ ){0,5}?\w+)[,.;:] "
    r"(?P<ask>where(?: is|'s| are)|how far(?: away)? (?:is|are)|what colou?r is|can you see|do you see)"
    r" (?:it|he|she|him|her|they|them)\b(?P<rest>[^,;.]*)$",
    re.IGNORECASE,
)
# The limit of what is known about the future.
_LATER = (f"{NOT_KNOWN}: what others will do",)
_Teller = Callable[[Conversation, str, Question], Answer | None]


def answer_question(talk: Conversation, text: str) -> Answer | None:
    """Answer a question to the car; None for another sentence, and for what only its context tells."""
    text = _with_topic(talk, text)
    question = read_question(text, talk.grounder.lexicon)
    follows = None if question is not None and question.kind else follow_up(talk, text)
    question = follows or question
    if question is None or not question.kind:
        return tell_other(talk, text) if question is None else None
    talk.list_items(())
    refused = talk.state.question is not None and not talk.state.lists and says_no(text, talk.grounder.lexicon)
    if refused:
        talk.state = replace(talk.state, question=None)  # "no, just tell me what is behind it"
    told = _answer(talk, text, question)
    if told is None and follows is not None:
        return unknown(talk, text, "which thing is meant")
    if told is not None and _AGES.search(text.lower()) and any("person" in one for one in told.reasons):
        told = replace(told, reasons=(*told.reasons, f"{NOT_KNOWN}: how old anyone is"))
    if told is not None:
        same = talk.last_told if talk.listed and talk.listed == talk.told_ids() else None
        talk.keep_told(replace(question, words=same.question.words) if same is not None else question)
    return told


def _with_topic(talk: Conversation, text: str) -> str:
    """Return a question about a thing that a remark before it names: "I need a shot of the red car, where is it?"."""
    said = _REMARK.match(text.strip())
    if said is None:
        return text
    reading = talk.read(f"{said['lead']}{said['thing']}")
    commands = reading.query.action not in (None, "other") and not (reading.problem or reading.doubt)
    return text if commands else f"{said['ask']} {said['thing']}{said['rest']}"


def _answer(talk: Conversation, text: str, question: Question) -> Answer | None:
    if "people" in question.kinds and not question.limit and (told := _tell_people(talk, text, question)):
        return told
    if question.kind == "ways":
        return tell_ways(talk, text, question)
    if told := tell_landmarks(talk, text, question):
        return told
    beside = "beside" in question.kinds and question.kind != "gap"  # "how much space will there be in front of us?"
    if (beside or _is_of_place(talk, question)) and (told := tell_beside(talk, text, question)):
        return told
    if "out" in question.kinds and question.kind in _OF_DOORS and (told := tell_sides(talk, text, question)):
        return replace(told, reasons=(*told.reasons, UNSURE)) if question.kind == "safe" else told
    if question.limit:
        return unknown(talk, text, question.limit)
    if told := tell_against_us(talk, text, question):
        return told
    if question.comparative:
        return tell_compared(talk, text, question)
    if question.options and question.kind in _FOUND and not names_thing(talk, question.words):
        return _tell_each(talk, text, question, describe_one)
    answer = _ANSWERS.get(question.kind)  # a kind that only tells more of another one is not asked alone
    return answer(talk, text, question) if answer else None


def _is_of_place(talk: Conversation, question: Question) -> bool:
    """Return whether "it" is the place that the question before was about: "is anything parked behind it?"."""
    last = talk.last_told.question if talk.last_told is not None else None
    points = any(one.category in POINTING for one in talk.read(question.words).tokens) if question.words else False
    return last is not None and last.kind in _OF_ROOM and not last.words and points and question.kind in _FOUND


def _tell_each(
    talk: Conversation, text: str, question: Question, tell: Callable[[SceneObject, SceneModel], str]
) -> Answer | None:
    """Tell a property of each thing that a question is about; None if it is about none."""
    things = find_things(talk, question)
    talk.list_items(things.items)
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
    if split_two(talk, question.words):
        return tell_apart(talk, text, question)  # "how far is the van from the bus?"
    at_place = {"there", "kerb"} & {*question.kinds} or is_at_it(talk, question.words)
    if at_place and (told_there := tell_at_place(talk, text, question)):
        return told_there
    way_m = way_to(talk.state.goal)
    of_goal = way_m is not None and not (question.words or question.options)
    things = Things() if of_goal else find_things(talk, replace(question, of_us=question.of_us and way_m is not None))
    talk.list_items(things.items)
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
        bare = question.of_us and not question.words and {*question.kinds} <= _OF_OUR_MOTION
        known = talk.scene.speed_mps is not None
        return tell_own_speed(talk, text, question, moving) if bare and known else tell_waiting(talk, text, question)
    if "turning" in question.kinds:
        return tell_turning(talk, text, things)
    if len(things.found) != 1:
        return _tell_description(talk, text, question)
    (item,) = things.items
    later = "future" in question.kinds
    asked = not (question.event or later or {"moving", "standing"} <= {*question.kinds})
    asked = asked and (item.is_moving or bool(item.is_standing))
    answer = ("yes: " if item.is_moving == moving else "no: ") if asked else ""
    unknown_then = BEFORE if question.event else _LATER if later else ()
    return aside(talk, text, f"{answer}{describe_one(item, talk.scene)}", *unknown_then)


def _tell_which_move(talk: Conversation, text: str, question: Question, moving: bool) -> Answer | None:
    """Tell which vehicles move, or stand; None where one is pointed at: "what is it driving at?"."""
    tokens = talk.read(question.words).tokens if question.words else ()
    if any(one.category in POINTING for one in tokens):
        return None
    # "Who is parked in front of the truck?"
    placed = any(one.category in (WordCategory.RELATION, WordCategory.WHERE) for one in tokens[:1])
    thing = "" if names_thing(talk, question.words) and not placed else "vehicles"
    named = (one.text for one in tokens if one.category not in (WordCategory.AUX, WordCategory.THE))
    words = " ".join(filter(None, ("the", "moving" if moving else "parked", thing, *named)))
    return tell_found(talk, text, replace(question, words=words))


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
    of_place = place is not None and names_one_beside_us(talk, question.words)
    if place is not None and "sideways" in question.kinds:
        return tell_sides(talk, text, question)
    if "upto" in question.kinds and question.words and not of_place:
        return tell_at_place(talk, text, question) or _tell_distance(talk, text, question)
    if told := tell_gap_to_us(talk, text, question):
        return told
    if told := tell_gap_between(talk, text, question.words):
        return told  # "how big is the gap between the van and the bus?"
    if names_thing(talk, question.words) and not of_place:
        return tell_room(talk, text, question.words)
    if place is None:
        others = _tell_each(talk, text, question, describe_one)  # "is he too close?", of one behind us
        return others or unknown(talk, text, "a gap without a goal")
    return aside(talk, text, describe_gap(place, talk.scene))


def _tell_sure(talk: Conversation, text: str, question: Question) -> Answer | None:
    goal = talk.state.goal
    if goal is None:
        return None
    return aside(talk, text, f"{goal.confidence:.0%} sure", *goal.reasons)


def _tell_people(talk: Conversation, text: str, question: Question) -> Answer | None:
    """Tell who is on foot at a place; None if the question names somebody or something else."""
    if names_thing(talk, question.words):
        return None
    placed = f"people {question.words}"
    words = placed if describe_thing(talk, placed) else "people"
    told = tell_found(talk, text, replace(question, kinds=("exists",), words=words))
    if told is None or "cross" not in text.lower():
        return told
    return replace(told, reasons=(*told.reasons, f"{NOT_KNOWN}: whether anyone is about to cross"))


def _count(talk: Conversation, text: str, question: Question) -> Answer | None:
    reading = describe_thing(talk, question.words)
    return count(talk, text, "", reading) if reading is not None else None


def _tell_what(talk: Conversation, text: str, question: Question) -> Answer | None:
    if question.words:
        return tell_found(talk, text, question)
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
    "speed": tell_own_speed,
    "why": _tell_why,
    "lane": tell_lane,
    "waiting": tell_waiting,
    "walk": tell_walk,
    "next": tell_next,
    "duration": _tell_duration,
    "count": _count,
    "distance": _tell_distance,
    "measured": _tell_size,
    "reverse": tell_reversing,
    "blocking": tell_blocking,
    "verge": tell_blocking,
    "passing": tell_blocking,
    "doors": tell_sides,
    "choice": tell_choice,
    "between": tell_between,
    "apart": tell_apart,
    "pace": tell_pace,
    "tight": answer_tight,
    "gap": _tell_gap,
    "spot": answer_spot,
    "room": answer_room,
    "size": _tell_size,
    "same": _tell_same,
    "coming": tell_coming,
    "description": _tell_description,
    "facing": _tell_facing,
    "safe": tell_safe,
    "sure": _tell_sure,
    "plan": _tell_plan,
    "exists": tell_found,
    "moving": partial(_tell_motion, moving=True),
    "standing": partial(_tell_motion, moving=False),
    "place": _tell_description,
    "what": _tell_what,
    "us": _tell_open,
    "which": _tell_what,
}
