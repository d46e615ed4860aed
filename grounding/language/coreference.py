"""What pronouns and "one" stand for, and which phrases mean the same vehicle."""

from __future__ import annotations

from grounding.language.command_frames import Story
from grounding.language.noun_phrases import Phrase

_ORDERED = ("first", "second", "third", "fourth", "next", "last", "nearest", "farthest", "leftmost", "rightmost")
_SIDES = ("left_side", "right_side", "opposite_side", "left_lane", "right_lane")
# What "there are two trucks ahead" says of "the red one", too.
_INHERITED = ("ahead", "behind_ego", "own_lane", *_SIDES, "parked", "moving", "stopped")
_WORDS = ("pronoun", "one")
_SEVERAL = ("them", "they", "they're")


def antecedent(story: Story, phrase: Phrase) -> Phrase | None:
    """The last thing named before a phrase that it may stand for: a vehicle if there is one."""
    at = next(i for i, (other, _) in enumerate(story.mentions) if other is phrase)
    before = [(other, role) for other, role in story.mentions[:at] if other.kind not in (*_WORDS, "part")]
    if phrase.head in _SEVERAL and any(other.kind == "person" for other, _ in before):
        # "That man wants to cross behind the bus, let them": one bus is not "them".
        before = [(other, role) for other, role in before if other.kind != "vehicle" or other.number != 1]
    for kinds in (("vehicle",), ("person",), ("traffic", "thing", "spot", "region")):
        for roles in (("said", "target", "event", "excluded"), ("denied",), ("landmark",)):
            for other, role in reversed(before):
                if other.kind in kinds and role in roles:
                    return other
    return None


def resolved(story: Story, phrase: Phrase) -> Phrase | None:
    """The phrase itself, or what a pronoun or "one" stands for with what is said of both; None for nobody."""
    if phrase.kind not in _WORDS:
        return phrase
    before = antecedent(story, phrase)
    if before is None:
        return None
    role = next(role for other, role in story.mentions if other is before)
    found = Phrase(before.kind, before.noun, before.head, phrase.start, number=phrase.number)
    found.definite, found.late, found.known = phrase.definite, list(phrase.late), before.known
    found.links, found.excluded = [*before.links, *phrase.links], phrase.excluded
    found.extra = [*before.extra, *phrase.extra]
    found.in_line = before.in_line or phrase.in_line
    if phrase.kind == "pronoun":
        found.colour, found.qualifiers = before.colour, list(before.qualifiers)
    else:
        inherits = phrase.qualifiers and role not in ("excluded", "denied")
        found.colour = phrase.colour or (before.colour if inherits else None)
        found.qualifiers = [word for word in before.qualifiers if word in _INHERITED and role == "said"]
    found.qualifiers += [word for word in phrase.qualifiers if word not in found.qualifiers]
    return found


def qualify_antecedents(story: Story) -> None:
    """What is said of a pronoun is said of what it stands for: "go around it, it is parked"."""
    for phrase, role in story.mentions:
        if phrase.kind == "pronoun" and role == "said" and phrase.qualifiers:
            before = antecedent(story, phrase)
            if before is not None and before.kind == "vehicle":
                before.qualifiers += [word for word in phrase.qualifiers if word not in before.qualifiers]


def same(phrase: Phrase, other: Phrase) -> bool:
    """Whether two phrases may mean one vehicle: same noun, nothing that differs."""
    if other.noun != phrase.noun or other.kind != phrase.kind or not (phrase.definite or other.definite):
        return False
    if phrase.colour and other.colour and phrase.colour != other.colour:
        return False
    for words in (_ORDERED, _SIDES):
        own, its = ({word for word in one.qualifiers if word in words} for one in (phrase, other))
        if own and own != its and (its or words is _ORDERED):
            return False
    return True
