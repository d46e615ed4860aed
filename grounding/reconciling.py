"""Compare the answers of two readings of a sentence: one of them, or the question which is meant."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from grounding.answer import Answer, pick
from grounding.describe import describe_step


def reconcile(answer: Answer, rival: Answer) -> Answer:
    """Return an answer that another reading of the sentence confirms, else the question which of the two is meant."""
    answer, *_ = answer.alternatives or (answer,)
    rival, *_ = rival.alternatives or (rival,)
    if _means_the_same(answer, rival):
        return replace(answer, reasons=(*answer.reasons, "the language model reads the same"))
    options = tuple(one for one in (answer, rival) if one.status != "not_a_command")
    phrases = " or ".join(f"'{describe_step(one.query, one.referent, one.scene)}'" for one in options)

    asked = Answer(
        status="ambiguous",
        reading=options[0].reading,
        scene=answer.scene,
        reasons=("the grammar and the language model read the sentence differently",),
        question=f"do you mean {phrases}?",
        alternatives=options,
        dropped=answer.dropped,
    )
    return replace(asked, chooser=partial(pick, asked.alternatives, name="reading"))


def _means_the_same(answer: Answer, other: Answer) -> bool:
    """Return whether two answers have the same action, relation, side and vehicle."""
    if (answer.query.action, answer.query.relation) != (other.query.action, other.query.relation):
        return False
    if (answer.query.goal_side, answer.query.direction) != (other.query.goal_side, other.query.direction):
        return False
    ids = [one.referent.item.id if one.referent else None for one in (answer, other)]
    return answer.status == other.status and ids[0] == ids[1]
