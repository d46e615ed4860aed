"""Query builder: one typed query from a discourse."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple, cast, get_args

from grounding.language.semantics.action_rules import classify_action
from grounding.language.semantics.discourse.command_frames import ENTERABLE, CommandFrame, Discourse
from grounding.language.semantics.discourse.coreference import (
    find_antecedent,
    may_corefer,
    qualify_antecedents,
    resolve_anaphor,
)
from grounding.language.semantics.landmarks import NOT_SPATIAL, landmarks_of, other_vehicle, written_noun
from grounding.language.semantics.main_action import (
    SIDE_CONNECTIVES,
    Intent,
    MainIntent,
    find_hazard,
    find_intents,
    select_main_intent,
)
from grounding.language.semantics.steps import plan_steps
from grounding.language.syntax.noun_phrases import NounPhrase
from grounding.query import (
    Anchor,
    Direction,
    DistanceRole,
    Exclusion,
    LandmarkRelation,
    Query,
    Referent,
    RoadSide,
    Side,
)
from grounding.vocabulary import ORDINALS, REFUSED, RELATIONS, Action, Manoeuvre, Relation, Trigger

# Kinds of distances that need no action to tell what they are.
_DISTANCES: dict[str, DistanceRole] = {"descriptor": "descriptor", "kerb": "kerb"}
# Words of a stop at the first room that there is.
_WHEN_ROOM = re.compile(
    r"\b(?:as soon as|whenever|when|once|until|till|wherever|where) [^.;]*?"
    r"\b(?:room|space|spot|gap|place|parking|you can|possible|chance|opportunity)\b"
    r"|\b(?:first|next|earliest) (?:opportunity|chance|possibility)\b"
)
# Relations to a vehicle that is not in our lane.
_BESIDE = ("next_to", "left_of", "right_of")
# Verbs that, alone, ask to drive on.
_GOING = ("go", "drive", "move")


class BuiltQuery(NamedTuple):
    """A query (without an action if nothing is commanded) and what belongs to it.

    Attributes:
        query: the query.
        postmodifiers: qualifiers of its referent after the noun.
        steps: the commanded steps in order, one query each; the query alone if it is the only step.
        main_step: index of the step that the query is about.
    """

    query: Query
    postmodifiers: tuple[str, ...] = ()
    steps: tuple[Query, ...] = ()
    main_step: int = 0


def build_query(text: str, discourse: Discourse) -> BuiltQuery:
    """Return the query of a discourse, without an action if nothing is commanded."""
    qualify_antecedents(discourse)
    intents = find_intents(discourse)
    commands = [intent for intent in intents if not intent.frame.is_temporal]
    if not commands:
        query = _build_prohibition(text, discourse, tuple(_exclusions(discourse)))
        return BuiltQuery(query, steps=(query,))
    main = select_main_intent(discourse, intents)
    target = main.intent.frame.target
    if target is not None and target.kind == "pronoun":
        antecedent = find_antecedent(discourse, target)  # "don't overtake it, stay behind it"
        discourse.excluded = [(where, one) for where, one in discourse.excluded if where or one is not antecedent]
    excluded = tuple(_exclusions(discourse))

    def query_of(about: MainIntent, stated: Sequence[Intent], every: Sequence[Intent]) -> Query:
        return _query(text, discourse, about, stated, every, excluded)

    query = query_of(main, commands, intents)
    query = query.beyond(query.crossed)
    steps, main_step = plan_steps(discourse, commands, main, query, query_of)
    postmodifiers = tuple(main.referent.postmodifiers) if main.referent is not None else ()
    return BuiltQuery(query, postmodifiers, steps, main_step)


def _query(
    text: str,
    discourse: Discourse,
    main: MainIntent,
    commands: Sequence[Intent],
    intents: Sequence[Intent],
    excluded: tuple[Exclusion, ...],
) -> Query:
    """Return the query about one intent, with the arguments that other intents add to it."""
    frame = main.intent.frame
    relation, referent = _goal_relation(discourse, commands, main)
    secondary = tuple(landmarks_of(discourse, commands, main.intent, referent))
    landmark: Anchor | None = (
        "secondary" if frame.inverse_relation is not None else "referent" if referent is not None else None
    )
    placing = [one for one in secondary if one.of == "goal" and one.relation in RELATIONS]
    if main.intent.action == "turn":  # "turn right at the next street" is into it
        placing = [one for one in placing if one.noun not in ("road", "street")]
    at_goal = next(iter(placing), None)
    if referent is None and at_goal is not None:
        relation, landmark = at_goal.relation, "secondary"
    by_priority = (main.intent, *commands, *intents)
    distance_m, distance_of = _distance(by_priority)
    if distance_of == "descriptor" and referent is None and at_goal is None:
        distance_of = "ego"  # "20 metres up the road" describes no vehicle
    side = next((intent.frame.side for intent in by_priority if intent.frame.side), None)
    by_traffic = side in get_args(RoadSide)
    trigger = next((intent.frame.event for intent in by_priority if intent.frame.event), None)
    named = _referent(discourse, referent, frame, main.anaphora, relation) if referent is not None else None
    if named is not None and referent is not None and referent.number == 0 and _is_any(main, referent):
        named = replace(named, definite=False)
    # "Beside it in our lane" says where we stand, "beside the truck on our path" where it does.
    if named is not None and relation in _BESIDE and "own_lane" in named.qualifiers and "lane" in text.split():
        named = replace(named, qualifiers=tuple(one for one in named.qualifiers if one != "own_lane"))
    query = Query(
        command=text,
        action=cast(Action, main.intent.action),
        actions=cast(tuple[Action, ...], tuple(_actions(commands))),
        relation=cast(Relation, relation),
        landmark=landmark,
        referent=named,
        secondary=secondary,
        direction=cast(Direction | None, _direction([*commands, *intents], main.intent)),
        goal_side=None if by_traffic else cast(Side | None, side),
        road_side=cast(RoadSide, side) if by_traffic else None,
        trigger=cast(Trigger | None, trigger),
        distance_m=distance_m,
        distance_of=distance_of,
        excluded=(*excluded, *_referent_exclusions(referent)),
        manoeuvre=cast(Manoeuvre | None, _manoeuvre(by_priority)),
        unresolved=_unresolved(main.intent) if referent is None else "",
        sought=_sought(discourse, main.intent) if referent is None else None,
        count=next((count for intent in by_priority if (count := _count(intent)) is not None), None),
    )
    query = query.at_excluded()
    goes = frame.verb_class in _GOING and query == Query(text, action="other", actions=("other",))
    return replace(query, manoeuvre="onward") if goes or _seeks_room(query) else query  # "okay, go"


def _seeks_room(query: Query) -> bool:
    """Return whether a stop is to be made where there is room at last: "pull over as soon as there is room"."""
    anywhere = query.referent is None and query.relation == "none" and query.manoeuvre is None
    stops = query.action in ("park", "pull_over", "stop")
    return stops and anywhere and _WHEN_ROOM.search(query.command.lower()) is not None


def _is_any(main: MainIntent, referent: NounPhrase) -> bool:
    """Return whether any of several will do: "until the people are over", "mind the parked cars"."""
    awaited = main.intent.action in ("wait", "give_way") and referent.kind == "person"
    return awaited or main.intent.action in ("turn", "avoid")


def _manoeuvre(intents: Sequence[Intent]) -> str | None:
    """Return how to drive: what is refused first ("jump the light, go on")."""
    named = [one.frame.manoeuvre for one in intents if one.frame.manoeuvre]
    return next((name for name in named if name in REFUSED), next(iter(named), None))


def _count(intent: Intent) -> int | None:
    """Return which branch or gap is taken, or how many lanes a change crosses; None if the text does not say."""
    if intent.frame.count is not None or intent.action not in ("turn", "park"):
        return intent.frame.count
    things = (thing for _, thing in intent.frame.landmarks)
    counted = [one for one in things if (one.noun in ENTERABLE if intent.action == "turn" else one.kind == "spot")]
    return next((ORDINALS[word] for one in counted for word in one.qualifiers if word in ORDINALS), None)


def _unresolved(intent: Intent) -> str:
    """Return the pronoun or "one" of an intent that no antecedent explains, '' if there is none.

    The object of parking and stopping is the ego: "park it".
    """
    target = intent.frame.target
    own = intent.frame.target_is_object and intent.action in ("park", "stop", "pull_over")
    missing = intent.anaphora and intent.target is None and target is not None and not own
    return target.head if missing and target is not None else ""


def _sought(discourse: Discourse, intent: Intent) -> Referent | None:
    """Return the description of a "one" without antecedent: for "the red one", a red vehicle."""
    target = intent.frame.target
    if not _unresolved(intent) or target is None or not (target.colour or target.qualifiers):
        return None
    return replace(_referent(discourse, target, intent.frame, True), noun="vehicle", head="one")


def _build_prohibition(text: str, discourse: Discourse, excluded: tuple[Exclusion, ...]) -> Query:
    """Return the query of a text with prohibitions only: "don't park behind the bus", "don't move"."""
    actions = [action for frame in discourse.frames if frame.negated and (action := classify_action(frame))]
    if not actions:
        return Query(command=text)
    hazard = find_hazard(discourse)
    if hazard is not None and not excluded:  # "don't pull out, there is a motorbike coming"
        named = _referent(discourse, hazard, discourse.frames[-1], False)
        return Query(command=text, action="wait", actions=("wait",), landmark="referent", referent=named)
    excludes_place = any(one.relation not in (None, *NOT_SPATIAL) for one in excluded)
    action = cast(Action, "wait" if actions[-1] == "other" else actions[-1] if excludes_place else "other")
    limit = next((one for one in excluded if one.relation == "past"), None)
    if limit is not None and action == "wait" and all(one.event is None for one in discourse.frames):
        return Query.short_of(text, limit)  # "don't go past the van"
    # "Don't let it merge" has a target.
    frame = next((one for one in reversed(discourse.frames) if one.target is not None), None)
    phrase = None if frame is None or frame.target is None else resolve_anaphor(discourse, frame.target)
    if frame is None or phrase is None or phrase.kind not in ("vehicle", "person"):
        goes_on = not excluded and actions[-1] in ("park", "stop", "pull_over")  # "don't stop here"
        manoeuvre: Manoeuvre | None = "onward" if goes_on else None
        return Query(command=text, action=action, actions=(action,), excluded=excluded, manoeuvre=manoeuvre)
    referent = _referent(discourse, phrase, frame, frame.target is not phrase)
    return Query(
        command=text,
        action=action,
        actions=(action,),
        landmark="referent",
        referent=referent,
        trigger=cast(Trigger | None, frame.event),
        excluded=excluded,
    )


def _goal_relation(
    discourse: Discourse, intents: Sequence[Intent], main: MainIntent
) -> tuple[str, NounPhrase | None]:
    """Return the relation of the goal and the referent, which may come from a place named earlier."""
    intent, frame, referent = main.intent, main.intent.frame, main.referent
    if frame.target is not None:
        person = frame.target_is_object and intent.target is not None and intent.target.kind == "person"
        return ("none" if person else frame.relation), referent
    if frame.direct_object is not None and frame.direct_object.kind in ("spot", "region"):  # "take it"
        for relation, other in frame.direct_object.related:
            if other.kind == "vehicle":
                return relation, referent or other
    for side in intents:
        if side.frame.connective in SIDE_CONNECTIVES and referent is not None and side.target is referent:
            return side.frame.relation, referent
    if frame.refers_to_place:
        for relation, other in _places_by_vehicle(discourse):
            return relation, referent or other
        if referent is not None and intent.action in ("park", "stop", "pull_over", "approach"):
            return "at", referent
    return (frame.relation if referent is not None else "none"), referent


def _places_by_vehicle(discourse: Discourse) -> Iterator[tuple[str, NounPhrase]]:
    """Yield places defined by a vehicle, the last first: "there is a spot behind the van. park there"."""
    for phrase, _ in reversed(discourse.mentions):
        if phrase.kind in ("spot", "region"):
            yield from ((relation, other) for relation, other in phrase.related if other.kind == "vehicle")


def _actions(intents: Sequence[Intent]) -> Iterator[str]:
    """Yield all actions in order, consecutive repetitions once."""
    last = ""
    for intent in sorted(intents, key=lambda intent: intent.frame.start):
        if intent.action != last:
            yield intent.action
        last = intent.action


def _direction(intents: Sequence[Intent], main: Intent) -> str | None:
    """Return the steering direction: the main intent's first, a turn before "straight"."""
    directions = [main.frame.direction, *(intent.frame.direction for intent in reversed(intents))]
    turns = (one for one in directions if one not in (None, "straight"))
    return next(turns, next(filter(None, directions), None))


