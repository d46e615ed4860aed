"""A story -> one query: where the vehicle ends, and everything else that labelled commands tell."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple, cast

from grounding.language.action_rules import settle
from grounding.language.command_frames import Deed, Story
from grounding.language.coreference import antecedent, qualify_antecedents, resolved, same
from grounding.language.main_action import BESIDE, Act, Choice, acts_of, choose
from grounding.language.noun_phrases import Phrase
from grounding.language.word_categories import RELATIONS
from grounding.query import (
    Anchor,
    Direction,
    DistanceRole,
    Exclusion,
    Landmark,
    LandmarkRelation,
    LandmarkRole,
    Query,
    Referent,
    Side,
)
from grounding.vocabulary import Action, Relation, Trigger

_UNTOLD = ("with", "of", "for", "object")
_PLURALS: tuple[tuple[str, str], ...] = (
    ("people", "person"),
    ("men", "man"),
    ("children", "child"),
    ("ies", "y"),
    ("sses", "ss"),
    ("ches", "ch"),
)
_PLURALS += (("s", ""),)


class Merged(NamedTuple):
    """A query, without an action where nothing is commanded, and what is said of its referent after the noun."""

    query: Query
    late: tuple[str, ...] = ()


def merge(text: str, story: Story) -> Merged:
    """The query of a story."""
    qualify_antecedents(story)
    told = acts_of(story)
    acts = [act for act in told if not act.deed.aside]
    if not acts:
        return Merged(_forbidden(text, story, tuple(_exclusions(story))))
    choice = choose(story, told)
    deed = choice.act.deed
    if deed.target is not None and deed.target.kind == "pronoun":
        meant = antecedent(story, deed.target)  # "don't overtake it, stay behind it"
        story.excluded = [(said, phrase) for said, phrase in story.excluded if said or phrase is not meant]
    excluded = tuple(_exclusions(story))
    relation, referent = _relation(story, acts, choice)
    secondary = tuple(_landmarks(acts, choice.act, referent))
    measured: Anchor | None = (
        "secondary" if deed.inverse is not None else "referent" if referent is not None else None
    )
    goal = next((mark for mark in secondary if mark.of == "goal" and mark.relation in RELATIONS), None)
    if referent is None and goal is not None:
        relation, measured = goal.relation, "secondary"
    in_order = (choice.act, *acts, *told)
    distance_m, distance_of = _distance(in_order)
    query = Query(
        command=text,
        action=cast(Action, choice.act.action),
        actions=cast(tuple[Action, ...], tuple(_actions(acts))),
        relation=cast(Relation, relation),
        landmark=measured,
        referent=_referent(story, referent, deed, choice.anaphora, relation) if referent is not None else None,
        secondary=secondary,
        direction=cast(Direction | None, _direction([*acts, *told], choice.act)),
        goal_side=cast(Side | None, next((act.deed.side for act in in_order if act.deed.side), None)),
        trigger=cast(Trigger | None, next((act.deed.event for act in in_order if act.deed.event), None)),
        distance_m=distance_m,
        distance_of=distance_of,
        excluded=(*excluded, *_own_exclusions(referent)),
    )
    return Merged(query, tuple(referent.late) if referent is not None else ())


def _forbidden(text: str, story: Story, excluded: tuple[Exclusion, ...]) -> Query:
    """The query where something is only ruled out: "don't park behind the bus", "don't move"."""
    actions = [action for deed in story.deeds if deed.negated and (action := settle(deed))]
    if not actions:
        return Query(text)
    placed = any(one.relation for one in excluded)
    action = cast(Action, "wait" if actions[-1] == "other" else actions[-1] if placed else "other")
    let = next((deed for deed in reversed(story.deeds) if deed.target is not None), None)  # "don't let it merge"
    referent = None if let is None or let.target is None else resolved(story, let.target)
    if let is None or referent is None or referent.kind not in ("vehicle", "person"):
        return Query(text, action, (action,), excluded=excluded)
    named = _referent(story, referent, let, let.target is not referent)
    trigger = cast(Trigger | None, let.event)
    return Query(text, action, (action,), landmark="referent", referent=named, trigger=trigger, excluded=excluded)


def _relation(story: Story, acts: Sequence[Act], choice: Choice) -> tuple[str, Phrase | None]:
    """Where the vehicle ends, and the referent, which a place that was told may bring along."""
    act, deed, referent = choice.act, choice.act.deed, choice.referent
    if deed.target is not None:
        led_by_person = deed.direct and act.target is not None and act.target.kind == "person"
        return ("none" if led_by_person else deed.relation), referent
    if deed.object is not None and deed.object.kind in ("spot", "region"):  # "take it"
        for relation, other in deed.object.links:
            if other.kind == "vehicle":
                return relation, referent or other
    for beside in acts:
        if beside.deed.link in BESIDE and referent is not None and beside.target is referent:
            return beside.deed.relation, referent
    if deed.there:
        for relation, other in _told_places(story):
            return relation, referent or other
        if referent is not None and act.action in ("park", "stop", "pull_over", "approach"):
            return "at", referent
    return (deed.relation if referent is not None else "none"), referent


def _told_places(story: Story) -> Iterator[tuple[str, Phrase]]:
    """Spots that were told by a vehicle, the last first: "there is a spot behind the van. park there"."""
    for phrase, _ in reversed(story.mentions):
        if phrase.kind in ("spot", "region"):
            yield from ((relation, other) for relation, other in phrase.links if other.kind == "vehicle")


def _landmarks(acts: Sequence[Act], primary: Act, referent: Phrase | None) -> Iterator[Landmark]:
    for act in (primary, *(act for act in acts if act is not primary and act.deed is not primary.deed)):
        last = len(act.deed.marks) - 1
        for i, (said, thing) in enumerate(act.deed.marks):
            entered = said == "along" or (said == "object" and act.action == "turn")
            relation = "into" if entered else said
            if act.deed.inverse and i == last:
                yield _landmark(thing, act.deed.inverse, "inverse")
            elif relation not in _UNTOLD and _told(thing):
                yield _landmark(thing, relation, "goal")
        if act.action == "other" and act.deed.lane:
            yield Landmark("lane", "in", "goal", None, (act.deed.lane,))
    person = primary.target
    if person is not None and person.kind == "person" and person is not referent:
        for relation, other in person.links:  # "the pedestrians behind it"
            if other is referent or other.kind == "pronoun":
                yield _landmark(person, relation, "inverse")
    for relation, thing in referent.links if referent is not None else ():
        if thing is not referent and relation not in _UNTOLD and _told(thing):
            yield _landmark(thing, relation, "referent")


def _told(thing: Phrase) -> bool:
    return bool(thing.noun) and thing.kind in ("vehicle", "thing", "person", "region") and thing.noun != "side"


def _landmark(thing: Phrase, relation: str, of: LandmarkRole) -> Landmark:
    return Landmark(_name(thing), cast(LandmarkRelation, relation), of, thing.colour, tuple(thing.qualifiers))


def _name(phrase: Phrase) -> str:
    """The noun of a vehicle; of other things the word as said, in the singular: street, though it is a road."""
    if phrase.kind == "vehicle":
        return phrase.noun
    word = phrase.head
    if phrase.number != 1:
        word = next((word.removesuffix(many) + one for many, one in _PLURALS if word.endswith(many)), word)
    said = word.replace(" ", "_")
    return phrase.noun if phrase.noun.endswith(said) else said


def _actions(acts: Sequence[Act]) -> Iterator[str]:
    """All actions in order; one told twice in a row counts once."""
    last = ""
    for act in sorted(acts, key=lambda act: act.deed.start):
        if act.action != last:
            yield act.action
        last = act.action


def _direction(acts: Sequence[Act], primary: Act) -> str | None:
    """The steering that is told: that of the primary act first, and a turn before "straight"."""
    told = [primary.deed.direction, *(act.deed.direction for act in reversed(acts))]
    return next((one for one in told if one not in (None, "straight")), next(filter(None, told), None))


def _distance(acts: Sequence[Act]) -> tuple[float | None, DistanceRole | None]:
    for act in acts:
        for metres, said in act.deed.distances:
            gap = said == "gap" or (said == "way" and act.action in ("follow", "avoid"))
            return metres, "descriptor" if said == "descriptor" else "referent" if gap else "ego"
    return None, None


def _referent(story: Story, phrase: Phrase, deed: Deed, anaphora: bool, relation: str = "none") -> Referent:
    """The referent with what is said of it elsewhere."""
    whole = replace(phrase, qualifiers=list(phrase.qualifiers), extra=list(phrase.extra))
    for other, role in story.mentions:
        if other is not phrase and role in ("said", "event") and same(phrase, other):
            whole.qualifiers += [word for word in other.qualifiers if word not in whole.qualifiers]
            whole.colour = whole.colour or other.colour
            whole.extra += other.extra
    pair = whole.number == 2 or (whole.number == 0 and relation == "between")
    return Referent(
        noun=whole.noun,
        head=whole.head,
        colour=whole.colour,
        qualifiers=tuple(whole.qualifiers),
        qualifiers_optional=tuple(word for word in deed.optional if word not in whole.qualifiers),
        number=2 if pair else 1,
        anaphora=anaphora,
        extra=tuple(dict.fromkeys(whole.extra)),
        definite=whole.definite,
        in_line=whole.in_line,
    )


def _exclusions(story: Story) -> Iterator[Exclusion]:
    for relation, phrase in story.excluded:
        found = resolved(story, phrase) or phrase
        target = next((other for other, role in story.mentions if role == "target" and other.kind == "vehicle"), None)
        noun = _name(found) if found.noun else target.noun if target is not None else ""
        if noun and phrase.kind != "part":
            qualifiers = tuple(phrase.qualifiers or found.qualifiers)
            yield Exclusion(cast(LandmarkRelation | None, relation), noun, phrase.colour or found.colour, qualifiers)


def _own_exclusions(referent: Phrase | None) -> Iterator[Exclusion]:
    """What is denied of the referent: "that is not red"."""
    if referent is not None:
        for colour, qualifiers in referent.excluded:
            yield Exclusion(None, referent.noun, colour, qualifiers)
