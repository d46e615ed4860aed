"""Answers to commands for several cases: a condition, an event that may come, and a wish with its fallback."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

from appocc.motion_state import STANDING_MPS
from grounding.answer import Answer, pick
from grounding.describe import describe_step
from grounding.goal.planner import GoalPlan
from grounding.language.reading import Reading
from grounding.referent.scene import SceneModel


def choose_case(then: Answer, other: Answer, condition: str, motion: str) -> Answer:
    """Return the answer for the case that is seen, with what else would be done; else ask which one to plan.

    Args:
        then: the answer if the condition holds.
        other: the answer if it does not.
        condition: the condition in words.
        motion: whether it says that the vehicle moves or stands; '' for what the scene does not show.
    """
    first, last = (describe_step(one.query, one.referent, one.scene) for one in (then, other))
    vehicle = then.referent or other.referent
    speed_mps = vehicle.item.speed_mps if vehicle is not None else None
    if motion and speed_mps is not None:
        holds = (speed_mps > STANDING_MPS) == (motion == "moving")
        chosen, left = (then, last) if holds else (other, first)
        case = f"'{condition}' is {'' if holds else 'not '}the case now: '{left}' would be, if that changes"
        return replace(chosen, reasons=(case, *chosen.reasons))
    options = tuple(one for one in (then, other) if one.status != "not_a_command")
    asked = Answer(
        status="ambiguous",
        reading=then.reading,
        scene=then.scene,
        reasons=(f"whether '{condition}' cannot be told now, and one case is planned at a time",),
        question=f"shall we plan '{first}', or '{last}'?",
        alternatives=options,
        dropped=then.dropped,
    )
    return replace(asked, chooser=partial(pick, options, name="case"))


def await_event(reading: Reading, scene: SceneModel) -> Answer:
    """Return the answer to "stop if a child runs out": nothing changes now, and the event is not watched for."""
    named = (reading.query.action or "").replace("_", " ")
    reason = (
        f"'{named}' is for when '{reading.condition}': nothing changes now, and what others will do is not foreseen"
    )
    plan = GoalPlan(None, (reason,), later=True)
    return Answer(status="ok", reading=reading, scene=scene, reasons=(reason,), plan=plan, confidence=1.0)


def choose_place(wished: Answer, fallback: Answer, nearer: bool) -> Answer:
    """Return the answer to a wish, or to its fallback where the wish has no place or, with `nearer`, a farther."""
    first, last = (describe_step(one.query, one.referent, one.scene) for one in (wished, fallback))
    if wished.status == "ok":
        if nearer and _is_nearer(fallback, wished):
            return replace(fallback, reasons=(*fallback.reasons, f"'{first}' would be farther"))
        return replace(wished, reasons=(*wished.reasons, f"'{last}' is not needed"))
    asks_which = wished.status == "ambiguous" and not wished.plan.question
    if asks_which or fallback.status in ("not_found", "not_a_command"):
        return wished
    return replace(fallback, reasons=(f"'{first}' is not possible", *wished.reasons, *fallback.reasons))


def _is_nearer(answer: Answer, other: Answer) -> bool:
    """Return whether the place of an answer is nearer to us than that of another one."""
    if answer.target is None or other.target is None:
        return False
    ego = answer.scene.ego.centre_m
    return math.dist(answer.target.ego_m, (ego, 0)) < math.dist(other.target.ego_m, (ego, 0))
