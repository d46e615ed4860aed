"""What an answer to a sentence shows: that it was not understood, insists on an offer, or names no place."""

from __future__ import annotations

from grounding.answer import Answer
from grounding.dialogue.memory import Memory
from grounding.dialogue.merging import names_place
from grounding.language.revised_readings import evidence_of

# Relations of a wish that names no place of its own.
_ANYWHERE = ("none", "near")


def insists(answer: Answer, before: Memory, after: Memory) -> bool:
    """Return whether a wish comes to the question again that is open: who repeats it agrees to what is offered."""
    asked, again = before.question, after.question
    if asked is None or again is None or again is asked or again is not answer or not again.plan.question:
        return False
    if again.query.relation not in (asked.query.relation, *_ANYWHERE):
        return False  # "then after the van" is another place, at which there is no room either
    about = [one.referent.item.id if one.referent else None for one in (asked, again)]
    return asked.plan.question == again.plan.question and about[0] == about[1]


def is_misunderstood(answer: Answer) -> bool:
    """Return whether an answer is a failure to understand: a doubt, no command, or unused words and no result."""
    reading = answer.reading
    if answer.status == "ambiguous":
        return bool(reading.doubt)
    unmapped = answer.query.landmark == "secondary" and answer.query.action is not None  # "take me to the airport"
    failed = answer.status != "ok" and not answer.plan.refused and not unmapped
    return failed and bool(reading.problem or reading.dropped)


def names_no_place(answer: Answer) -> bool:
    """Return whether half understood words that name no place have an effect: "I'll close my eyes a minute"."""
    placed = names_place(answer.query) or answer.query.manoeuvre is not None
    acts = answer.target is not None or answer.pace == "standing"
    return acts and not placed and not evidence_of(answer.reading).whole
