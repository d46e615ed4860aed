"""Answers about two things: how far they are apart, and what lies between them."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np

from appocc.checks import FloatArray
from appocc.geometry import footprints
from grounding.answer import Answer
from grounding.dialogue.conversation import Conversation
from grounding.dialogue.telling.measures import describe_one
from grounding.dialogue.telling.reports import aside, unknown
from grounding.dialogue.telling.things import describe_thing, find_things, names_thing
from grounding.language import Reading, WordCategory
from grounding.language.questions import Question
from grounding.referent.resolver import MAX_CANDIDATES, Candidate, find_all, resolve
from grounding.referent.scene import SceneModel
from grounding.scene_object import SceneObject

# What lies between two things is at most this far beside the line between them.
_BESIDE_M, _IN_ROW_M = 3.5, 1.5
# Words of a gap between us and something: "between us and the van".
_BETWEEN_US = re.compile(r"\bbetween (?:us|me|you|here)\b(?: and\b)?")
# Words that part two things: "the van and the bus", "from the van to the bus".
_PARTING = ("and", "from", "to")


def split_two(talk: Conversation, words: str) -> tuple[str, str] | None:
    """Return the words about each of two things: "the red car from the van"; None for other words."""
    texts = [one.text for one in talk.read(words).tokens if one.category is not WordCategory.BETWEEN] if words else []
    texts = texts[1:] if texts[:1] == ["from"] else texts
    for at, text in enumerate(texts):
        first, second = " ".join(texts[:at]), " ".join(texts[at + 1 :])
        if text in _PARTING and names_thing(talk, first) and names_thing(talk, second):
            return first, second
    return None


def find_pair(talk: Conversation, words: str) -> tuple[Reading, Candidate] | None:
    """Return the gap between two vehicles that words name, and both as one candidate; None for other words."""
    two = split_two(talk, words)
    reading = talk.readings(f"park between {' and '.join(two)}" if two else f"park {words}")[0]
    if reading.problem or reading.query.relation != "between":
        return None
    pair = next((one for one in resolve(reading.query, talk.scene).candidates if one.partner is not None), None)
    return None if pair is None else (reading, pair)


def tell_between(talk: Conversation, text: str, question: Question) -> Answer | None:
    """Tell what lies between two things that are named, or between us and the one that is named or in talk."""
    ends, reasons = _find_ends(talk, question)
    if not ends:
        return aside(talk, text, *reasons) if reasons else unknown(talk, text, "between what")
    start_m = ends[1].centre_m if len(ends) > 1 else np.array([talk.scene.ego.centre_m, 0.0])
    found = [one for one in _find_along(talk, start_m, ends[0]) if one not in ends]
    talk.list_items(found or ends)
    other = describe_one(ends[1], talk.scene) if len(ends) > 1 else "us"
    seen = f"{len(found)} seen" if found else "nothing is seen"
    told = [describe_one(one, talk.scene) for one in found[:MAX_CANDIDATES]]
    return aside(talk, text, f"{seen} between {other} and {describe_one(ends[0], talk.scene)}", *told)


def tell_apart(talk: Conversation, text: str, question: Question) -> Answer | None:
    """Tell how far two things are apart, or the distance of the only one that is named."""
    ends, reasons = _find_ends(talk, question)
    if len(ends) < 2:
        told = [describe_one(one, talk.scene) for one in ends]
        return aside(talk, text, *told, *reasons) if told or reasons else unknown(talk, text, "a distance of what")
    talk.list_items(ends)
    return aside(talk, text, describe_apart(ends[0], ends[1], talk.scene))


def describe_apart(one: SceneObject, other: SceneObject, scene: SceneModel) -> str:
    """Tell how far the outlines of two things are apart."""
    between_m = _gap_m(one.footprint(), other.footprint())
    return f"{between_m:.1f} m from {describe_one(one, scene)} to {describe_one(other, scene)}"


def tell_gap_to_us(talk: Conversation, text: str, question: Question) -> Answer | None:
    """Tell the gap between us, where we are now, and the vehicle that is named or in talk; None for other words."""
    if not _BETWEEN_US.search(text.lower()):
        return None
    things = find_things(talk, replace(question, words=_BETWEEN_US.sub("", question.words).strip(), of_us=False))
    talk.list_items(things.items)
    ego = talk.scene.ego
    ours_m = footprints([ego.centre_m, 0.0], 0.0, [ego.length_m, ego.width_m])
    told = [
        f"{_gap_m(ours_m, one.footprint()):.1f} m from us to {describe_one(one, talk.scene)}" for one in things.items
    ]
    return aside(talk, text, *(told or things.reasons)) if told or things.reasons else None


def _find_ends(talk: Conversation, question: Question) -> tuple[list[SceneObject], tuple[str, ...]]:
    """Return the things that a question names, at most two, and why one is not found."""
    if len(both := _find_told(talk)) > 1 and not names_thing(talk, question.words) and "both" in question.kinds:
        return both, ()
    ends, reasons, asked = list[SceneObject](), list[str](), talk.state.question
    two = split_two(talk, question.words)
    for words in two or (question.words,):
        things = find_things(talk, Question(("what",), words))
        ends += _find_both(talk, words) or [one for one in things.items if one not in ends][:1]
        reasons += things.reasons
        if two:  # "the one behind it" is at the first of the two, whatever is asked
            talk.state = replace(talk.state, question=None)
    talk.state = replace(talk.state, question=asked)
    return ends[:2], tuple(reasons)


def _find_told(talk: Conversation) -> list[SceneObject]:
    """Return the two things that were told last, in one answer or in two: "them", "those two"."""
    last = talk.last_told
    ids = () if last is None else last.ids if len(last.ids) == 2 else (*last.ids[:1], *last.before)
    return [one for key in dict.fromkeys(ids) for one in talk.scene.table.items if one.id == key]


def _find_both(talk: Conversation, words: str) -> list[SceneObject]:
    """Return the nearest two of several that are named together: "the two red cars"; none for other words."""
    described = describe_thing(talk, words)
    named = described.query.referent if described is not None else None
    plural = described is not None and any(one.form == "plural" for one in described.tokens)
    if named is None or not plural:
        return []
    alike = list(find_all(replace(named, definite=True, number=1), talk.scene))
    return sorted(alike, key=lambda one: one.distance_m(talk.scene.ego))[:2]


def _find_along(talk: Conversation, start_m: FloatArray, end: SceneObject) -> list[SceneObject]:
    """Return the objects on the line from a point to another object, or in its row, nearest to us first."""
    way = end.centre_m - start_m
    across_row = np.array([-np.sin(end.yaw_rad), np.cos(end.yaw_rad)])
    length_m = float(np.hypot(*way))
    found = list[SceneObject]()
    for item in talk.scene.table.items:
        offset = item.centre_m - start_m
        along, across = float(offset @ way) / length_m, float(way[0] * offset[1] - way[1] * offset[0]) / length_m
        in_row = abs(float((item.centre_m - end.centre_m) @ across_row)) < _IN_ROW_M
        if 0 < along < length_m and (abs(across) < _BESIDE_M or in_row):
            found.append(item)
    return sorted(found, key=lambda one: one.distance_m(talk.scene.ego))


def _gap_m(one_m: FloatArray, other_m: FloatArray) -> float:
    """Return the distance between the outlines (4, 2) of two boxes."""
    return min(_to_outline_m(one_m, other_m), _to_outline_m(other_m, one_m))


def _to_outline_m(points_m: FloatArray, outline_m: FloatArray) -> float:
    """Return the least distance of points (N, 2) to the sides of an outline (4, 2)."""
    side_m = np.roll(outline_m, -1, axis=0) - outline_m
    offset_m = points_m[:, None] - outline_m
    share = np.clip((offset_m * side_m).sum(-1) / (side_m**2).sum(-1), 0, 1)
    return float(np.linalg.norm(offset_m - share[..., None] * side_m, axis=-1).min())
