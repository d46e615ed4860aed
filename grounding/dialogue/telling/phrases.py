"""Questions and descriptions of goals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from grounding.answer import Answer
from grounding.language import Reading
from grounding.referent.clarification import compose_question, describe_differences
from grounding.referent.resolver import Candidate
from grounding.referent.scene import SceneModel


def ask(candidates: Sequence[Candidate], reading: Reading, scene: SceneModel) -> Answer:
    """Return the question which of several candidates is meant."""
    groups = [(one.item,) if one.partner is None else (one.item, one.partner) for one in candidates]
    differences = describe_differences(groups, scene)
    question = compose_question(differences) if len(groups) > 1 else f"do you mean {differences[0]}?"
    return Answer(
        status="ambiguous",
        reading=reading,
        scene=scene,
        candidates=tuple(candidates),
        reasons=(f"{len(candidates)} are left",) if len(candidates) > 1 else (),
        question=question,
    )


def describe_goal(goal: Answer) -> tuple[str, ...]:
    """Return sentences that tell the goal of an answer: each step with its action, relation and vehicle."""
    steps = goal.steps or (goal,)
    if len(steps) == 1:
        return (goal.step_text(),)
    return tuple(f"step {number}: {step.step_text()}" for number, step in enumerate(steps, start=1))


def said(reading: Reading, text: str) -> Reading:
    """Return a reading as that of another sentence."""
    query = replace(reading.query, command=text)
    steps = tuple(query if one == reading.query else one for one in reading.steps)
    return replace(reading, query=query, steps=steps)
