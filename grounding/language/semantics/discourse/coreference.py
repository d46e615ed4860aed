"""Coreference: antecedents of pronouns and "one", and noun phrases that may refer to the same vehicle."""

from __future__ import annotations

from collections.abc import Sequence

from grounding.language.semantics.discourse.command_frames import Discourse
from grounding.language.syntax.noun_phrases import NounPhrase
from grounding.query import Referent
from grounding.vocabulary import ORDINALS

_ORDERED = (*ORDINALS, "last", "nearest", "farthest", "leftmost", "rightmost")
_SIDES = ("left_side", "right_side", "opposite_side", "own_side", "left_lane", "right_lane")
# Qualifiers that "one" inherits: in "there are two trucks ahead, follow the red one" the red truck is ahead.
_INHERITED = ("ahead", "behind_ego", "own_lane", *_SIDES, "parked", "moving", "stopped")
# Index of the mention that a word refers to.
_ORDER_OF_MENTION = {"former": 0, "latter": -1}
_ANAPHORS = ("pronoun", "one")
_PERSONAL_PRONOUNS = ("he", "him", "she", "her")
_PLURAL_PRONOUNS = ("them", "they", "they're")


def phrase_of(referent: Referent) -> NounPhrase:
    """Return the noun phrase of a vehicle or person that was named before the text."""
    return NounPhrase(
        kind="person" if referent.noun == "person" else "vehicle",
        noun=referent.noun,
        head=referent.head,
        colour=referent.colour,
        qualifiers=list(referent.qualifiers),
        in_line=referent.in_line,
        clothes=referent.clothes,
    )


def name_by_order(discourse: Discourse, phrase: NounPhrase) -> None:
    """Give "the former" or "the latter" the noun and the qualifiers of the vehicle in that place."""
    vehicles = [other for other, _ in discourse.mentions if other.kind == "vehicle"]
    for word, place in _ORDER_OF_MENTION.items():
        if word in phrase.qualifiers and vehicles:
            meant = vehicles[place]
            phrase.take_noun(meant)
            phrase.colour = phrase.colour or meant.colour
            phrase.qualifiers = [*(one for one in phrase.qualifiers if one != word), *meant.qualifiers]


def find_antecedent(discourse: Discourse, phrase: NounPhrase) -> NounPhrase | None:
    """Return the most recent noun phrase that an anaphor may refer to, vehicles first; None if there is none."""
    at = next(i for i, (other, _) in enumerate(discourse.mentions) if other is phrase)
    if phrase.kind == "pronoun" and (one := _described_one(discourse, at)) is not None:
        return one
    before = [(other, role) for other, role in discourse.mentions[:at] if other.kind not in (*_ANAPHORS, "part")]
    if phrase.head in _PERSONAL_PRONOUNS and (person := _placed_person(before)) is not None:
        return person
    if phrase.head in _PLURAL_PRONOUNS and any(other.kind == "person" for other, _ in before):
        # "That man wants to cross behind the bus, let them": one bus is not "them".
        before = [(other, role) for other, role in before if other.kind != "vehicle" or other.number != 1]
    # "It" is no person: "someone's on the crossing, stop before it".
    first: tuple[str, ...] = ("thing",) if phrase.head == "it" else ()
    for kinds in (("vehicle",), first, ("person",), ("traffic", "thing", "spot", "region")):
        for roles in (("stated", "target", "event", "excluded"), ("denied",), ("landmark",), ("context",)):
            for other, role in reversed(before):
                if other.kind in kinds and role in roles:
                    return other
    return None


def _placed_person(before: Sequence[tuple[NounPhrase, str]]) -> NounPhrase | None:
    """Return the person stated last whose place is told by a vehicle: "my mum is by the white car, pick her up"."""
    stated = (one for one, role in reversed(before) if role in ("stated", "target"))
    last = next((one for one in stated if one.kind in ("vehicle", "person")), None)
    return last if last is not None and last.kind == "person" and last.related else None


def _described_one(discourse: Discourse, end: int) -> NounPhrase | None:
    """Return the vehicle of "the last one" if it is the last vehicle that the mentions before an index are about."""
    about = [other for other, role in discourse.mentions[:end] if role in ("stated", "target")]
    last = next((other for other in reversed(about) if other.kind in ("vehicle", "person", "one")), None)
    described = last is not None and last.kind == "one" and (last.colour or last.qualifiers)
    return resolve_anaphor(discourse, last) if last is not None and described else None


def resolve_anaphor(discourse: Discourse, phrase: NounPhrase) -> NounPhrase | None:
    """Return the antecedent with the qualifiers of both; the phrase itself if it is not an anaphor.

    None if a pronoun or "one" has no antecedent.
    """
    if phrase.kind not in _ANAPHORS:
        return phrase
    antecedent = find_antecedent(discourse, phrase)
    if antecedent is None:
        return None
    role = next((role for other, role in discourse.mentions if other is antecedent), "target")
    resolved = NounPhrase(
        kind=antecedent.kind,
        noun=antecedent.noun,
        head=antecedent.head,
        start=phrase.start,
        number=phrase.number,
    )
    resolved.definite, resolved.postmodifiers = phrase.definite, list(phrase.postmodifiers)
    resolved.in_lexicon = antecedent.in_lexicon
    resolved.related, resolved.excluded = [*antecedent.related, *phrase.related], phrase.excluded
    resolved.extra = [*antecedent.extra, *phrase.extra]
    resolved.in_line = antecedent.in_line or phrase.in_line
    if phrase.kind == "pronoun":
        resolved.colour, resolved.qualifiers = antecedent.colour, list(antecedent.qualifiers)
        resolved.clothes = antecedent.clothes
    else:
        inherits = phrase.qualifiers and role not in ("excluded", "denied")
        resolved.colour = phrase.colour or (antecedent.colour if inherits else None)
        resolved.qualifiers = [word for word in antecedent.qualifiers if word in _INHERITED and role == "stated"]
    resolved.qualifiers += [word for word in phrase.qualifiers if word not in resolved.qualifiers]
    return resolved


def qualify_antecedents(discourse: Discourse) -> None:
    """Add the qualifiers and colours of pronouns to their antecedents: "go around it, it is parked"."""
    for phrase, role in discourse.mentions:
        if phrase.kind == "pronoun" and role == "stated" and (phrase.qualifiers or phrase.colour):
            antecedent = find_antecedent(discourse, phrase)
            if antecedent is not None and antecedent.kind == "vehicle":
                antecedent.colour = antecedent.colour or phrase.colour
                antecedent.qualifiers += [word for word in phrase.qualifiers if word not in antecedent.qualifiers]


def may_corefer(phrase: NounPhrase, other: NounPhrase) -> bool:
    """Return whether two noun phrases may refer to one vehicle: the same noun, no contradiction."""
    if other.noun != phrase.noun or other.kind != phrase.kind or not (phrase.definite or other.definite):
        return False
    if phrase.colour and other.colour and phrase.colour != other.colour:
        return False
    for words in (_ORDERED, _SIDES):
        own, others = ({word for word in one.qualifiers if word in words} for one in (phrase, other))
        if own and own != others and (others or words is _ORDERED):
            return False
    return True
