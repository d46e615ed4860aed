"""The grounder: set a scene once, then ground any number of commands in it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from typing import TYPE_CHECKING

import numpy as np

from appocc.bevmap import BEVMap
from appocc.boxes import Boxes
from appocc.checks import FloatArray
from appocc.ego_vehicle import EgoVehicle
from appocc.errors import AppoccError
from grounding.answer import Answer
from grounding.describe import describe_object
from grounding.goal.planner import GoalPlan, plan_goal
from grounding.language import Lexicon, Reading, parse_all, read_lexicon
from grounding.referent.resolver import MAX_CANDIDATES, Candidate, Resolution, resolve, resolve_exclusions
from grounding.referent.scene import SceneModel, scene_from_boxes, scene_from_map, scene_from_tracks
from grounding.road.road_map import RoadMap
from grounding.road.visibility import unseen_reason
from grounding.scene_object import SceneObject
from tracking.tracks import Track

if TYPE_CHECKING:
    from grounding.language.llm import ChatEndpoint

# Log scores of readings without a referent and without a goal: these rank below all others.
_NO_REFERENT_SCORE, _NO_GOAL_SCORE = -200.0, -100.0
# Candidates of an indefinite referent ("a red car") for which goals are compared.
_MAX_GOAL_CANDIDATES = 4


@dataclass(frozen=True)
class GrounderConfig:
    """Settings of a grounder.

    Attributes:
        trust_unseen: whether to use a network's guesses for cells that no camera sees.
        max_candidates: most candidates in an answer.
        left_hand_traffic: whether traffic drives on the left; None: as oncoming vehicles do, else on the right.
    """

    trust_unseen: bool = False
    max_candidates: int = MAX_CANDIDATES
    left_hand_traffic: bool | None = None


class Grounder:
    """Ground driving commands in a scene: `set_scene` once, `ground` often.

    Example:
        grounder = Grounder()
        grounder.set_scene(bev, tracks, world_from_ego)
        answer = grounder.ground("park behind the silver car")
    """

    def __init__(
        self,
        *,
        lexicon: Lexicon | str | PathLike[str] | None = None,
        llm: ChatEndpoint | None = None,
        config: GrounderConfig | None = None,
        ego: EgoVehicle = EgoVehicle(),
    ) -> None:
        """Prepare the parser.

        Args:
            lexicon: words to parse with, or a file of words to add to those of the package.
            llm: language model that reads commands first; the parser's readings follow.
            config: settings.
            ego: size of the ego vehicle.

        Raises:
            DataError: if the lexicon file cannot be read.
        """
        words = lexicon if lexicon is None or isinstance(lexicon, Lexicon) else read_lexicon(lexicon)

        def parse(text: str) -> tuple[Reading, ...]:
            return parse_all(text, words)

        self._read: Callable[[str], tuple[Reading, ...]] = (
            parse if llm is None else replace(llm, fallback=parse).parse_all
        )
        self._config, self._ego = config or GrounderConfig(), ego
        self._scene: SceneModel | None = None

    def set_scene(
        self,
        bev: BEVMap,
        vehicles: Sequence[Track] | Boxes | None = None,
        world_from_ego: FloatArray | None = None,
    ) -> SceneModel:
        """Set the map and the vehicles on it.

        Args:
            bev: map in the ego frame.
            vehicles: tracks in the world frame or boxes in the ego frame; None: objects of the map, or its vehicle
                instances if it has none.
            world_from_ego: (4, 4) pose of the ego; None: the world frame is the ego frame.

        Returns:
            The scene model.

        Raises:
            ShapeError: if the pose is not a rigid transform.
        """
        pose = np.eye(4) if world_from_ego is None else world_from_ego
        bev = bev.with_guesses() if self._config.trust_unseen else bev
        if vehicles is None:
            scene = scene_from_map(bev, pose, self._ego)
        elif isinstance(vehicles, Boxes):
            scene = scene_from_boxes(bev, vehicles, pose, self._ego)
        else:
            scene = scene_from_tracks(bev, vehicles, pose, ego=self._ego)
        self._scene = replace(scene, left_hand_traffic=self._config.left_hand_traffic)
        return self._scene

    def ground(self, text: str) -> Answer:
        """Ground a command; every text gets an answer.

        Raises:
            AppoccError: if no scene is set.
        """
        scene = self._scene
        if scene is None or scene.road is None:
            raise AppoccError("grounder: expected a scene to be set before a sentence is asked")
        first, *others = self._read(text)
        if first.problem:
            reasons = (first.problem.message, *first.notes)
            return Answer(status="not_a_command", reading=first, scene=scene, reasons=reasons)
        commands = [first, *(reading for reading in others if not reading.problem)]
        answers = [self._answer(reading, scene, scene.road) for reading in commands]
        # The readings come best first, and so the first of several equal answers wins.
        best = max(answers, key=lambda answer: answer.score)
        if not scene.unseen_sides:
            return best
        return replace(best, reasons=(*best.reasons, unseen_reason(scene.unseen_sides)))

    def _answer(self, reading: Reading, scene: SceneModel, road: RoadMap) -> Answer:
        """Answer one reading of a command."""
        query = reading.query
        resolution = resolve(query, scene, self._config.max_candidates)
        reasons = (*resolution.reasons, *reading.notes)
        if resolution.status != "ok":
            score = resolution.candidates[0].score if resolution.status == "ambiguous" else _NO_REFERENT_SCORE
            return Answer(
                status=resolution.status,
                reading=reading,
                scene=scene,
                candidates=resolution.candidates,
                reasons=reasons,
                question=resolution.question,
                score=reading.score + score,
            )
        exclusions = resolve_exclusions(query, scene)
        planned = [
            (referent, _plan_goal(reading, scene, road, referent, exclusions))
            for referent in _goal_candidates(reading, resolution)
        ]
        referent, goal_plan = max(planned, key=lambda pair: _log_score(*pair))
        return Answer(
            status="ok" if goal_plan.target else "ambiguous" if goal_plan.question else "not_found",
            reading=reading,
            scene=scene,
            plan=goal_plan,
            referent=referent,
            candidates=resolution.candidates,
            reasons=(*_explain_referent(reading, referent, scene), *reasons, *goal_plan.reasons),
            question=goal_plan.question,
            score=reading.score + _log_score(referent, goal_plan),
        )


def _goal_candidates(reading: Reading, resolution: Resolution) -> Sequence[Candidate | None]:
    """Return the candidates to plan a goal for; a single None if the command names no vehicle."""
    named = reading.query.referent
    return resolution.candidates[: 1 if named is None or named.definite else _MAX_GOAL_CANDIDATES] or (None,)


def _plan_goal(
    reading: Reading,
    scene: SceneModel,
    road: RoadMap,
    candidate: Candidate | None,
    exclusions: Sequence[tuple[str, SceneObject]],
) -> GoalPlan:
    query = reading.query
    item, partner = (candidate.item, candidate.partner) if candidate else (None, None)
    goal_plan = plan_goal(query, scene, road, item, partner, exclusions)
    if item is None and query.landmark == "secondary":
        # The map does not hold the landmark: report the goal as the nearest free place and not as the answer.
        landmark = query.secondary[0].noun.replace("_", " ")
        reason = f"'{query.relation.replace('_', ' ')}' is measured from a {landmark}, which the map does not hold"
        return GoalPlan(None, (reason,), nearest=goal_plan.target)
    return goal_plan


def _log_score(candidate: Candidate | None, goal_plan: GoalPlan) -> float:
    """Return the log score of a referent together with its goal."""
    score = candidate.score if candidate else 0.0
    return score + (math.log(goal_plan.target.score) if goal_plan.target else _NO_GOAL_SCORE)


def _explain_referent(reading: Reading, candidate: Candidate | None, scene: SceneModel) -> tuple[str, ...]:
    """Return the sentence that names the referent."""
    if candidate is None or reading.query.referent is None:
        return ()
    return (f"'{reading.query.referent.phrase()}' is the {describe_object(candidate.item, scene)}",)
