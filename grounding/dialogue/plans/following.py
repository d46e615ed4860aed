"""Follow a plan while the scene changes: find its vehicles again, notice awaited events, leave out what is done."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from appocc.geometry import apply, inverse, wrap_angle
from grounding.answer import Answer
from grounding.describe import describe_object
from grounding.dialogue.telling.phrases import ask
from grounding.goal.shift import HeldPose
from grounding.referent.resolver import Candidate
from grounding.referent.scene import SceneModel
from grounding.requests import Request, Sighting
from grounding.road.lane_model import LANE_M
from grounding.scene_object import SceneObject

# Ids of objects that are numbered anew on each map.
_UNSTABLE_IDS = ("object ", "blob ")
# Without an id: largest distance from the predicted place, time between maps, and distance that a difference of
# colour or of length weighs.
_MAX_APART_M, _BETWEEN_S, _COLOUR_M, _LENGTH_M = 4.0, 0.5, 3.0, 1.0
# A step is done this close to its place; a vehicle has left this far from its place, and turned by this angle.
_DONE_M, _DONE_RAD, _LEFT_M, _TURNED_RAD = 1.5, np.radians(30), 4.0, np.radians(45)
# Actions that end with an event or a new command, not at a place.
_LASTING_ACTIONS = ("follow", "wait", "give_way", "slow_down")


@dataclass(frozen=True, eq=False)
class FollowedPlan:
    """The steps that are left of a plan.

    Attributes:
        requests: the steps, with their vehicles as they are now.
        reasons: what has happened since.
        lost: the answer if a vehicle of the plan is lost, else None.
    """

    requests: tuple[Request, ...]
    reasons: tuple[str, ...] = ()
    lost: Answer | None = None


def relocate(candidate: Candidate, before: SceneModel, scene: SceneModel) -> Candidate | None:
    """Return a candidate as it is in a new scene; None if it is lost."""
    item = _find(candidate.item, before, scene)
    partner = None if candidate.partner is None else _find(candidate.partner, before, scene)
    if item is None or (partner is None) != (candidate.partner is None):
        return None
    return replace(candidate, item=item, partner=partner)


def follow_question(asked: Answer, before: SceneModel, scene: SceneModel) -> Answer | None:
    """Return the open question in a new scene; None if what it is about is lost."""
    kept = tuple(found for one in asked.candidates if (found := relocate(one, before, scene)))
    if asked.plan.question:  # a proposed place stays where it is in the world
        referent = asked.referent and relocate(asked.referent, before, scene)
        lost = asked.referent is not None and referent is None
        return None if lost else replace(asked, referent=referent, candidates=kept, scene=scene)
    if not kept:
        return None
    # Near misses of a sentence that found nothing are remembered, but not asked about.
    return ask(kept, asked.reading, scene) if asked.question else replace(asked, candidates=kept, scene=scene)


def follow_plan(requests: Sequence[Request], goal: Answer, before: SceneModel, scene: SceneModel) -> FollowedPlan:
    """Return the steps of a plan that are left in a new scene.

    Args:
        requests: steps in force, in order, each with its vehicle as it was.
        goal: the answer of the plan.
        before: scene of that answer.
        scene: the new scene.
    """
    left, reasons = list(requests), list[str]()
    done = goal.steps or (goal,)
    while len(left) > 1 and (reason := _done(left, done[len(requests) - len(left)], before, scene)):
        left.pop(0)
        reasons.append(reason)
    moved = list[Request]()
    for step, answered in zip(left, done[len(requests) - len(left) :], strict=False):
        now = None if step.chosen is None else relocate(step.chosen, before, scene)
        if step.chosen is not None and now is None:
            named = describe_object(step.chosen.item, before)
            reason = f"the vehicle of the command is lost: the {named} when it was last seen, is no longer there"
            lost = Answer(status="not_found", reading=step.reading, scene=scene, reasons=(reason,))
            return FollowedPlan(tuple(requests), tuple(reasons), lost)
        sighting = step.sighting or (None if step.chosen is None else Sighting.of(step.chosen.item, before))
        moved.append(replace(_hold(step, answered), chosen=now, sighting=sighting))
    return FollowedPlan(tuple(moved), tuple(reasons))


def has_happened(event: str, first: Sighting, item: SceneObject | None, scene: SceneModel) -> bool:
    """Return whether an awaited event of a vehicle has come since it was first seen."""
    if item is None:
        return event in ("leave", "clear", "pass", "turn")
    moved_m = float(np.linalg.norm(scene.world_xy(item.centre_m) - first.world_m))
    ahead = item.centre_m[0] > scene.ego.centre_m
    lateral_m = abs(float(scene.lanes.project(item.centre_m[None])[1][0]))
    tests = {
        "leave": moved_m > _LEFT_M,
        "pass": ahead != first.ahead,
        "turn": abs(float(wrap_angle(scene.world_heading(item.yaw_rad) - first.heading_rad))) > _TURNED_RAD,
        "stop": item.is_standing is True,
        "merge": lateral_m < LANE_M / 2,
        "clear": not ahead or lateral_m > LANE_M,
    }
    return bool(tests.get(event, False))


def _done(steps: Sequence[Request], answered: Answer, before: SceneModel, scene: SceneModel) -> str:
    """Return why the first of some steps is done; '' if it is not.

    One that lasts, such as following, is done when the event comes that the next one waits for.
    """
    step, following = steps[:2]
    if step.query.trigger is None and step.query.action in _LASTING_ACTIONS and following.query.action == "wait":
        step = following
    action, event = (step.query.action or "drive").replace("_", " "), step.query.trigger
    if event is not None and step.chosen is not None:
        now = relocate(step.chosen, before, scene)
        first = step.sighting or Sighting.of(step.chosen.item, before)
        return (
            f"what was awaited has come: {event}"
            if has_happened(event, first, now.item if now else None, scene)
            else ""
        )
    if step.query.action in _LASTING_ACTIONS or answered.target is None:
        return ""
    place = apply(inverse(scene.world_from_ego), np.append(answered.target.world_m, 0.0))[:2]
    off_m = float(np.hypot(place[0] - scene.ego.centre_m, place[1]))
    turn = float(wrap_angle(answered.target.heading_rad - scene.world_heading(0.0)))
    return f"the step '{action}' is done" if off_m < _DONE_M and abs(turn) < _DONE_RAD else ""


def _hold(step: Request, answered: Answer) -> Request:
    """Return a step that keeps its place in the world, if it names no vehicle or its place was agreed to.

    "Stop in 20 metres" is not measured anew on every map.
    """
    if answered.target is None or (step.chosen is not None and step.held is None):
        return step
    return replace(step, held=HeldPose(answered.target.world_m, answered.target.heading_rad), shifts=())


def _find(item: SceneObject, before: SceneModel, scene: SceneModel) -> SceneObject | None:
    """Return an object of the last scene in the new one, by id or else by place, colour and size."""
    if not item.id.startswith(_UNSTABLE_IDS):
        return next((one for one in scene.table.items if one.id == item.id), None)
    velocity = np.zeros(2) if item.velocity_mps is None else item.velocity_mps
    world = before.world_xy(item.centre_m + _BETWEEN_S * velocity)
    expected = apply(inverse(scene.world_from_ego), np.append(world, 0.0))[:2]
    costs = [(_difference(item, one, expected), one) for one in scene.table.items]
    cost, best = min(costs, key=lambda pair: pair[0], default=(np.inf, None))
    return best if cost <= _MAX_APART_M else None


def _difference(item: SceneObject, other: SceneObject, expected_m: np.ndarray) -> float:
    """Return how much an object differs from another one expected at a place, in metres."""
    apart_m = float(np.linalg.norm(other.centre_m - expected_m))
    colour = 0.0
    if item.rgb is not None and other.rgb is not None:
        colour = float(np.abs(item.rgb - other.rgb).mean()) / 64
    return apart_m + _COLOUR_M * colour + _LENGTH_M * abs(item.length_m - other.length_m)