def _distance(intents: Sequence[Intent]) -> tuple[float | None, DistanceRole | None]:
    """Return the first distance in metres and its reference, as in `Query`."""
    for intent in intents:
        for metres, kind in intent.frame.distances:
            gap = kind == "gap" or (kind == "travel_or_gap" and intent.action in ("follow", "avoid"))
            return metres, _DISTANCES.get(kind, "referent" if gap else "ego")
    return None, None


def _referent(
    discourse: Discourse, phrase: NounPhrase, frame: CommandFrame, anaphora: bool, relation: str = "none"
) -> Referent:
    """Return the referent with colour, qualifiers and attributes of all coreferent noun phrases."""
    whole = replace(phrase, qualifiers=list(phrase.qualifiers), extra=list(phrase.extra))
    beside = [other_vehicle(discourse, phrase, one) for _, one in phrase.related if one.kind == "pronoun"]
    others = [(one, role) for one, role in discourse.mentions if one is not phrase and one not in beside]
    for other, role in others:
        if role in ("stated", "event") and may_corefer(phrase, other):
            whole.qualifiers += [word for word in other.qualifiers if word not in whole.qualifiers]
            whole.colour = whole.colour or other.colour
            whole.clothes = whole.clothes or other.clothes
            whole.extra += other.extra
    pair = whole.number == 2 or (whole.number == 0 and relation == "between")
    return Referent(
        noun=whole.noun,
        head=whole.head,
        colour=whole.colour,
        qualifiers=tuple(whole.qualifiers),
        qualifiers_optional=tuple(word for word in frame.goal_qualifiers if word not in whole.qualifiers),
        number=2 if pair else 1,
        anaphora=anaphora,
        extra=tuple(dict.fromkeys(whole.extra)),
        definite=whole.definite,
        in_line=whole.in_line,
        clothes=whole.clothes,
    )


def _exclusions(discourse: Discourse) -> Iterator[Exclusion]:
    """Yield the exclusions of a discourse; one without a noun has the noun of the target."""
    for relation, phrase in discourse.excluded:
        found = resolve_anaphor(discourse, phrase) or phrase
        vehicles = (other for other, role in discourse.mentions if role == "target" and other.kind == "vehicle")
        target = next(vehicles, None)
        noun = written_noun(found) if found.noun else target.noun if target is not None else ""
        if noun and phrase.kind != "part":
            qualifiers = tuple(phrase.qualifiers or found.qualifiers)
            colour = phrase.colour or found.colour
            rival = relation == "at" and target is not None and found is not target  # "beside it, not at the red one"
            where = cast(LandmarkRelation | None, None if rival else relation)
            yield Exclusion(where, noun, colour, qualifiers, phrase.distance_m)


def _referent_exclusions(referent: NounPhrase | None) -> Iterator[Exclusion]:
    """Yield the exclusions that negate an attribute of the referent: "that is not red"."""
    if referent is not None:
        for colour, qualifiers in referent.excluded:
            yield Exclusion(None, referent.noun, colour, qualifiers)
