"""What takes back something said before: "no, the blue one", "sorry, in front of it", "I mean right"."""

from __future__ import annotations

from typing import TYPE_CHECKING

from grounding.language.command_frames import Deed
from grounding.language.noun_phrases import Phrase

if TYPE_CHECKING:
    from grounding.language.attachment import Telling

_NAMED = ("vehicle", "person", "one", "traffic", "adjective")


def instead(told: Telling, phrase: Phrase) -> bool:
    """Whether a noun phrase takes the place of what the last deed was about."""
    deed = told.before
    if deed is None:
        return False
    relation, before = told.relation, deed.target
    if relation is not None and phrase.kind == "pronoun" and before is not None:
        deed.relation, told.relation = relation, None  # "in front of it"
        return True
    if phrase.kind not in _NAMED or (before is None and relation is None):
        return False
    if relation is not None or before is None:
        deed.relation = relation or deed.relation
    if phrase.kind == "adjective":
        phrase.kind = "one"
    if before is not None:
        _drop(told, before, phrase)
    deed.target, deed.inverse = phrase, None
    told.mention(phrase, "target")
    told.spend_gap("gap")
    return True


def _drop(told: Telling, before: Phrase, phrase: Phrase) -> None:
    """What is not meant after all; if it is of the same kind, it may not be taken."""
    mentions = told.story.mentions
    mentions[:] = [(other, "excluded" if other is before else role) for other, role in mentions]
    if before.noun and phrase.noun in ("", before.noun) and (before.colour or before.qualifiers):
        told.story.excluded.append((None, before))
    elif before.kind in ("one", "adjective") and not before.noun:
        before.kind = "adjective"


def cancel(told: Telling, deed: Deed) -> None:
    """A new deed takes the place of the last one: "no, follow the bus"."""
    before = told.before
    if before is not None and before in told.story.deeds and not deed.negated:
        told.story.deeds.remove(before)


def steer(told: Telling, direction: str) -> bool:
    """Whether a direction takes the place of the last one: "I mean right"."""
    deed = told.before
    if deed is None or deed.direction is None:
        return False
    deed.direction = direction
    return True


def move(told: Telling, value: str) -> bool:
    """Whether a side takes the place of the last one that was named, of the vehicle or of the road."""
    deed = told.before
    if deed is None:
        return False
    words = deed.target.qualifiers if deed.target is not None else []
    for i, word in enumerate(words):
        if word in ("left_side", "right_side"):
            words[i] = value
            return True
    if deed.side is None:
        return False
    deed.side = value.removesuffix("_side")
    return True
