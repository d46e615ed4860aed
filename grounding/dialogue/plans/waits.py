"""Waits and conditions of a plan: what is awaited before or after the goal in force, or until we are told to go."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from grounding.answer import Answer
from grounding.dialogue.choices import confirm
from grounding.dialogue.clauses import MARKS, Words
from grounding.dialogue.conversation import Conversation
from grounding.dialogue.fragments import has_verb, is_understood, refers_to_place
from grounding.dialogue.memory import Memory
from grounding.dialogue.merging import names_place
from grounding.dialogue.telling.phrases import said
from grounding.dialogue.telling.reports import aside, notice
from grounding.dialogue.telling.things import find_told
from grounding.language import Reading, WordCategory
from grounding.language.conditions import tells_cases
from grounding.language.questions import asks_car
from grounding.language.replies import words_after_opening, words_end
from grounding.query import Query, Referent
from grounding.requests import HOLDING, STOPS, Request, requests_of
from grounding.vocabulary import LANDMARK_KINDS

_SENTENCE = re.compile(r"(?<=[.!?])\s+(?=\S)")
# Words of "it's" and "they're" before an event, and the event of a vehicle or person that is let through.
_SHORT = ("'s", "'re")
_PASSED = ("has", "passed")
# Events after which who comes is out of our way.
_GONE = ("pass", "leave")
# Pronouns of those in the car.
_OURSELVES = ("i", "we", "you", "us", "me")
# Words that tell an event, and the most of them in a turn: for each of them both sides are read.
_AWAITING, _MAX_JOINTS = ("awaited", "till", "supposed"), 4
# We are at a place that is nearer than this.
_ARRIVED_M = 3.0


@dataclass(frozen=True)
class Awaited:
    """A wait, and what is commanded after it.

    Attributes:
        wait: reading of the wait alone, with its event; None if the event is not understood.
        command: reading of the command; None if the wait is all that is said.
        supposed: whether the event may not come: "if it turns off".
    """

    wait: Reading | None
    command: Reading | None = None
    supposed: bool = False


def answer_wait(talk: Conversation, text: str) -> Answer | None:
    """Answer a turn about when the goal in force is to be reached; None for other turns."""
    if tells_cases(text, talk.grounder.lexicon):
        return None  # "if it moves, follow it, otherwise pass it"
    before = talk.state
    *remarks, last = _SENTENCE.split(text.strip())
    if any(not talk.read(one).problem for one in remarks):
        return None
    for one in remarks:
        notice(talk, one)  # "There's a truck. Wait for it to pass."
    answer = _answer_wait(talk, text, last)
    if answer is None:
        talk.state = before
    return answer


def _answer_wait(talk: Conversation, text: str, last: str) -> Answer | None:
    """Answer the last sentence of a turn."""
    lexicon, steps = talk.grounder.lexicon, talk.state.steps
    words = words_after_opening(last, lexicon)
    if answer := _set_off(talk, text):
        return answer
    if words_end("telling", words, 0) > words_end("retelling", words, 0):
        return _keep(talk, text, "that cannot be done: an answer is given when something is said, and not later")
    if not steps:
        return _await_coming(talk, text, words)
    if (
        answer := _start(talk, text, words)
        or _go_on(talk, last)
        or _hold(talk, text, words_after_opening(last, lexicon, tail=True))
    ):
        return answer
    awaited = None if _only_paces(steps) else _read_awaited(talk, words, text if text.strip() != last else "")
    if awaited is None:
        return None
    agrees = awaited.command is None or _agrees(awaited.command.query, steps)
    if awaited.wait is None and asks_car(last, lexicon):
        return None  # "when do we arrive?"
    if awaited.wait is None:
        goes = agrees and awaited.command is not None and awaited.command.query.action == "other"
        return _keep(talk, text, "what is to be awaited is not understood") if goes else None
    if refers_to_place(talk.read(" ".join(words))):
        return None  # "wait there for my wife": at the goal in force, and not before it
    waits = [_about_meant(talk, one) for one in requests_of(said(awaited.wait, text))]
    if agrees:
        asked = talk.state.question is not None
        answer = talk.take((*waits, *_without(steps, waits)))
        unsettled = any(one.status != "ok" and (asked or one.query.referent) for one in answer.steps[: len(waits)])
        return None if unsettled else answer  # for whom we wait is not asked beside another question
    someone = any(one.query.referent is not None and one.query.referent.noun == "person" for one in waits)
    if awaited.supposed and someone and talk.read(" ".join(words)).condition:
        return None  # "stop if somebody crosses": no one in sight is meant
    if steps[-1].query.action == "follow" and _stops_with(awaited, waits[0]):
        return _keep(talk, text, "to follow it is to stop behind it when it stops")
    if awaited.supposed and awaited.command is not None and awaited.command.query.action not in HOLDING:
        then = [_about_meant(talk, one) for one in requests_of(said(awaited.command, text))]
        return talk.take((*steps, *waits, *then))
    return None


def _keep(talk: Conversation, text: str, why: str) -> Answer:
    """Tell what cannot be done; the goal stays."""
    kept = ("the goal stays as it is",) if talk.state.goal is not None else ()
    return replace(aside(talk, text, why, *kept), status="not_a_command")


def stands(state: Memory) -> bool:
    """Return whether the plan in force is a wait, or a stop at no place that is named: "stop for a moment"."""
    if state.goal is None or state.question is not None:
        return False
    query = state.plan[-1].query if len(state.plan) == 1 else None
    anywhere = query is not None and query.action in ("stop", "pull_over") and not names_place(query)
    lets_by = query is not None and query.action == "give_way"
    return state.goal.pace == "standing" or anywhere or lets_by


def _only_paces(steps: Sequence[Request]) -> bool:
    """Return whether steps ask for no place: "slow down", "wait"."""
    return all(step.query.pace is not None for step in steps)


def _about_meant(talk: Conversation, step: Request) -> Request:
    """Return a step about the vehicle in talk, if it names one by a pronoun only; who comes is to pass."""
    named, tokens = step.query.referent, step.reading.tokens
    plain = step.query.unresolved or (named is not None and not (named.colour or named.qualifiers))
    points = plain and not any(one.category in (WordCategory.NOUN, WordCategory.PERSON) for one in tokens)
    asked = talk.last_told.question.kind if talk.last_told is not None else ""
    coming = find_told(talk) if points and step.query.trigger in _GONE and asked == "coming" else []
    first = talk.state.goal.plan.passes_first if talk.state.goal is not None else None
    coming = [one for one in coming if one.item == first] or coming
    if coming:
        vehicle = Referent(coming[0].item.class_name, coming[0].item.common_name)
        query = replace(step.query, referent=vehicle, landmark="referent", unresolved="")
        return replace(step, chosen=coming[0], reading=step.reading.with_query(query))
    bare = named is not None and named.anaphora and plain
    return replace(step, chosen=talk.meant) if bare and talk.meant is not None else step


def _stops_with(awaited: Awaited, wait: Request) -> bool:
    """Return whether we are to stop when the vehicle that we follow does: "and if it stops, stop too"."""
    command = awaited.command.query if awaited.command is not None else None
    stops = command is not None and command.action in ("stop", "wait") and command.relation == "none"
    return stops and wait.query.trigger == "stop"


def _await_coming(talk: Conversation, text: str, words: Words) -> Answer | None:
    """Wait for who was told to come, where no goal is in force: "wait till it's past"; None for other turns."""
    awaited = _read_awaited(talk, words, "") if talk.state.question is None else None
    if awaited is None or awaited.wait is None:
        return None
    waits = [_about_meant(talk, one) for one in requests_of(said(awaited.wait, text))]
    if any(one.chosen is None for one in waits):
        return None
    then = requests_of(said(awaited.command, text)) if awaited.command is not None else ()
    return talk.take((*waits, *then))


def _without(steps: Sequence[Request], waits: Sequence[Request]) -> list[Request]:
    """Return steps without the waits at the beginning that other waits repeat or replace."""
    left = list(steps)
    while left and left[0].query.action in HOLDING and _is_repeated(left[0], waits):
        left.pop(0)
    return left


def _is_repeated(wait: Request, waits: Sequence[Request]) -> bool:
    """Return whether a wait has no event, or that of another wait for the same vehicle."""
    event, named = wait.query.trigger, wait.query.referent
    same = (one.query.trigger == event and one.query.referent == named for one in waits)
    return event is None or any(same)


def _agrees(query: Query, steps: Sequence[Request]) -> bool:
    """Return whether a command only says "go on", or repeats a step: "turn" while a left turn is in force."""
    if query.excluded or query.manoeuvre not in (None, "onward"):
        return False
    slots = ("relation", "referent", "secondary", "direction", "goal_side", "road_side", "distance_m", "count")
    named = {slot: value for slot in slots if (value := getattr(query, slot)) not in (None, (), "none")}
    if not named and query.action == "other":
        return True
    repeated = (step.query for step in steps if step.query.action == query.action)
    return any(all(getattr(step, slot) == value for slot, value in named.items()) for step in repeated)


# What is awaited ----------------------------------------------------------------------------------------------------


def _read_awaited(talk: Conversation, words: Words, whole: str) -> Awaited | None:
    """Return the wait that a turn asks for; None for other turns. `whole`: the turn, if it says more before."""
    ends = ((start, kind, words_end(kind, words, start)) for start in range(len(words)) for kind in _AWAITING)
    joints = [(start, kind, end) for start, kind, end in ends if end > start]
    for start, kind, end in joints if len(joints) <= _MAX_JOINTS else ():
        before, after = words[:start], words[end:]
        if found := (_read_before if before else _read_after)(talk, kind, before, after):
            return found
    said_first = words[-1:] == ("first",)  # "let him pass first"
    reading = _read(talk, whole or " ".join(words[:-1] if said_first else words))
    wait, *then = [reading.with_query(one) for one in reading.steps]
    waits = wait.query.action in HOLDING and wait.query.relation == "none" and is_understood(reading)
    if not waits or len(then) > 1 or not (wait.query.trigger or wait.query.referent):
        return None
    return Awaited(_with_event(wait), then[0] if then else None)


def _read(talk: Conversation, words: str) -> Reading:
    """Return the reading of words that name a vehicle by itself, else with the one in talk as what they refer to."""
    alone = talk.readings(words, None, alone=False)[0]
    return alone if is_understood(alone) and alone.query.referent is not None else talk.read(words)


def _read_before(talk: Conversation, kind: str, before: Words, after: Words) -> Awaited | None:
    """Return a wait whose event follows the command: "go on when it has passed", "don't turn until it has passed"."""
    command, wait = talk.read(" ".join(before)), _read_event(talk, after)
    if wait is None or not is_understood(command) or not has_verb(command):
        return None
    holds = command.query.action in HOLDING or any(one.category is WordCategory.NOT for one in command.tokens)
    if holds != (kind == "till"):
        return None  # "follow it until it turns"
    return Awaited(wait, None if holds else command, kind == "supposed")


def _read_after(talk: Conversation, kind: str, _: Words, after: Words) -> Awaited | None:
    """Return a wait whose event comes before a command, or alone: "when it has passed, turn", "until it stops"."""
    commanded = None
    for i in range(1, len(after) if kind != "till" else 1):
        rest = words_after_opening(" ".join(after[i:]), talk.grounder.lexicon)
        command = talk.read(" ".join(rest))
        first = next(iter(command.tokens), None)
        if first is None or first.category is not WordCategory.VERB or first.form or not is_understood(command):
            continue
        if wait := _read_event(talk, after[:i]):
            return Awaited(wait, command, kind == "supposed")
        commanded = command
    if kind != "supposed" and (wait := _read_event(talk, after)):
        return Awaited(wait)
    return None if commanded is None else Awaited(None, commanded, kind == "supposed")


def _read_event(talk: Conversation, words: Words) -> Reading | None:
    """Return the reading of a wait for the event of a clause: "it has gone by"; None if it is none."""
    while words and words[-1] in ",.;!?":
        words = words[:-1]
    if not words or words[0] in _OURSELVES:
        return None
    spelled = _spelled_out(words)
    reading = _read(talk, " ".join(("wait", "until", *spelled)))
    query = reading.query
    if query.trigger is None or query.relation != "none" or len(reading.steps) > 1 or not is_understood(reading):
        return None
    unknown = query.referent is None and not query.unresolved
    return reading.with_query(replace(query, unresolved=spelled[0])) if unknown else reading


def _spelled_out(words: Words) -> Words:
    """Return the words of an event without short forms: "he's through" is "he has passed"."""
    full: list[str] = []
    for word in words:
        short = next((one for one in _SHORT if word.endswith(one) and word != one), "")
        full += [word.removesuffix(short), "is"] if short else [word]
    spelled = tuple(full)
    passed = next((i for i in range(1, len(spelled)) if words_end("passed", spelled, i) == len(spelled)), None)
    return spelled if passed is None else (*spelled[:passed], *_PASSED)


def _with_event(reading: Reading) -> Reading:
    """Return a wait for a vehicle with the event that it passes, and for a person that the way is clear."""
    query = reading.query
    if query.trigger is not None:
        return reading
    person = query.referent is not None and query.referent.noun == "person"
    return reading.with_query(replace(query, trigger="clear" if person else "pass"))


# Until the passenger says so ----------------------------------------------------------------------------------------


def _hold(talk: Conversation, text: str, words: Words) -> Answer | None:
    """Stand until the passenger says so, short of what is not to be passed; the goal in force comes after that."""
    end = next((i for i in range(1, len(words)) if words_end("untilword", words, i) == len(words)), None)
    if end is None:
        return None
    reading = talk.read(" ".join(words[:end]))
    query = reading.query
    if (query.action not in HOLDING and query.limit is None) or not is_understood(reading):
        return None
    crossed = [one for one in query.excluded if one.relation is None and one.noun in LANDMARK_KINDS]
    places = [Query.short_of(text, one) for one in crossed] or ([query] if query.relation != "none" else [])
    steps = [Request(reading=reading.with_query(one)) for one in (*places, Query(text, "wait", ("wait",)))]
    kept = () if _only_paces(talk.state.steps) else talk.state.steps
    stops = bool(kept) and kept[-1].query.action in STOPS
    if stops and not places and any(token.event == "leave" for token in reading.tokens):
        return talk.take((*kept, *steps))  # "don't set off until I say so": where the goal is
    return talk.take((*steps, *_without(kept, steps)))


def _set_off(talk: Conversation, text: str) -> Answer | None:
    """Drive on from a stop that has served its purpose: "she's in, let's go"; None for other turns."""
    words = tuple(word for word in words_after_opening(text, talk.grounder.lexicon) if word not in MARKS)
    plan, end, request = talk.state.plan, words_end("aboard", words, 0), talk.state.request
    rest = tuple(word for word in words[end:] if word.isalpha())
    stops = plan[0] if plan else request
    if not (end and rest) or stops is None or stops.query.action not in STOPS:
        return None
    if words_end("starting", rest, 0) < len(rest) and talk.read(" ".join(rest)).query.manoeuvre != "onward":
        return None
    return talk.take_steps(text, plan[1:]) if plan[1:] else talk.take(requests_of(said(talk.read("carry on"), text)))


def _start(talk: Conversation, text: str, words: Words) -> Answer | None:
    """Start the plan in force, with what it waits for: "okay, go"; None without one, and where we only stand.

    A wait until the passenger says so ends by it.
    """
    plan, goal = talk.state.plan, talk.state.goal
    starts = bool(words) and words_end("starting", words, 0) == len(words)
    if goal is None or talk.state.question is not None or not starts:
        return None
    place = goal.target if plan[-1].query.action in STOPS else None
    if place is not None and np.linalg.norm(place.ego_m) < _ARRIVED_M:
        return None  # from there we drive on
    held = any(step.query.action in HOLDING and not _awaits_other(step) for step in plan)
    return None if held or stands(talk.state) else confirm(talk, text)


def _awaits_other(wait: Request) -> bool:
    """Return whether a wait is for a vehicle or a person, and not until a time or a word of the passenger."""
    return wait.query.referent is not None or wait.query.trigger is not None


def _go_on(talk: Conversation, text: str) -> Answer | None:
    """End the wait that is in force, and what comes before it: "ok, go on"; None without one.

    What is awaited by the command of what comes after it stays.
    """
    plan = talk.state.plan
    waits = [i for i, step in enumerate(plan) if step.query.action in HOLDING]
    at = next((i for i in waits if i == 0 or plan[i].query.trigger is None), None)
    if at is None or not plan[at + 1 :]:
        return None
    query = talk.read(text).query
    if query.manoeuvre != "onward" or query.trigger is not None or not _agrees(query, plan):
        return None
    together = plan[at].reading.query.command == plan[at + 1].reading.query.command
    if together and _awaits_other(plan[at]):
        return confirm(talk, text)  # "give way to the bus, then park": "yes, carry on"
    return talk.take_steps(text, plan[at + 1 :])
