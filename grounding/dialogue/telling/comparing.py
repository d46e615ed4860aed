"""Answers that compare things: which of them is nearer, larger or faster."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from appocc.motion_state import MOVING_MPS
from grounding.answer import Answer
from grounding.dialogue.conversation import Conversation
from grounding.dialogue.descriptions import find_fitting
from grounding.dialogue.telling.measures import describe_one, describe_size, describe_speed
from grounding.dialogue.telling.reports import aside, unknown
from grounding.dialogue.telling.things import Things, describe_thing, find_things, find_told
from grounding.language import WordCategory
from grounding.language.questions import Question
from grounding.query import Referent
from grounding.referent.resolver import Candidate
from grounding.scene_object import SceneObject

# Words that compare a speed with ours, and those in such a question that name no thing.
_THAN_US = re.compile(r"\b(faster|slower|quicker) than (?:us|we|me|i|you|our)\b")
_NO_THING = ("than", "us", "me", "moving", "going", "driving", "travelling")
# Things whose measures differ by a smaller share are about the same.
_ALIKE = 0.03


def _volume_m3(item: SceneObject) -> float | None:
    return None if item.height_m is None else item.length_m * item.width_m * item.height_m


_SIZES: Mapping[str, Callable[[SceneObject], float | None]] = {
    "larger": _volume_m3,
    "longer": lambda item: item.length_m,
    "wider": lambda item: item.width_m,
    "taller": lambda item: item.height_m,
}
# The comparatives of the other direction.
_OPPOSITE = {
    "nearer": "farther",
    "smaller": "larger",
    "shorter": "longer",
    "narrower": "wider",
    "lower": "taller",
    "slower": "faster",
}


def tell_compared(talk: Conversation, text: str, question: Question) -> Answer | None:
    """Tell which of several things is more so, and each of them; None without several."""
    found, reasons = _find_compared(talk, question)
    items = [one.item for one in found]
    if len(items) < 2:
        return aside(talk, text, *(describe_one(one, talk.scene) for one in items), *reasons) if reasons else None
    word = _OPPOSITE.get(question.comparative, question.comparative)
    measured = [_measure(talk, word, one) for one in items]
    values = [one for one in measured if one is not None]
    if len(values) < len(items):
        return unknown(talk, text, f"which one is {question.comparative}")
    best = (max if word == question.comparative else min)(values)
    first, *others = sorted(zip(values, range(len(items)), strict=True), key=lambda one: abs(one[0] - best))
    told = [items[number] for _, number in (first, *others)]
    talk.list_items(told)
    name = told[0].common_name
    talk.state = replace(talk.state, focus=(found[first[1]], Referent(name, name)))  # "park behind it"
    alike = abs(others[0][0] - best) < _ALIKE * max(map(abs, values))
    yes = ("yes: " if first[1] == 0 and not alike else "no: ") if "than" in question.kinds else ""
    tell = describe_size if word in _SIZES else describe_one
    lead = "about the same: " if alike else f"{question.comparative} is "
    return aside(talk, text, f"{yes}{lead}{tell(told[0], talk.scene)}", *(tell(one, talk.scene) for one in told[1:]))


def tell_against_us(talk: Conversation, text: str, question: Question) -> Answer | None:
    """Tell whether a thing is faster or slower than we are; None for other comparisons."""
    compared = _THAN_US.search(text.lower())
    if compared is None:
        return None
    words = " ".join(one for one in question.words.split() if one not in _NO_THING)
    things = find_things(talk, replace(question, words=words, of_us=False))
    if not things.found:
        return aside(talk, text, *things.reasons) if things.reasons else unknown(talk, text, "which vehicle is meant")
    item, ours = things.items[0], talk.scene.speed_mps
    told = describe_one(item, talk.scene)
    if ours is None or item.speed_mps is None:
        return unknown(talk, text, f"{'our own speed' if ours is None else 'its speed'}; {told}")
    faster_m = item.speed_mps - abs(ours)
    alike = abs(faster_m) < MOVING_MPS
    yes = not alike and (faster_m > 0) == (compared[1] != "slower")
    return aside(talk, text, f"{'yes' if yes else 'no'}: {told}, and we {describe_speed(ours)}")


def _measure(talk: Conversation, word: str, item: SceneObject) -> float | None:
    """Return what a comparative compares of a thing; None where it is not known."""
    if word == "farther":
        return item.distance_m(talk.scene.ego)
    return item.speed_mps if word == "faster" else _SIZES[word](item)


def _find_compared(talk: Conversation, question: Question) -> tuple[list[Candidate], tuple[str, ...]]:
    """Return the things that a question compares, and why one is not found: those it names, else those told last."""
    asked = talk.state.question
    known = asked.candidates if asked is not None and len(asked.candidates) > 1 else find_told(talk)
    if not question.options:
        return list(known), ()
    found, reasons = dict[str, Candidate](), list[str]()
    for words in question.options:
        things = _find_among(talk, words, known) or find_things(talk, Question(("what",), words))
        another = next((one for one in things.found if one.item.id not in found), None)
        found |= {another.item.id: another} if another is not None else {}
        reasons += things.reasons
    return [*found.values()], tuple(reasons)


def _find_among(talk: Conversation, words: str, known: Sequence[Candidate]) -> Things | None:
    """Return which of several known things a description without a noun fits: "the left one"; None for others."""
    reading = describe_thing(talk, words)
    one_of = any(one.category is WordCategory.ONE for one in talk.read(words).tokens)
    fitting = find_fitting(reading, known, talk.scene) if reading is not None and one_of else []
    return Things(tuple(fitting)) if fitting else None
