"""Answers about others on our way: who comes towards us, and who holds us up."""

from __future__ import annotations

from dataclasses import replace

from grounding.answer import Answer
from grounding.dialogue.conversation import Conversation
from grounding.dialogue.telling.measures import approaches, describe_one, find_in_lane
from grounding.dialogue.telling.phrases import describe_goal
from grounding.dialogue.telling.reports import aside
from grounding.dialogue.telling.things import describe_any, find_things
from grounding.language.questions import Question
from grounding.query import Referent
from grounding.referent.resolver import MAX_CANDIDATES, find_all


def tell_coming(talk: Conversation, text: str, question: Question) -> Answer:
    """Tell whether anyone drives towards us, and who; all of them stay as they are in the conversation."""
    reading = describe_any(talk, question.words)
    named = reading.query.referent if reading is not None else None
    here = find_all(named or Referent("vehicle", "vehicle"), talk.scene)
    told = [describe_one(one, talk.scene) for one in here if approaches(one)][:MAX_CANDIDATES]
    return aside(talk, text, *(["yes", *told] if told else ["no: nothing that is seen comes towards us"]))


def tell_waiting(talk: Conversation, text: str, question: Question) -> Answer:
    """Tell what holds us up: who is ahead in our lane, and what the plan waits for."""
    if (
        question.kind == "waiting"
        and "which" not in question.kinds
        and (told_of := _tell_in_way(talk, text, question))
    ):
        return told_of
    in_lane, goal = find_in_lane(talk.scene), talk.state.goal
    ahead = in_lane[0] if in_lane else None
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


def _tell_in_way(talk: Conversation, text: str, question: Question) -> Answer | None:
    """Tell whether the vehicles that a question names are ahead in our lane; None if it names none."""
    things = find_things(talk, replace(question, of_us=True))
    held = find_in_lane(talk.scene)
    told = [
        f"yes: {describe_one(one, talk.scene)}"
        if one in held
        else f"no: {describe_one(one, talk.scene)}, not ahead in our lane"
        for one in things.items
    ]
    return aside(talk, text, *(told or things.reasons)) if told or things.reasons else None
