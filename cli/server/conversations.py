"""Conversations with the pages: kept by id, so that a page that is loaded again goes on with its own."""

from __future__ import annotations

import secrets
from collections.abc import Callable
from dataclasses import dataclass, field
from threading import Lock
from typing import Any

from appocc.errors import AppoccError, DataError, NotFoundError
from cli.server.answers import candidate_key, candidate_words, candidates_as_json, shown_as_json, turn_as_json
from cli.server.moments import Moments
from cli.server.recording import Place, Recording
from grounding import Answer, Grounder, Session
from grounding.referent.scene import SceneModel

# Conversations that are kept (each holds a scene of some 50 MB), the turns of each, and the longest sentence.
_MOST_TALKS, _MOST_TURNS, MOST_CHARACTERS = 16, 200, 500


@dataclass(eq=False)
class Talk:
    """A conversation of one page about one scene.

    Attributes:
        key: secret name.
        about: recording, scene and source of the maps; None before the first sentence.
        frame: key frame of the scene that is set.
        session: the conversation; None before the first sentence.
        grounder: holds the scene that is set; None before the first sentence.
        goal: answer whose goal is in force, planned for this key frame; None without one, or if its vehicle is lost.
        answer: answer to the last sentence; None after the scene has moved on.
        lost: why the goal in force cannot be planned for this key frame; ''.
        turns: sentences and answers in words.
        lock: held while a sentence is answered.
    """

    key: str
    about: tuple[str, int, str] | None = None
    frame: int = -1
    session: Session | None = None
    grounder: Grounder | None = None
    goal: Answer | None = None
    answer: Answer | None = None
    lost: str = ""
    turns: list[dict[str, Any]] = field(default_factory=list)
    lock: Lock = field(default_factory=Lock)

    @property
    def scene(self) -> SceneModel | None:
        """The scene that is set; None before the first sentence."""
        return self.grounder.scene if self.grounder else None


class Conversations:
    """The conversations of all pages."""

    def __init__(self, moments: Moments) -> None:
        """Begin without conversations."""
        self._moments = moments
        self._talks: dict[str, Talk] = {}
        self._lock = Lock()

    def talk(self, key: str | None) -> Talk:
        """Return a conversation by its key, a new one without a key or if it is not kept any more."""
        with self._lock:
            found = self._talks.pop(key, None) if key else None
            found = found or Talk(secrets.token_urlsafe(12))
            self._talks[found.key] = found  # last in the order of use
            while len(self._talks) > _MOST_TALKS:
                del self._talks[next(iter(self._talks))]
            return found

    def say(self, talk: Talk, recording: Recording, place: Place, text: str) -> dict[str, Any]:
        """Answer a sentence about a key frame.

        Raises:
            DataError: if the sentence is empty or too long, or the key frame has no map.
        """
        text = "".join(c if c.isprintable() else " " for c in text).strip()
        if not text or len(text) > MOST_CHARACTERS:
            raise DataError(f"expected a sentence of 1 to {MOST_CHARACTERS} characters, got {len(text)}")
        with talk.lock:
            session = self._moved(talk, recording, place)
            return _answered(talk, session, text, lambda: session.say(text))

    def choose(self, talk: Talk, recording: Recording, place: Place, key: str) -> dict[str, Any]:
        """Choose a candidate of the last question or answer by its key: numbers change while the scene moves.

        Raises:
            NotFoundError: if it is not among the candidates any more.
        """
        with talk.lock:
            session = self._moved(talk, recording, place)
            numbered = enumerate(session.candidates, start=1)
            found = next(((number, one) for number, one in numbered if candidate_key(one) == key), None)
            if found is None or talk.scene is None:
                raise NotFoundError("this vehicle is no longer in view: please say it again")
            number, candidate = found
            words = f"the {candidate_words(candidate, talk.scene)}"
            return _answered(talk, session, words, lambda: session.choose(number))

    def move(self, talk: Talk, recording: Recording, place: Place) -> dict[str, Any]:
        """Follow to another key frame of the scene and replan; a talk about another scene is not changed."""
        with talk.lock:
            if talk.about == (recording.key, place.scene, place.source):
                self._moved(talk, recording, place)
            return talk_as_json(talk)

    def _moved(self, talk: Talk, recording: Recording, place: Place) -> Session:
        """Set the scene of a key frame; another recording, scene or source begins a new conversation."""
        about = (recording.key, place.scene, place.source)
        if talk.about == about and talk.frame == place.frame and talk.session is not None:
            return talk.session
        if not place.source:
            raise DataError("this recording has no maps yet: predict them first")
        bev = recording.bev(place)
        pose = recording.frame(place.scene, place.frame).world_from_ego
        speed_mps = recording.speed_mps(place.scene, place.frame)
        _, vehicles = self._moments.vehicles(recording, place)
        if talk.about != about or talk.session is None:
            grounder = Grounder()
            grounder.set_street_map(recording.street_map(place.scene))
            grounder.set_left_hand_traffic(recording.left_hand_traffic(place.scene))
            grounder.set_scene(bev, vehicles, pose, speed_mps=speed_mps)
            talk.grounder, talk.session = grounder, grounder.session()
            talk.turns, talk.goal, talk.lost = [], None, ""
        else:
            planned = talk.session.update(bev, vehicles, pose, speed_mps=speed_mps)
            lost = planned is not None and planned.status != "ok"
            talk.goal, talk.lost = (None, planned.reasons[-1]) if planned and lost else (planned, "")
        talk.answer = None
        talk.about, talk.frame = about, place.frame
        return talk.session


