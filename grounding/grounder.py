"""Sentences about a scene, answered: the scene is set once, then asked as often as one likes."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from appocc.bevmap import BEVMap
from appocc.boxes import Boxes
from appocc.checks import FloatArray
from appocc.ego_vehicle import EgoVehicle
from appocc.errors import AppoccError
from grounding.answer import Answer
from grounding.describe import phrase
from grounding.goal.planner import GoalPlan, plan_goal
from grounding.language.parser import Reading, readings
from grounding.referent.resolver import Candidate, Resolution, forbidden, resolve
from grounding.referent.scene import Scene, scene_of, scene_of_tracks
from grounding.road.road_map import RoadMap
from grounding.road.visibility import unseen_reason
from grounding.scene_object import SceneObject
from tracking.tracks import Track

# A reading for which no vehicle or no place is found stands behind all others.
_NO_VEHICLE, _NO_PLACE = -200.0, -100.0
# Of vehicles of which any will do, so many are tried.
_MOST_TRIED = 4

Reader = Callable[[str], tuple[Reading, ...]]


class Grounder:
    """Answers driving commands with places: `set_scene` once, `ground` often.

    Example:
        grounder = Grounder()
        grounder.set_scene(bev, tracks, world_from_ego)
        answer = grounder.ground("park behind the silver car")
    """

    def __init__(self, read: Reader = readings, ego: EgoVehicle = EgoVehicle()) -> None:
        """Make a grounder.

        Args:
            read: returns the readings of a text, best first, at least one.
            ego: size of the ego vehicle.
        """
        self._read, self._ego = read, ego
        self._scene: Scene | None = None

    def set_scene(
        self,
        bev: BEVMap,
        vehicles: Sequence[Track] | Boxes | None = None,
        world_from_ego: FloatArray | None = None,
    ) -> Scene:
        """Look at a map and the vehicles on it.

        Args:
            bev: the map, in the ego frame.
            vehicles: tracks in the world frame, or boxes in the ego frame; None: the map's own blobs.
            world_from_ego: (4, 4) pose of the ego; by default the world is the ego frame.

        Returns:
            What is there.

        Raises:
            ShapeError: if the pose is no rigid transform.
        """
        pose = np.eye(4) if world_from_ego is None else world_from_ego
        if vehicles is None or isinstance(vehicles, Boxes):
            self._scene = scene_of(bev, vehicles, pose, self._ego)
        else:
            self._scene = scene_of_tracks(bev, vehicles, pose, ego=self._ego)
        return self._scene

    def ground(self, text: str) -> Answer:
        """The place that a sentence asks for; every text gets an answer.

        Raises:
            AppoccError: if no scene was set.
        """
        scene = self._scene
        if scene is None or scene.road is None:
            raise AppoccError("grounder: expected a scene to be set before a sentence is asked")
        first, *others = self._read(text)
        if first.problem:
            reasons = (first.problem.message, *first.notes)
            return Answer("not_a_command", first, scene, reasons=reasons)
        read = [first, *(reading for reading in others if not reading.problem)]
        # Of equally good answers the first: readings come best first.
        best = max((_answer(reading, scene, scene.road) for reading in read), key=lambda answer: answer.score)
        if not scene.unseen_sides:
            return best
        return replace(best, reasons=(*best.reasons, unseen_reason(scene.unseen_sides)))


def _answer(reading: Reading, scene: Scene, road: RoadMap) -> Answer:
    """What one reading comes to."""
    query = reading.query
    found = resolve(query, scene)
    reasons = (*found.reasons, *reading.notes)
    if found.status != "ok":
        fits = found.candidates[0].score if found.status == "ambiguous" else _NO_VEHICLE
        return Answer(
            found.status,
            reading,
            scene,
            candidates=found.candidates,
            reasons=reasons,
            question=found.question,
            score=reading.score + fits,
        )
    barred = forbidden(query, scene)
    referent, made = max(
        ((one, _planned(reading, scene, road, one, barred)) for one in _tried(reading, found)),
        key=lambda pair: _worth(*pair),
    )
    return Answer(
        "ok" if made.target else "not_found",
        reading,
        scene,
        made,
        referent,
        found.candidates,
        (*_described(reading, referent, scene), *reasons, *made.reasons),
        score=reading.score + _worth(referent, made),
    )


def _tried(reading: Reading, found: Resolution) -> Sequence[Candidate | None]:
    """The vehicles to look for a place by; None where the command names none."""
    named = reading.query.referent
    return found.candidates[: 1 if named is None or named.definite else _MOST_TRIED] or (None,)


def _planned(
    reading: Reading, scene: Scene, road: RoadMap, one: Candidate | None, barred: Sequence[tuple[str, SceneObject]]
) -> GoalPlan:
    query = reading.query
    item, partner = (one.item, one.partner) if one else (None, None)
    made = plan_goal(query, scene, road, item, partner, barred)
    if item is None and query.landmark == "secondary":
        # A place by a thing that is not there would be a guess: it is told, and left to the passenger.
        thing = query.secondary[0].noun.replace("_", " ")
        reason = f"'{query.relation.replace('_', ' ')}' is measured from a {thing}, which the map does not hold"
        return GoalPlan(None, (reason,), nearest=made.target)
    return made


def _worth(candidate: Candidate | None, made: GoalPlan) -> float:
    """How good a vehicle is together with the place beside it."""
    fits = candidate.score if candidate else 0.0
    return fits + (math.log(made.target.score) if made.target else _NO_PLACE)


def _described(reading: Reading, candidate: Candidate | None, scene: Scene) -> tuple[str, ...]:
    """Which vehicle it is that was named."""
    if candidate is None or reading.query.referent is None:
        return ()
    return (f"'{reading.query.referent.phrase()}' is the {phrase(candidate.item, scene)}",)
