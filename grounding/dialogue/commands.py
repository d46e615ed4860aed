"""Commands in a conversation: whole sentences with a verb, and first ones without."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from grounding.answer import Answer
from grounding.dialogue.changes import drop_steps, replace_step
from grounding.dialogue.choices import confirm
from grounding.dialogue.clauses import says
from grounding.dialogue.conversation import Conversation
from grounding.dialogue.descriptions import each_step, find_fitting, widen
from grounding.dialogue.fragments import is_understood, keep_action, names_pronoun, points, refers_to_place
from grounding.dialogue.merging import merge_request, names_gap_only
from grounding.dialogue.places.shifts import shift_more
from grounding.dialogue.telling.phrases import said
from grounding.dialogue.telling.reports import ask_again, inform, not_understood, notice
from grounding.dialogue.turns import Turn
from grounding.language import Reading, WordCategory
from grounding.language.replies import Reply
from grounding.language.revised_readings import evidence_of
from grounding.query import Query, Referent
from grounding.referent.ordinals import find_ordinals
from grounding.referent.resolver import Candidate
from grounding.requests import STOPS, Request, requests_of
from grounding.vocabulary import PERSON_NOUNS, Action

# Replies that open a sentence and change nothing.
_OPENING = frozenset(("yes", "thanks", "pause", "meant"))
# A person who is spoken of gets in.
_PICK_UP = re.compile(r"\b(?:pick|collect|fetch|get) (?:him|her|them)\b", re.IGNORECASE)
# Actions that are about a vehicle.
_OF_VEHICLES = ("follow", "overtake", "drive_past", "approach", "avoid")


def answer_command(
    talk: Conversation,
    text: str,
    words: str,
    then: bool = False,
    agreed: bool = False,
    edits: bool = False,
    turn: Turn | None = None,
) -> Answer:
    """Answer a command.

    Args:
        talk: the conversation.
        text: the sentence.
        words: the command in it.
        then: whether it is a further step of the plan in force.
        agreed: whether it is about the first candidate.
        edits: whether it corrects the step of the same action.
        turn: the turn by its reader, if that takes it for a command.
    """
    state, grounder = talk.state, talk.grounder
    readings = talk.readings(words, talk.antecedent, alone=talk.is_opening and words == text)
    if not is_understood(readings[0]) and not names_pronoun(readings[0]):
        alone = talk.readings(words)  # with the network, which reads sentences that stand alone
        readings = readings if alone[0].problem or alone[0].query.unresolved else alone
    if turn is not None:
        readings = (turn.as_command(readings[0]), *readings[1:])
    if readings[0].problem:
        return not_understood(talk, text, readings[0], words)
    there = _stop_there(talk, spoken := said(readings[0], text)) or _wait_there(talk, spoken)
    if there is not None:
        return there
    base = state.request
    readings = tuple(keep_action(said(one, text), base.query if base else None) for one in readings)
    readings = tuple(each_step(widen(one, talk.scene), lambda step: _about_focus(talk, step)) for one in readings)
    first = readings[0]
    if names_pronoun(first) and not first.condition:
        if state.question is not None and len(state.question.candidates) > 1 and not agreed:
            return ask_again(talk, text)
        repeated = _done_before(talk, text, first)
        # "Stay behind": not what was only asked about.
        aimed = repeated or (talk.aimed_at if not points(first.tokens) else None)
        if aimed is not None:
            if first.query.action == "avoid" and aimed.query.action == "follow":
                return shift_more(talk, text, 1.0)  # "keep a safe gap"
            named = aimed.query.referent
            first = each_step(first, lambda step: replace(step, referent=named) if step.referent else step)
            return talk.take([_at(aimed.chosen, one) for one in requests_of(first)], then)
        if talk.meant is not None:
            steps = (one if _is_another(talk, one) else _at(talk.meant, one) for one in requests_of(first))
            return talk.take(list(steps), then)
    elif (
        state.question is not None
        and first.query.referent is not None
        and first.query.referent.anaphora
        and (fitting := find_fitting(first, state.question.candidates, talk.scene))
    ):
        return talk.narrow(fitting, Request(reading=first))
    answer = grounder.check(words, first, grounder.best_answer(readings))
    if answer.alternatives:
        talk.state = replace(state, question=answer, offered=(), asked=requests_of(answer.reading), at=0)
        return answer
    if refers_to_place(first) and state.question is not None and state.question.status == "ambiguous":
        return confirm(talk, text)  # "is there room behind it?" "Then park there."
    if refers_to_place(first) and state.plan:
        return talk.take((*state.plan[:-1], merge_request(state.plan[-1], first.query)))
    if base is not None and not then and names_gap_only(first.query):  # "leave three metres"
        gap = replace(first.query, action=None)
        return talk.take(state.with_request(merge_request(base, gap)))
    if forbidden := _forbidden_action(state.plan, first):
        return drop_steps(talk, text, forbidden)
    asks = answer.status == "ambiguous" and not state.question
    if asks and (again := talk.in_focus(first.query)):
        return talk.take([replace(requests_of(answer.reading)[-1], chosen=again)], then)
    if _is_careful(first) and state.goal is not None and not then:  # "don't splash her"
        return keep_clear(talk, text, words)
    if edits and not then and (edited := replace_step(talk, requests_of(answer.reading))):
        return edited
    return talk.take(requests_of(answer.reading), then, answer)


def _at(vehicle: Candidate | None, step: Request) -> Request:
    """Return a step with a settled vehicle, if it names one: "pass it and keep going"."""
    return replace(step, chosen=vehicle) if step.query.referent is not None else step


def _done_before(talk: Conversation, text: str, reading: Reading) -> Request | None:
    """Return the earlier step that is asked for again: "follow it again", "do follow him after all"."""
    state, asked = talk.state, (reading.query.action, reading.query.relation)
    in_force = any(step.query.action == reading.query.action for step in state.plan)
    if state.question is not None or in_force or not says("afterall", text):
        return None
    before = (step for plan in state.earlier for step in plan if step.chosen is not None)
    return next((one for one in before if (one.query.action, one.query.relation) == asked), None)


def _is_another(talk: Conversation, step: Request) -> bool:
    """Return whether a step describes another vehicle than that in talk: "wait for it, then pass the white one"."""
    named, known = step.query.referent, talk.antecedent
    if named is None or known is None or not (named.colour or named.qualifiers):
        return False
    return (named.colour, named.qualifiers) != (known.colour, known.qualifiers)


def keep_clear(talk: Conversation, text: str, words: str) -> Answer:
    """Keep the goal: nobody is hindered or touched on the way to it."""
    notice(talk, words)
    return inform(talk, text, "the goal stays as it is: we keep clear of others on the way")


def forbids_hindering(talk: Conversation, reply: Reply) -> bool:
    """Return whether a turn only forbids to hinder somebody while a goal is in force: "but don't block the bus"."""
    if talk.state.goal is None or talk.state.question is not None or not {*reply.kinds} <= _OPENING:
        return False
    reading = talk.read(reply.rest)
    forbids = any(token.category is WordCategory.NOT for token in reading.tokens)
    return forbids and _is_careful(reading) and is_understood(reading) and reading.query.distance_m is None


def _is_careful(reading: Reading) -> bool:
    """Return whether a command asks for no more than to keep clear of somebody."""
    return reading.query.action == "avoid" and reading.query.relation == "none" and len(reading.steps) == 1


def _stop_there(talk: Conversation, reading: Reading) -> Answer | None:
    """Keep the place of the goal and add what comes after it: "drop me there and then turn left"; None for others."""
    stops, *further = requests_of(reading)
    plan = talk.state.plan
    if not (further and plan) or stops.query.action not in STOPS or not refers_to_place(stops.reading):
        return None
    return talk.take((*plan[:-1], merge_request(plan[-1], stops.query), *further))


def _wait_there(talk: Conversation, reading: Reading) -> Answer | None:
    """Keep the place of the goal for a wait at it, and add what comes after; None for other sentences.

    "Wait there for my wife", "stay there for five minutes and then carry on".
    """
    plan, (first, *_) = talk.state.plan, reading.steps
    if not plan or first.action != "wait" or not refers_to_place(reading.with_query(first)):
        return None
    wait, *others = requests_of(reading)
    further = [one for one in others if one.query.action != "wait"]
    last = plan[-1]
    notes = tuple(one for one in reading.notes if one not in last.reading.notes)
    told = replace(last.reading, notes=(*last.reading.notes, *notes), dropped=reading.dropped)
    stop = replace(last, reading=said(told, reading.query.command))
    waits = (replace(wait, reading=wait.reading.with_query(Query(reading.query.command, "wait", ("wait",)))),)
    return talk.take((*plan[:-1], stop, *(waits if further else ()), *further))


def _about_focus(talk: Conversation, query: Query) -> Query:
    """Return a query with the vehicle spoken of, where it names none, or one of those counted: "the last one"."""
    counted, one = talk.state.topic, query.referent
    if counted is not None and one is not None and one.anaphora and find_ordinals(one.qualifiers):
        of_all = tuple(word for word in counted.qualifiers if word not in one.qualifiers)
        return replace(query, referent=replace(one, qualifiers=(*of_all, *one.qualifiers)))
    near_it = query.relation == "near" and query.landmark is None  # "stop as near as you can"
    named = query.referent or query.secondary or query.unresolved or (query.relation != "none" and not near_it)
    if named or talk.antecedent is None:
        return query
    meant = replace(talk.antecedent, anaphora=True)
    picks_up = query.action in STOPS and meant.noun in PERSON_NOUNS and _PICK_UP.search(query.command)
    if near_it or picks_up:
        return replace(query, referent=meant, landmark="referent")
    return replace(query, referent=meant) if query.action in _OF_VEHICLES else query


def ask_to_stop(talk: Conversation, text: str, words: str) -> Answer | None:
    """Ask whether a first sentence without a verb asks for a stop: "the yellow one"; None if it names no vehicle."""
    for command in (f"stop near {words}", f"stop near the {words}", f"stop {words}"):
        reading = talk.readings(command, Referent("vehicle", "one"))[0]
        if is_understood(reading) and reading.query.referent is not None:
            doubted = replace(reading, doubt=f"do you mean '{command}'?")
            answer = talk.grounder.check(text, doubted, talk.grounder.best_answer((doubted,)))
            talk.state = replace(talk.state, question=answer, asked=requests_of(reading), at=0)
            return answer
    return None


def _forbidden_action(plan: Sequence[Request], reading: Reading) -> Action | None:
    """Return the action of a step that a sentence only forbids, None for any other: "don't overtake it"."""
    query = reading.query
    forbids = evidence_of(reading).contrary  # also "stop following it"
    if query.action != "other" or query.referent is not None or not forbids:
        return None
    verbs = {token.value for token in reading.tokens if token.category is WordCategory.VERB}
    return next((step.query.action for step in plan if step.query.action in verbs), None)
