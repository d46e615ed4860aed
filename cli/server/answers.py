"""Answers of a conversation as JSON for the page."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from appocc.checks import FloatArray
from appocc.polylines import length_m
from grounding.answer import Answer
from grounding.describe import describe_object, target_to_dict
from grounding.goal.planner import Target
from grounding.referent.resolver import Candidate
from grounding.referent.scene import SceneModel


def turn_as_json(said: str, frame: int, answer: Answer) -> dict[str, Any]:
    """Return a sentence and its answer in words."""
    referent = answer.referent
    return {
        "said": said,
        "frame": frame,
        "status": answer.status,
        "question": answer.question,
        "referent": None if referent is None else describe_object(referent.item, answer.scene),
        "reasons": list(answer.reasons),
        "steps": [step.step_text() for step in answer.steps] if len(answer.steps) > 1 else [],
        "dropped": list(answer.dropped),
        "goal": None if answer.target is None else _goal_words(answer),
    }


def shown_as_json(goal: Answer | None, answer: Answer | None) -> dict[str, Any] | None:
    """Return what map and cameras show of a conversation in the ego frame of its key frame; None: nothing.

    Args:
        goal: the answer whose goal is in force.
        answer: the answer to the last sentence, if it is about this key frame: the vehicle that it names, and the
            nearest place if there is none for the sentence.
    """
    in_force, told = goal or answer, answer or goal
    if in_force is None or told is None:
        return None
    plan, referent = in_force.plan, told.referent or in_force.referent
    partner = None if referent is None or referent.partner is None else referent.partner.id
    return {
        "referents": [one for one in (referent.item.id if referent else None, partner) if one is not None],
        "target": _target(in_force.target),
        "nearest": _target(told.plan.nearest),
        "runners_up": [_points(one.footprint()) for one in plan.runners_up],
        "route": None if plan.route is None else _points(plan.route),
        "steps": [_target(step.target) for step in in_force.steps[:-1] if step.target is not None],
    }


def candidates_as_json(
    candidates: Sequence[Candidate], scene: SceneModel, chosen: Candidate | None
) -> list[dict[str, Any]]:
    """Return the candidates that can be chosen, by number from 1; the one that is meant is left out.

    A candidate is a vehicle, or two for "between".
    """
    return [
        {
            "number": number,
            "key": candidate_key(one),
            "ids": [item.id for item in (one.item, one.partner) if item is not None],
            "words": candidate_words(one, scene),
            "rgb": None if one.item.rgb is None else [round(float(v)) for v in one.item.rgb],
        }
        for number, one in enumerate(candidates, start=1)
        if chosen is None or candidate_key(one) != candidate_key(chosen)
    ]


def candidate_key(candidate: Candidate) -> str:
    """Return what names a candidate from frame to frame: the ids of its vehicles."""
    return candidate.item.id if candidate.partner is None else f"{candidate.item.id} + {candidate.partner.id}"


def candidate_words(candidate: Candidate, scene: SceneModel) -> str:
    """Describe the vehicle of a candidate, or both of a pair."""
    words = describe_object(candidate.item, scene)
    return words if candidate.partner is None else f"{words}, and the {describe_object(candidate.partner, scene)}"


def _goal_words(answer: Answer) -> dict[str, Any]:
    target = answer.target
    assert target is not None
    route = answer.plan.route
    return {
        **target_to_dict(target),
        "way_m": None if route is None else round(length_m(route), 1),
        "confidence": round(answer.confidence, 2),
    }


def _target(target: Target | None) -> dict[str, Any] | None:
    if target is None:
        return None
    return {**target_to_dict(target), "footprint": _points(target.footprint())}


def _points(xy_m: FloatArray) -> list[list[float]]:
    return [[round(float(v), 3) for v in point] for point in xy_m]
