"""The grounder: set a scene once, then ground any number of commands in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from os import PathLike
from typing import TYPE_CHECKING

import numpy as np

from appocc.bevmap import BEVMap
from appocc.boxes import Boxes
from appocc.checks import FloatArray
from appocc.ego_vehicle import EgoVehicle
from appocc.errors import AppoccError, DataError
from grounding.answer import Answer
from grounding.answering import answer_reading
from grounding.dialogue.conversation import Conversation
from grounding.dialogue.session import Session
from grounding.dialogue.telling.questions import answer_question
from grounding.language import Lexicon, Reading, parse_all, read_lexicon
from grounding.query import Referent
from grounding.reconciling import reconcile
from grounding.referent.resolver import MAX_CANDIDATES
from grounding.referent.scene import SceneModel, scene_from_boxes, scene_from_map, scene_from_tracks
from grounding.road.landmarks import Landmarks
from grounding.road.style import DEFAULT_STYLE, DrivingStyle
from grounding.road.visibility import unseen_reason
from tracking.tracks import Track

if TYPE_CHECKING:
    from appocc.nuscenes.maps import VectorMap
    from grounding.language.llm import ChatEndpoint


@dataclass(frozen=True)
class GrounderConfig:
    """Settings of a grounder.

    Attributes:
        trust_unseen: whether to use a network's guesses for cells that no camera sees.
        max_candidates: most candidates in an answer.
        left_hand_traffic: whether traffic drives on the left; None: as oncoming vehicles do, else on the right.
        style: gaps to other vehicles.
    """

    trust_unseen: bool = False
    max_candidates: int = MAX_CANDIDATES
    left_hand_traffic: bool | None = None
    style: DrivingStyle = DEFAULT_STYLE


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
            llm: language model that is asked where the grammar left content words out or found no command.
            config: settings.
            ego: size of the ego vehicle.

        Raises:
            DataError: if the lexicon file cannot be read.
        """
        words = lexicon if lexicon is None or isinstance(lexicon, Lexicon) else read_lexicon(lexicon)
        self.lexicon, self.config = words, config or GrounderConfig()
        self._llm, self._ego = llm, ego
        self._scene: SceneModel | None = None
        self._street_map: VectorMap | None = None
        self._left_hand_traffic = self.config.left_hand_traffic

    @property
    def scene(self) -> SceneModel | None:
        """The scene that is set; None before `set_scene`."""
        return self._scene

    def set_street_map(self, street_map: VectorMap | None) -> None:
        """Set the vector map, world frame, from which the scenes that are set next take their landmarks."""
        self._street_map = street_map

    def set_left_hand_traffic(self, left_hand: bool | None) -> None:
        """Set whether traffic drives on the left in the scenes that are set next; a configured side stays.

        Args:
            left_hand: None: as oncoming vehicles do, else on the right.
        """
        if self.config.left_hand_traffic is None:
            self._left_hand_traffic = left_hand

    def set_scene(
        self,
        bev: BEVMap,
        vehicles: Sequence[Track] | Boxes | None = None,
        world_from_ego: FloatArray | None = None,
        *,
        speed_mps: float | None = None,
    ) -> SceneModel:
        """Set the map and the vehicles on it.

        Args:
            bev: map in the ego frame.
            vehicles: tracks in the world frame or boxes in the ego frame; None: objects of the map, or its vehicle
                instances if it has none.
            world_from_ego: (4, 4) pose of the ego; None: the world frame is the ego frame. Tracks need it.
            speed_mps: speed of the ego, forwards; None: unknown.

        Returns:
            The scene model.

        Raises:
            AppoccError: if tracks come without a pose, or the speed is no finite number.
            ShapeError: if the pose is not a rigid transform.
        """
        tracks = None if vehicles is None or isinstance(vehicles, Boxes) else vehicles
        if tracks is not None and world_from_ego is None:
            raise AppoccError(
                "set_scene: expected world_from_ego with tracks, which are in the world frame, got none"
            )
        if speed_mps is not None and not np.isfinite(speed_mps):
            raise AppoccError(f"set_scene: expected a finite speed_mps, got {speed_mps}")
        pose = np.eye(4) if world_from_ego is None else world_from_ego
        bev = bev.with_guesses() if self.config.trust_unseen else bev
        if vehicles is None:
            scene = scene_from_map(bev, pose, self._ego)
        elif isinstance(vehicles, Boxes):
            scene = scene_from_boxes(bev, vehicles, pose, self._ego)
        else:
            scene = scene_from_tracks(bev, vehicles, pose, ego=self._ego)
        if self._street_map is not None:
            scene = replace(scene, landmarks=Landmarks.from_map(self._street_map, pose))
        self._scene = replace(
            scene, left_hand_traffic=self._left_hand_traffic, style=self.config.style, speed_mps=speed_mps
        )
        return self._scene

    def ground(self, text: str) -> Answer:
        """Ground a command; every text gets an answer. A question is no command, and its reasons answer it.

        Raises:
            AppoccError: if no scene is set.
        """
        if told := answer_question(Conversation(self), text):
            return replace(told, status="not_a_command")
        readings = self.read(text)
        return self.check(text, readings[0], self.best_answer(readings))

    def session(self) -> Session:
        """Begin a conversation about the scene, in which sentences refer to what was said before."""
        return Session(self)

    def read(
        self, text: str, antecedent: Referent | None = None, verb: str = "", *, alone: bool = True
    ) -> tuple[Reading, ...]:
        """Return the readings of a sentence, best first; arguments as in `parse_all`.

        `alone`: whether the sentence stands alone; a reply in a conversation is read by the grammar only.
        """
        return parse_all(text, self.lexicon, antecedent, verb, revised=alone)

    def best_answer(self, readings: Sequence[Reading]) -> Answer:
        """Answer the readings of a sentence in the scene and return the best answer.

        Raises:
            AppoccError: if no scene is set.
        """
        scene = self._scene
        if scene is None or scene.road is None:
            raise AppoccError("grounder: expected a scene to be set before a sentence is asked")
        first, *others = readings
        if first.problem:
            reasons = (first.problem.message, *first.notes)
            return Answer(status="not_a_command", reading=first, scene=scene, reasons=reasons)
        # A sentence that is understood as it stands is not corrected because the scene has no such place.
        literal = not (first.corrections or first.dropped)
        commands = [first, *(one for one in others if not (one.problem or (literal and one.corrections)))]
        answers = [answer_reading(reading, scene, self.config.max_candidates) for reading in commands]
        # The readings come best first, and so the first of several equal answers wins; what is forbidden stays so.
        forbidden = answers[0].plan.refused and not answers[0].question
        best = answers[0] if forbidden else max(_unasked(answers), key=lambda answer: answer.score)
        if not scene.unseen_sides:
            return best
        return replace(best, reasons=(*best.reasons, unseen_reason(scene.unseen_sides)))

    def check(self, text: str, reading: Reading, answer: Answer) -> Answer:
        """Compare an answer with the language model's reading, where the grammar understood only a part.

        That is where it dropped words, found no command, or the reader network changed its reading.

        Args:
            text: the sentence.
            reading: the grammar's reading of it.
            answer: the answer to that reading.

        Returns:
            The answer if there is no model, the grammar used every content word, or the model reads the same; else
            the question which reading is meant, with `alternatives`.
        """
        if self._llm is None or not (reading.problem or reading.dropped or reading.revised):
            return answer
        try:
            other = self._llm.read(text)
        except DataError as error:
            return replace(answer, reasons=(*answer.reasons, str(error)))
        if other.problem and reading.problem:
            return answer
        return reconcile(answer, self.best_answer((other,)))


def _unasked(answers: Sequence[Answer]) -> list[Answer]:
    """Return the answers of readings, best first, without questions that a likelier reading settles."""
    settled = next((i for i, one in enumerate(answers) if one.status == "ok"), len(answers))
    return [one for i, one in enumerate(answers) if i <= settled or one.status == "ok"]
