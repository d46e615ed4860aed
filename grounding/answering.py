"""Answer readings of commands in a scene: resolve the referent and plan the goal of each step."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise

from appocc.errors import AppoccError
from grounding.answer import Answer, pick
from grounding.cases import await_event, choose_case, choose_place
from grounding.confidence import confidence_of, gather_evidence, is_worth_acting
from grounding.describe import describe_object, describe_step, with_article
from grounding.goal.at_landmark import landmark_of
from grounding.goal.exclusions import ExcludedPlace, resolve_exclusions
from grounding.goal.explanations import WARNINGS
from grounding.goal.planner import GoalPlan, plan_place, with_nearest
from grounding.goal.proposals import explain_refusal
from grounding.goal.second_best import plan_with_second_best
from grounding.goal.shift import HeldPose, explain_moved, hold_goal, shift_goal
from grounding.language import Reading
from grounding.referent.clarification import describe_one
from grounding.referent.ordinals import find_ordinals
from grounding.referent.resolver import (
    MAX_CANDIDATES,
    Candidate,
    Resolution,
    resolve,
    resolve_after_turn,
    with_partner,
)
from grounding.referent.scene import SceneModel
from grounding.requests import (
    HOLDING,
    Request,
    after_passing,
    after_turns,
    into_its_lane,
    requests_of,
    without_referent,
)
from grounding.road.pose import Pose2D
from grounding.road.road_map import RoadMap
from grounding.scene_object import SceneObject

# Log scores of readings without a referent and without a goal: these rank below all others.
_NO_REFERENT_SCORE, _NO_GOAL_SCORE = -200.0, -100.0
# Candidates of an indefinite referent ("a red car") for which goals are compared.
_MAX_GOAL_CANDIDATES = 4
# Other candidates of a definite referent that are tried if there is no place at the best one.
_MAX_OTHERS = 2
# A step that begins this near to the end of the map and has no place is planned later.
_MAP_END_M = 20.0


def answer_reading(reading: Reading, scene: SceneModel, limit: int = MAX_CANDIDATES) -> Answer:
    """Answer one reading of a command; with several steps, the answer is that of its primary query.

    A reading in doubt is a question, whose only alternative is the answer all the same. Where the scene has no place
    for a command with a fallback, the fallback is answered.
    """
    if (fallback := reading.otherwise) is not None:
        wished = answer_reading(replace(reading, otherwise=None, condition=""), scene, limit)
        if reading.condition:
            return choose_case(wished, answer_reading(fallback, scene, limit), reading.condition, reading.motion)
        return choose_place(wished, answer_reading(fallback, scene, limit), reading.prefers_nearer)
    if reading.condition:
        return await_event(reading, scene)
    requests = requests_of(reading)
    primary = next((i for i, one in enumerate(requests) if one.query == reading.query), len(requests) - 1)
    answer = answer_steps(requests, scene, primary=primary, limit=limit)
    answer = replace(answer, reading=replace(answer.reading, steps=reading.steps))
    forbidden = answer.plan.refused and not answer.question
    if not reading.doubt or reading.query.unresolved or forbidden:
        return answer
    asked = Answer(
        status="ambiguous",
        reading=reading,
        scene=scene,
        reasons=(*reading.notes, *_tell_dropped(reading)),
        question=reading.doubt,
        score=answer.score,
        alternatives=(answer,),
        dropped=reading.dropped,
    )
    return replace(asked, chooser=partial(pick, asked.alternatives, name="reading"))


def answer_steps(
    requests: Sequence[Request], scene: SceneModel, *, primary: int = -1, limit: int = MAX_CANDIDATES
) -> Answer:
    """Answer the steps of a plan in order.

    Args:
        requests: the steps, at least one.
        scene: the scene of the command.
        primary: index of the step that the answer is about.
        limit: largest number of candidates.

    Returns:
        The answer to the primary step with all steps, or that to the first step that fails.
    """
    steps, start = list[Answer](), None
    for request in _turn_beyond(after_passing(after_turns(requests)), scene):
        turned = start is not None and steps[-1].query.direction in ("left", "right")
        if steps and not turned:
            request = into_its_lane(_about_the_same(request, steps[-1]), steps[-1].referent, scene)
        step = answer_step(request, scene, limit=limit, start=start, turned=turned, gone=_gone_after(steps))
        steps.append(step if start is None else _later_beyond_map(step, scene, start))
        if (target := steps[-1].target) is not None:
            start = Pose2D(float(target.ego_m[0]), float(target.ego_m[1]), target.heading_ego_rad)
    failed = next((i for i, step in enumerate(steps) if step.status != "ok"), None)
    shown = (primary % len(steps)) if failed is None else failed
    if failed is None and steps[shown].plan.later:
        shown = max(i for i, step in enumerate(steps) if not step.plan.later)
    about = steps[shown]
    before = (reason for one in steps if one is not about for reason in one.reasons if reason.startswith(WARNINGS))
    reasons = (*about.reasons, *before, *(one.reasons[-1] for one in steps if one.plan.later))
    if failed is not None and len(steps) > 1:
        reasons = (f"step {failed + 1} of {len(steps)} ('{steps[failed].query.action}') fails", *reasons)

    def choose(number: int) -> Answer:
        chosen = with_choice(requests[shown], about, number)
        return answer_steps([*requests[:shown], chosen, *requests[shown + 1 :]], scene, primary=primary, limit=limit)

    return replace(
        about,
        reasons=reasons,
        steps=tuple(steps),
        score=sum(step.score for step in steps) - about.reading.score * (len(steps) - 1),
        confidence=min(step.confidence for step in steps),
        chooser=choose,
    )


def _about_the_same(request: Request, before: Answer) -> Request:
    """Return a step with the vehicle of the step before, if it is described in the same words."""
    described = request.query.referent is not None and request.query.referent == before.query.referent
    known = before.referent is not None and before.referent.partner is None
    return replace(request, chosen=before.referent) if described and known and request.chosen is None else request


def _gone_after(steps: Sequence[Answer]) -> tuple[SceneObject, ...]:
    """Return the vehicles that have left or passed once some steps are done."""
    awaited = [one for one in steps if one.query.trigger in ("leave", "pass") and one.query.action in HOLDING]
    return tuple(one.referent.item for one in awaited if one.referent is not None)


def _later_beyond_map(step: Answer, scene: SceneModel, start: Pose2D) -> Answer:
    """Return a step without a place as one for later, if it begins where the map ends and names no vehicle."""
    if step.status == "ok" or step.plan.refused or step.query.referent is not None or step.query.unresolved:
        return step
    lane = scene.road_from(start).ego_lane
    if lane.at_road_end or lane.end_m > _MAP_END_M:
        return step
    named = describe_step(step.query, None, scene)
    reason = f"'{named}' is planned once more of the road is seen: the map ends {max(lane.end_m, 0):.0f} m beyond"
    return replace(step, status="ok", plan=GoalPlan(None, (reason,), later=True), question="", reasons=(reason,))


def _turn_beyond(requests: Sequence[Request], scene: SceneModel) -> Sequence[Request]:
    """Return steps in which turning around comes beyond the vehicle ahead of us at which the next step ends."""
    turned = list(requests)
    for i, (step, following) in enumerate(pairwise(requests)):
        alone = step.query.direction == "around" and step.query.referent is None and not step.query.secondary
        if not alone or following.query.referent is None:
            continue
        found = _resolve(following, scene, MAX_CANDIDATES)
        if found.status == "ok" and found.candidates[0].item.centre_m[0] > scene.ego.centre_m:
            query = replace(step.query, referent=following.query.referent, relation="past", landmark="referent")
            turned[i] = replace(step, chosen=found.candidates[0], reading=step.reading.with_query(query))
    return turned


def with_choice(request: Request, answer: Answer, number: int) -> Request:
    """Return a step with a candidate of its answer as the referent; if the answer proposes a place, with that place.

    Raises:
        AppoccError: if there is no such candidate.
    """
    if answer.plan.question and number == 1:
        return accept_proposal(request, answer)
    return replace(request, chosen=pick(answer.candidates, number, "candidate"))


def accept_proposal(request: Request, answer: Answer) -> Request:
    """Return a step as the question of its plan proposes: at the nearest place, or with another action."""
    plan, chosen = answer.plan, request.chosen or answer.referent
    if plan.instead is not None:
        query = replace(request.query, action=plan.instead, actions=(plan.instead,), relation="none")
        return Request(reading=request.reading.with_query(query), chosen=chosen)
    held = None if plan.nearest is None else HeldPose(plan.nearest.world_m, plan.nearest.heading_rad)
    return replace(request, chosen=chosen, held=held, shifts=() if held else request.shifts)


def answer_step(
    request: Request,
    scene: SceneModel,
    limit: int = MAX_CANDIDATES,
    start: Pose2D | None = None,
    *,
    turned: bool = False,
    gone: Sequence[SceneObject] = (),
) -> Answer:
    """Answer one step: resolve its referent and plan its goal.

    Args:
        request: the step.
        scene: the scene of the command.
        limit: largest number of candidates.
        start: pose of the ego when the step begins; None: where it is now.
        turned: whether the step before turns off to `start`, from where its vehicle is then seen.
        gone: vehicles that are not there any more when the step begins.

    Raises:
        AppoccError: if the scene has no map.
    """
    request = _with_sought(request, scene)
    reading, road = request.reading, scene.road if start is None else scene.road_from(start)
    if road is None:
        raise AppoccError("grounder: expected a scene with a map, got one without")
    road = road.without(gone) if gone and start is None else road
    resolution = _resolve(request, scene, limit, start if turned else None)
    if resolution.status != "ok" and request.query.action == "slow_down" and request.query.relation == "none":
        return answer_step(without_referent(request, resolution.reasons), scene, limit, start)
    reasons = (*resolution.reasons, *reading.notes, *_tell_dropped(reading))
    make = partial(Answer, reading=reading, scene=scene, candidates=resolution.candidates, dropped=reading.dropped)
    if resolution.status != "ok" and (refusal := explain_refusal(request.query)):  # whichever is meant
        return make(status="not_found", plan=GoalPlan(None, (refusal,), refused=True), reasons=(refusal, *reasons))
    if resolution.status != "ok":
        score = resolution.candidates[0].score if resolution.status == "ambiguous" else _NO_REFERENT_SCORE
        return make(
            status=resolution.status,
            reasons=reasons,
            question=resolution.question,
            score=reading.score + score,
        )
    exclusions = resolve_exclusions(request.query, scene)
    planned = [
        (referent, _plan(_in_its_place(request, referent, gone, scene), scene, road, referent, exclusions, start))
        for referent in _goal_candidates(request, resolution)
    ]
    referent, goal_plan = max(planned, key=lambda pair: _log_score(*pair))
    if request.shifts:
        goal_plan = with_nearest(goal_plan)
    else:
        item = referent.item if referent else None
        goal_plan = plan_with_second_best(request.query, goal_plan, scene, road, item)
    confidence = _confidence(reading, referent, resolution, goal_plan, scene)
    settled = request.chosen is not None or referent is None
    if goal_plan.score is not None and referent and not settled and not is_worth_acting(confidence):
        goal_plan = replace(
            goal_plan, target=None, pace=None, question=f"do you mean {describe_one(referent.item, scene)}?"
        )
    question = goal_plan.question
    if question:  # about this vehicle only
        make = partial(make, candidates=(referent,) if referent else ())
    elif goal_plan.score is None and (
        others := _others_with_room(request, resolution, scene, road, exclusions, start)
    ):
        make = partial(make, candidates=others)
        question = f"there is no place at that one: do you mean {describe_one(others[0].item, scene)}?"
    return make(
        status="ok" if goal_plan.score is not None else "ambiguous" if question else "not_found",
        plan=goal_plan,
        question=question,
        referent=referent,
        reasons=(*_explain_referent(reading, referent, scene), *reasons, *goal_plan.reasons),
        score=reading.score + _log_score(referent, goal_plan),
        confidence=confidence,
    )


def without(scene: SceneModel, ids: frozenset[str]) -> SceneModel:
    """Return the scene without some objects, for resolving only: goals are planned with all objects."""
    if not ids:
        return scene
    objects, others = (tuple(item for item in items if item.id not in ids) for items in (scene.objects, scene.others))
    return replace(scene, objects=objects, others=others)


def _resolve(request: Request, scene: SceneModel, limit: int, after: Pose2D | None = None) -> Resolution:
    """Resolve the referent of a step; a settled one is taken. `after`: pose of the ego after a turn."""
    if request.chosen is None:
        left = without(scene, request.ruled_out)
        if after is not None:
            return resolve_after_turn(request.query, left, after, limit)
        return resolve(request.query, left, limit)
    return Resolution("ok", (with_partner(request.chosen, request.query, scene),), ())


def _with_sought(request: Request, scene: SceneModel) -> Request:
    """Return a step about "the red one" that refers to nothing as one about the only red vehicle, if there is one."""
    query, sought = request.query, request.query.sought
    if request.chosen or sought is None:
        return request
    named = replace(query, referent=sought, landmark=query.landmark or "referent", unresolved="", sought=None)
    found = resolve(named, scene).status
    if found != "ok" and not (sought.number == 2 and found == "ambiguous"):  # which pair is asked as of any
        return request
    return replace(request, reading=request.reading.with_query(named))


def _goal_candidates(request: Request, resolution: Resolution) -> Sequence[Candidate | None]:
    """Return the candidates to plan a goal for; a single None if the command names no vehicle."""
    named = request.query.referent
    one_only = named is None or named.definite or find_ordinals(named.qualifiers)  # "whichever is closest"
    return resolution.candidates[: 1 if one_only else _MAX_GOAL_CANDIDATES] or (None,)


def _in_its_place(
    request: Request, candidate: Candidate | None, gone: Sequence[SceneObject], scene: SceneModel
) -> Request:
    """Return a step at a vehicle that has left as one in its place: "when it's gone, pull up where it is now"."""
    item = candidate.item if candidate is not None and candidate.item in gone else None
    if item is None or request.query.relation not in ("at", "same_as") or request.held is not None:
        return request
    return replace(request, held=HeldPose(scene.world_xy(item.centre_m), scene.world_heading(item.yaw_rad)))


def _plan(
    request: Request,
    scene: SceneModel,
    road: RoadMap,
    candidate: Candidate | None,
    exclusions: Sequence[ExcludedPlace],
    start: Pose2D | None,
) -> GoalPlan:
    query = request.query
    item, partner = (candidate.item, candidate.partner) if candidate else (None, None)
    held = None if request.held is None else hold_goal(request.held, scene, road)
    goal_plan = held or plan_place(query, scene, road, item, partner, exclusions, start)
    unknown = item is None and query.landmark == "secondary" and query.secondary and landmark_of(query) is None
    if held is None and unknown and not goal_plan.refused:
        # The map does not hold the landmark: report the goal as the nearest free place and not as the answer.
        landmark = query.secondary[0].noun.replace("_", " ")
        relation, one = query.relation.replace("_", " "), with_article(landmark)
        reason = f"'{relation}' is measured from {one}, which the map does not hold"
        turns = query.action == "turn" and query.direction in ("left", "right") and goal_plan.target is not None
        question = f"shall we turn {query.direction} all the same?" if turns else ""
        return GoalPlan(None, (reason,), nearest=goal_plan.target, question=question)
    if request.shifts and goal_plan.target is None:
        second = plan_with_second_best(query, goal_plan, scene, road, item)
        goal_plan = second if second.target is not None else goal_plan  # the place that is in force
    named = item
    for shift in request.shifts:
        named = next((one for one in scene.table.items if one.id == shift.vehicle), item)
        goal_plan = shift_goal(goal_plan, shift, query, scene, road, named)
    name = "it" if named is None or named is item else f"the {describe_object(named, scene)}"
    return explain_moved(goal_plan, query, road, named, name) if request.shifts else goal_plan


def _others_with_room(
    request: Request,
    resolution: Resolution,
    scene: SceneModel,
    road: RoadMap,
    exclusions: Sequence[ExcludedPlace],
    start: Pose2D | None,
) -> tuple[Candidate, ...]:
    """Return the next candidates of a definite referent ("the blue car") at which the command has a place."""
    named = request.query.referent
    told = request.chosen is not None or request.query.relation == "between"
    if named is None or not named.definite or told or find_ordinals(named.qualifiers):
        return ()
    others = resolution.candidates[1 : 1 + _MAX_OTHERS]
    return tuple(one for one in others if _plan(request, scene, road, one, exclusions, start).target is not None)


def _log_score(candidate: Candidate | None, goal_plan: GoalPlan) -> float:
    """Return the log score of a referent together with its goal."""
    score = candidate.score if candidate else 0.0
    return score + (_NO_GOAL_SCORE if goal_plan.score is None else math.log(goal_plan.score))


def _confidence(
    reading: Reading, candidate: Candidate | None, resolution: Resolution, plan: GoalPlan, scene: SceneModel
) -> float:
    """Return the probability that referent and goal are right, 0 without a goal."""
    if plan.score is None:
        return 0.0
    return confidence_of(gather_evidence(reading, candidate, resolution.candidates, plan.score, scene))


def _tell_dropped(reading: Reading) -> tuple[str, ...]:
    """Return the sentence about the words that were left out, unless a note tells them."""
    words = [f"'{word}'" for word in reading.dropped if not any(f"'{word}'" in note for note in reading.notes)]
    return (f"left out: {', '.join(words)}",) if words else ()


def _explain_referent(reading: Reading, candidate: Candidate | None, scene: SceneModel) -> tuple[str, ...]:
    """Return the sentence that names the referent."""
    if candidate is None or reading.query.referent is None:
        return ()
    told = f"'{reading.query.referent.phrase()}' is the {describe_object(candidate.item, scene)}"
    if candidate.partner is None:
        return (told,)
    return told, f"the other one is the {describe_object(candidate.partner, scene)}"
