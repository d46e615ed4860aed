"""Answers about landmarks of the vector map: "how far is the junction?", "how many crossings are there?"."""

from __future__ import annotations

import re

from grounding.answer import Answer
from grounding.dialogue.conversation import Conversation
from grounding.dialogue.telling.measures import describe_time
from grounding.dialogue.telling.reports import aside
from grounding.dialogue.telling.things import NAMING
from grounding.goal.turns import propose_side_road
from grounding.language.questions import Question
from grounding.referent.scene import SceneModel
from grounding.road.landmarks import explain_unknown
from grounding.vocabulary import LANDMARK_KINDS, ORDINALS

# Kinds of questions about landmarks; the first ones are answered even where other words ask for the unknown.
_WHERE = ("distance", "count", "place")
_ASKED = (*_WHERE, "duration", "exists", "which", "what")


def tell_landmarks(talk: Conversation, text: str, question: Question) -> Answer | None:
    """Tell where the landmarks that a question is about lie on our way; None if it is about none."""
    tokens = talk.read(text).tokens
    kinds = [LANDMARK_KINDS[one.value] for one in tokens if one.value in LANDMARK_KINDS]
    where = bool({*question.kinds} & {*_WHERE}) or (question.of_us and "duration" in question.kinds)
    about = where or "exists" in question.kinds if question.limit else question.kind in _ASKED
    # With a vehicle or person, a landmark is only a location: "the van at the crossing".
    if not kinds or not about or any(one.category in NAMING for one in tokens):
        return None
    number = next((ORDINALS[one.value] for one in tokens if one.value in ORDINALS), None)
    timed = "duration" in question.kinds
    return aside(talk, text, *_describe(kinds[0], None if question.kind == "count" else number, timed, talk.scene))


def tell_ways(talk: Conversation, text: str, question: Question) -> Answer | None:
    """Tell which roads branch off on the sides that a question names, or on both, and whether ours goes on."""
    road = talk.scene.road
    if road is None:
        return None
    said = [side for side in ("left", "right") if re.search(rf"\b{side}\b", text.lower())]
    told = list[str]()
    for side in said or ("left", "right"):
        found, reasons = propose_side_road(road, side)
        yes = ("yes: " if found else "no: ") if said else ""
        told += [f"{yes}{reasons[0]}"] if reasons else []
    if not said:
        ends = "ends" if road.ego_lane.at_road_end else "goes on for"
        told.append(f"our road {ends} {'in ' if ends == 'ends' else ''}{max(road.ego_lane.end_m, 0):.0f} m at least")
    return aside(talk, text, *told)


def _describe(kind: str, number: int | None, timed: bool, scene: SceneModel) -> list[str]:
    """Tell the landmarks of a kind in our lane ahead, or the one with a number; `timed`: with a time for the way."""
    road = scene.road
    if road is None or not road.landmarks.knows(kind):
        return [explain_unknown(kind)]
    front_m = scene.ego.length_m / 2
    ahead_m = [one.near_m - front_m for one in road.landmarks.spans(kind, road.ego_lane) if one.far_m > front_m]
    told = f"{len(ahead_m)} {kind}{'' if len(ahead_m) == 1 else 's'} on our way, as far as the map shows it"
    if not ahead_m:
        return [told]
    chosen = ahead_m if number is None else ahead_m[number - 1 : number] if number > 0 else ahead_m[-1:]
    times = (f": {describe_time(one)}" if timed else "" for one in chosen)
    return [told, *(_place(kind, one) + time for one, time in zip(chosen, times, strict=True))]


def _place(kind: str, ahead_m: float) -> str:
    return f"the {kind} is {ahead_m:.0f} m ahead of our front" if ahead_m > 0 else f"we are at the {kind}"
