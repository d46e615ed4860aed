"""Answers in words: the goal stays as it is, or is dropped."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from appocc.motion_state import STANDING_MPS
from grounding.answer import Answer
from grounding.describe import describe_object
from grounding.dialogue.conversation import Conversation
from grounding.dialogue.descriptions import any_of, find_fitting, reading_of
from grounding.dialogue.fragments import only_named, read_description
from grounding.dialogue.telling.measures import describe_speed
from grounding.dialogue.telling.phrases import ask, describe_goal, said
from grounding.language import Reading
from grounding.language.problems import ANSWERABLE
from grounding.language.questions import Question, read_question
from grounding.query import Query
from grounding.referent.resolver import MAX_CANDIDATES, find_all, resolve
from grounding.requests import requests_of
from grounding.scene_object import SceneObject

# What neither the scene nor the plan tells.
NOT_KNOWN = "that is not known here"
# What may be asked for in "which cars do you see?"; without one of them, it is about all vehicles.
_SEEN = ("cars", "vans", "trucks", "lorries", "buses", "motorbikes", "bikes", "people", "pedestrians")


def inform(talk: Conversation, text: str, *reasons: str) -> Answer:
    """Return an answer in words; its goal is the one in force."""
    goal = talk.state.goal
    if goal is None:
        return aside(talk, text, *reasons)
    return replace(goal, reading=said(goal.reading, text), reasons=reasons)


def aside(talk: Conversation, text: str, *reasons: str) -> Answer:
    """Return an answer in words that is not about the goal in force, which stays."""
    reading = Reading(Query(text), tokens=talk.read(text).tokens)
    asked = talk.state.question.question if talk.state.question else ""
    return Answer(status="ok", reading=reading, scene=talk.scene, reasons=reasons, question=asked)


def unknown(talk: Conversation, text: str, what: str) -> Answer:
    """Tell openly what neither the scene nor the plan tells."""
    return aside(talk, text, f"{NOT_KNOWN}: {what}")


def tell_own_speed(talk: Conversation, text: str, question: Question, moving: bool | None = None) -> Answer:
    """Tell how fast we are; `moving`: whether the question is if we move, or if we stand; None: neither."""
    speed_mps = talk.scene.speed_mps
    if speed_mps is None:
        return unknown(talk, text, "our own speed")
    moves = abs(speed_mps) >= STANDING_MPS
    said = "" if moving is None else "yes: " if moving == moves else "no: "
    return aside(talk, text, f"{said}we {describe_speed(speed_mps)}")


def tell_goal(talk: Conversation, text: str) -> Answer:
    """Tell the goal in force."""
    goal = talk.state.goal
    if goal is None:
        return ask_again(talk, text) if talk.state.question else inform(talk, text, "nowhere: no command is set")
    return inform(talk, text, *describe_goal(goal))


def tell_reasons(talk: Conversation, text: str) -> Answer:
    """Tell the reasons for the goal in force, or for the question."""
    about = talk.state.question or talk.state.goal
    if about is None:
        return inform(talk, text, "no command is set")
    return inform(talk, text, *(about.reasons or ("it is what the command asks for",)))


def ask_again(talk: Conversation, text: str) -> Answer:
    """Ask the open question again; without one, tell the goal."""
    question = talk.state.question
    if question is None:
        return tell_goal(talk, text) if talk.state.goal else not_understood(talk, text, talk.read(text))
    status = "ambiguous" if question.question else question.status
    return replace(question, status=status, reading=said(question.reading, text))


def keep(talk: Conversation, text: str) -> Answer:
    """Acknowledge a sentence that changes nothing."""
    if talk.state.question is not None and talk.state.question.question:
        return ask_again(talk, text)
    if talk.state.goal is None:
        return not_understood(talk, text, talk.read(text))
    open_ = read_question(text, talk.grounder.lexicon)
    told = "the goal stays as it is" if open_ is None else f"{NOT_KNOWN}; {ANSWERABLE}"
    return replace(aside(talk, text, told), status="not_a_command")


def pause(talk: Conversation, text: str) -> Answer:
    """Acknowledge that the passenger needs a moment."""
    kept = talk.state.question is None and talk.state.goal is not None
    return inform(talk, text, "the goal stays as it is") if kept else keep(talk, text)


def cancel(talk: Conversation, text: str) -> Answer:
    """Drop the goal and the question; the plan can be gone back to."""
    if talk.offer is not None and talk.state.question is talk.offer:  # the goal was never asked about
        talk.state = replace(talk.state, question=None)
        return inform(talk, text, "the goal stays as it is")
    had = talk.state.plan or talk.state.question
    talk.state = replace(talk.state.with_earlier(), plan=(), goal=None, question=None)
    return inform(
        talk, text, "the command is dropped: no goal is set" if had else "no command to drop: no goal is set"
    )


def look_for(talk: Conversation, text: str, words: str, guess: Reading | None = None) -> Answer:
    """Answer whether a vehicle is there; the only one that fits is what "it" refers to then.

    `guess`: the description, where the grammar finds none in the words.
    """
    reading = read_description(words, talk.antecedent, talk.readings) or guess
    if reading is None or reading.query.referent is None:
        return not_understood(talk, text, talk.read(text))
    sought = reading.query.referent
    found = resolve(Query("", referent=sought), talk.scene)
    if found.status == "not_found" or not found.candidates:
        return aside(talk, text, *found.reasons)
    told = [describe_object(one.item, talk.scene) for one in found.candidates]
    if not find_all(sought, talk.scene):
        return aside(talk, text, f"nothing here is certainly '{sought.phrase()}'", told[0])
    if found.status == "ok":
        talk.state = replace(talk.state, focus=(found.candidates[0], sought))
    return aside(talk, text, *told)


def tell_vehicle(talk: Conversation, text: str) -> Answer:
    """Tell what is known of the vehicle that was spoken of last: "what colour is it?"."""
    if talk.meant is None:
        return not_understood(talk, text, talk.read(text))
    return inform(talk, text, f"it is the {describe_object(talk.meant.item, talk.scene)}")


def count(talk: Conversation, text: str, words: str, guess: Reading | None = None) -> Answer:
    """Tell how many vehicles fit a description; "the one" refers to one of them then. `guess` as in `look_for`."""
    reading = read_description(words, talk.antecedent, talk.readings) or guess
    named = reading.query.referent if reading is not None else talk.antecedent  # "how many do you make it?"
    if named is None:
        return not_understood(talk, text, talk.read(text))
    sought = replace(named, definite=True, number=1)
    here = find_all(sought, talk.scene)
    talk.state = replace(talk.state, topic=sought)
    told = [describe_object(item, talk.scene) for item in here[:MAX_CANDIDATES]]
    more = [f"and {len(here) - len(told)} farther away"] if len(here) > len(told) else []
    _offer_all(talk, here)
    talk.list_items(here)
    return aside(talk, text, f"{len(here)} fit '{sought.phrase()}'", *told, *more)


def _offer_all(talk: Conversation, counted: Sequence[SceneObject]) -> None:
    """Ask about all that were counted, if the open question is about some of them: "the last one" is theirs then."""
    question, request = talk.state.question, talk.state.request
    offered = {one.item.id for one in question.candidates} if question is not None else set[str]()
    ids = {item.id for item in counted}
    if request is None or request.query.referent is None or not offered or not offered < ids:
        return
    every = [one for one in resolve(any_of(request.query), talk.scene).candidates if one.item.id in ids]
    if len(every) > len(offered):
        talk.settle(talk.state.asked, ask(every, request.reading, talk.scene))


def tell_seen(talk: Conversation, text: str) -> Answer:
    """Tell which vehicles are in sight, nearest first; of a question with several options, these are meant."""
    question = talk.state.question
    if question is not None and question.question and len(question.candidates) > 1:
        return ask_again(talk, text)
    named = [word for word in re.findall("[a-z]+", text.lower()) if word in _SEEN]
    return count(talk, text, named[0] if named else "vehicles")


def notice(talk: Conversation, words: str) -> None:
    """Remember the only vehicle that fits a sentence without a command ("the van"), for "it" in the next one."""
    if talk.state.question:
        return
    reading = read_description(words, talk.antecedent, talk.readings)
    named = reading.query.referent if reading is not None else only_named(talk.read(words).tokens)
    # "I've driven a cab" is about any cab.
    if named is not None and (named.definite or talk.state.goal is None):
        found = resolve(Query("", referent=replace(named, definite=True)), talk.scene)
        settled = found.status == "ok"
        fitting = found.candidates if settled else find_fitting(reading_of(named), found.candidates, talk.scene)
        if fitting and (settled or len(fitting) == 1):
            talk.state = replace(talk.state, focus=(fitting[0], named))


def remember(talk: Conversation, text: str) -> Answer:
    """Acknowledge a remark, and remember the vehicle in it: "my friend lives by the silver van"."""
    notice(talk, text)
    return keep(talk, text)


def not_understood(talk: Conversation, text: str, reading: Reading, words: str = "") -> Answer:
    """Return that a sentence is no command; an open question stays open. A language model may read `words`."""
    if words:
        notice(talk, words)
    reasons = (reading.problem.message, *reading.notes) if reading.problem else reading.notes
    problem = reading if reading.problem else talk.readings(text, alone=False)[0]
    question = talk.state.question
    answer = Answer(
        status="not_a_command",
        reading=problem,
        scene=talk.scene,
        reasons=reasons,
        question=question.question if question else "",
    )
    checked = talk.grounder.check(words, reading, answer) if words else answer
    if checked.alternatives:
        talk.state = replace(talk.state, question=checked, asked=requests_of(checked.reading), at=0)
    return checked