def _answered(talk: Talk, session: Session, text: str, ask: Callable[[], Answer]) -> dict[str, Any]:
    before = session.goal
    talk.answer = answer = ask()
    talk.turns = [*talk.turns, turn_as_json(text, talk.frame, answer)][-_MOST_TURNS:]
    if session.goal is not before:  # else the goal in force stays as it is
        talk.goal, talk.lost = session.goal, ""
    return talk_as_json(talk)


def talk_as_json(talk: Talk) -> dict[str, Any]:
    """Return a conversation: its turns in words, what map and cameras show now, and the buttons of the last turn."""
    about = None
    if talk.about is not None:
        recording, scene, source = talk.about
        about = {"recording": recording, "scene": scene, "source": source, "frame": talk.frame}
    session, now = talk.session, talk.scene
    shown = shown_as_json(talk.goal, talk.answer)
    found: dict[str, Any] = {"talk": talk.key, "about": about, "turns": talk.turns, "shown": shown, "lost": talk.lost}
    if session is None or now is None or not talk.turns:
        return {**found, "question": "", "candidates": [], "replies": []}
    # Without a question, only an answer that tells the goal offers other vehicles for it: those of a sentence that
    # found nothing are not what "or do you mean" is about.
    of_goal = session.goal is not None and session.candidates is session.goal.candidates
    offers = session.question or (of_goal and talk.turns[-1]["goal"] is not None)
    told = talk.answer or talk.goal
    return {
        **found,
        "question": session.question,
        "candidates": candidates_as_json(session.candidates if offers else (), now, told.referent if told else None),
        "replies": ["yes", "no"] if session.proposes else [],
    }


def warm_up() -> None:
    """Load the grammar and the compiled search, so that the first sentence is as fast as the others."""
    import numpy as np

    from appocc.bevmap import BEVMap
    from appocc.grid import BEVGrid

    grid = BEVGrid.surround()
    occupancy = np.zeros((3, *grid.shape), np.float32)
    occupancy[0, :, 80:120] = 1
    known = np.ones(occupancy.shape, np.bool_)
    grounder = Grounder()
    grounder.set_scene(BEVMap(grid, occupancy, known, np.full(occupancy.shape, 90, np.uint8), known[0]))
    try:
        for sentence in ("park on the right", "turn left", "stop in 20 metres"):
            grounder.ground(sentence)
    except AppoccError:  # the first sentence is slower then
        return
