"""Revision of the grammar's reading of a sentence by the reader network.

Of the grammar's reading and the network's own, the one that the network takes for likelier is kept; the grammar's
gains where it understood the words. Whether a sentence is a command is voted on. The weights of that vote, and of the
probability that a reading is right, are learnt by `python -m benchmarks.train_reader` on speakers that the network
did not see.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from grounding.language.reader.fields import FIELDS, NONE, QUALIFIERS, VEHICLES
from grounding.language.reader.network import Numbers, Prediction
from grounding.query import Landmark, Query, Referent
from grounding.vocabulary import REFUSED, STATES, Action

# Least probability of a value that counts.
_LEAST = 1e-4
# What the grammar's reading gains (nats) where it understood every word, misspelt ones too, and where it left words
# out but doubts none: it keeps to the rules of the labelled files, of which the authors of the sentences knew little.
_TRUST_WHOLE, _TRUST = 3.5, 1.0
# Least log odds at which a sentence is a command that the grammar takes for none, and at which it remains one: the
# weights are fitted on sentences of which seven in eight are commands.
_LEAST_ODDS, _LEAST_ODDS_KEPT, _LEAST_ODDS_REFUSED = 2.5, 1.0, -1.0
# Log odds of a command beyond which they tell no more of its reading.
_MOST_ODDS = 6.0
# Least probability of an action, beside the main one, that stays commanded: "two mins" is no wait, and "I'm walking
# that way" is nothing to do.
_LEAST_ACTION, _LEAST_OTHER = 0.05, 0.1
# Words for any vehicle; the network may know of which class it is.
_ANY_VEHICLE = ("vehicle", "vehicles", "motor vehicle", "motor vehicles")
# Probability of the grammar's main action above which it remains the main one.
_COMMANDED = 0.5
# Relations of a place on our way, for which a landmark that the grammar finds counts more than a person.
_ON_OUR_WAY = ("before", "past")
# Most words of a sentence whose vehicle without a class ("the white one") is found in the scene.
_SHORT = 6
# Pronouns of things, of which no other word tells the class.
_THINGS = ("it", "that", "this")


class Evidence(NamedTuple):
    """How well the grammar understood a sentence.

    Attributes:
        dropped: content words that it left out.
        corrected: words that it read as others.
        doubtful: whether it asks about a word.
        unknown: words that no lexicon holds.
        words: all words.
        contrary: whether it negates, excepts or corrects something.
        others: vehicles of its other steps.
        places: relations to these vehicles.
        turns: directions of its other steps.
    """

    dropped: int = 0
    corrected: int = 0
    doubtful: bool = False
    unknown: int = 0
    words: int = 0
    contrary: bool = False
    others: tuple[Referent, ...] = ()
    places: tuple[str, ...] = ()
    turns: tuple[str, ...] = ()

    @property
    def whole(self) -> bool:
        """Whether the grammar understood every word."""
        return not (self.dropped or self.corrected or self.doubtful or self.unknown)

    def numbers(self) -> Numbers:
        """Return (7,) a one and the bounded numbers."""
        counts = (self.dropped / 3, self.corrected / 2, float(self.doubtful), self.unknown / 3, self.words / 30)
        return np.array([1.0, *(min(one, 1.0) for one in counts), float(self.whole)])


@dataclass(frozen=True)
class Revision:
    """A query after the vote.

    Attributes:
        query: the query; its action is None if the sentence is no command.
        changed: (field, value of the grammar, value now) of the fields that were changed.
        sure: probability 0..1 that all of it is right.
    """

    query: Query
    changed: tuple[tuple[str, str, str], ...]
    sure: float


def status_numbers(query: Query, evidence: Evidence, prediction: Prediction) -> Numbers:
    """Return the features (9,) of the decision whether a sentence is a command."""
    choices = prediction.choices["status"]
    accepted = query.action is not None
    numbers = evidence.numbers()
    return np.array([1.0, log_odds(choices["ok"]), accepted, *(numbers[1:] * accepted)])


def command_odds(query: Query, evidence: Evidence, prediction: Prediction, rule: Mapping[str, Numbers]) -> float:
    """Return the log odds that a sentence is a command; arguments as in `revise`."""
    return float(status_numbers(query, evidence, prediction) @ rule["status"])


def reading_numbers(query: Query, odds: float, prediction: Prediction) -> Numbers:
    """Return the features (3,) of the probability that a reading is right.

    Args:
        query: the query after the vote.
        odds: log odds that it is a command.
        prediction: the network's probabilities.
    """
    together = math.exp(log_probability(query, prediction))
    return np.array([1.0, log_odds(min(together, 1.0)), min(odds / _MOST_ODDS, 1.0)])


def log_probability(query: Query, prediction: Prediction) -> float:
    """Return the log of the network's probability of the fields and qualifiers of a command together."""
    said = query.referent.qualifiers if query.referent else ()
    shares = [prediction.choices[field].get(field_value(query, field), 0.0) for field in FIELDS]
    shares += [share if one in said else 1 - share for one, share in prediction.qualifiers.items()]
    return sum(math.log(share + _LEAST) for share in shares)


def log_odds(probability: float) -> float:
    """Return the bounded log odds of a probability."""
    return math.log((probability + _LEAST) / (1 - probability + _LEAST))


def field_value(query: Query, field: str) -> str:
    """Return the value of a field of `FIELDS`, NONE without one."""
    holder: Any = query.referent if field in ("noun", "colour") else query
    return str(getattr(holder, field, None) or NONE)


def revise(query: Query, evidence: Evidence, prediction: Prediction, rule: Mapping[str, Numbers]) -> Revision:
    """Return the query after the vote of grammar and network.

    Args:
        query: the grammar's query; without an action if it finds no command.
        evidence: how well the grammar understood the sentence.
        prediction: the network's probabilities.
        rule: weights of the vote whether it is a command, "status" (9,), and of the probability that a reading is
            right, "reading" (3,).
    """
    odds = command_odds(query, evidence, prediction, rule)
    revised, changes = choose(query, odds, evidence, prediction)
    numbers = reading_numbers(revised, odds, prediction) @ rule["reading"] if revised.action else -odds
    return Revision(revised, changes, 1 / (1 + math.exp(-numbers)))


def choose(
    query: Query, odds: float, evidence: Evidence, prediction: Prediction
) -> tuple[Query, tuple[tuple[str, str, str], ...]]:
    """Return the likelier reading, and what it changes in the grammar's; `odds`: log odds that it is a command."""
    if query.action is None:
        if odds < _LEAST_ODDS:
            return query, ()
        return command_of(query.command, prediction), (("status", "reject", "ok"),)
    if odds < (_LEAST_ODDS_REFUSED if query.manoeuvre in REFUSED else _LEAST_ODDS_KEPT):
        return Query(query.command), (("status", "ok", "reject"),)
    other = _by_network(query, evidence, prediction)
    gain = log_probability(query, prediction) - log_probability(other, prediction)
    revised = query if gain >= -_trust(evidence) else other
    revised = replace(revised, actions=_commanded(revised, prediction))
    return revised, _changes(query, revised)


def _trust(evidence: Evidence) -> float:
    """Return what the grammar's reading gains; a negation that it understands whole may never become its opposite."""
    if evidence.whole and evidence.contrary:
        return math.inf
    if evidence.dropped or evidence.doubtful or evidence.unknown:
        return 0.0 if evidence.doubtful else _TRUST
    return _TRUST_WHOLE


def _by_network(query: Query, evidence: Evidence, prediction: Prediction) -> Query:
    """Return the grammar's query with the values of the network."""
    values = {field: prediction.best(field) for field in FIELDS}
    main = query.action
    if main is not None and (values["action"] in query.actions or prediction.actions[main] > _COMMANDED):
        values["action"] = main  # both are commanded: which one takes the vehicle is the grammar's
    # "The white one": the scene tells which vehicle that is. "That one": no word names a class.
    by_scene = query.sought is not None and not evidence.dropped and evidence.words <= _SHORT
    sure = query.unresolved in _THINGS or not (evidence.dropped or evidence.unknown)
    nameless = query.unresolved and not prediction.head and sure
    if by_scene or nameless:
        values["noun"] = NONE
    if evidence.whole and query.landmark == "secondary" and query.referent is None and values["relation"] == NONE:
        values["relation"] = query.relation  # the words name the landmark: "stay in this lane until the junction"
    if query.direction is not None and values["direction"] in evidence.turns:
        values["direction"] = query.direction  # "left and then the second right": it knows one direction
    if evidence.whole and {values["direction"], query.direction} == {"left", "right"}:
        values["direction"] = str(query.direction)  # a side that is said is never the other one: "the slow lane"
    values = _without_others(query, evidence, _in_words_of(query, values))
    read = _with_values(query, values, prediction, evidence.others)
    if query.referent is not None and read.referent is not None:  # it moves as is said, and we have passed it
        qualifiers, kept = read.referent.qualifiers, (*(STATES if evidence.whole else ()), "behind_ego")
        said = (one for one in query.referent.qualifiers if one in kept and one not in qualifiers)
        read = replace(read, referent=replace(read.referent, qualifiers=(*said, *qualifiers)))
    return read.at_excluded()


def _without_others(query: Query, evidence: Evidence, values: dict[str, str]) -> dict[str, str]:
    """Return the values of the network, those of the vehicles and places of other steps as the grammar's.

    The network knows one vehicle of a sentence: "pass the red car and stop behind the truck".
    """
    own = query.referent
    if own is None:
        return values
    mixed = {
        field: str(getattr(own, field) or NONE)
        for field in ("noun", "colour")
        if values[field] != NONE and any(getattr(one, field) == values[field] for one in evidence.others)
    }
    beside = [part.colour for part in query.secondary if part.of == "referent"]
    if evidence.whole and own.colour is None and values["colour"] in beside:
        mixed["colour"] = NONE  # "the car nearest to the red one"
    if NONE not in (query.relation, values["relation"]) and values["relation"] in evidence.places:
        mixed["relation"] = query.relation
    return {**values, **mixed}


def _in_words_of(query: Query, values: dict[str, str]) -> dict[str, str]:
    """Return the values of the network, those that say the same as the grammar's in other words as the grammar's."""
    same: dict[str, str] = {}
    if values["action"] == query.action == "follow" and values["relation"] == "toward":
        same["relation"] = query.relation  # "catch up with it": the place of a follower is behind it
    if values["relation"] == query.road_side == "opposite" and values["noun"] == NONE:
        same["relation"] = query.relation  # "on the other side of the road": the grammar has it as a side
    if query.landmark == "secondary" and {values["relation"], query.relation} == {"toward", "at"}:
        same["relation"] = query.relation  # up to a landmark is at it
    on_our_way = query.landmark == "secondary" and values["relation"] == query.relation and query.referent is None
    if on_our_way and query.relation in _ON_OUR_WAY and values["noun"] == "person":
        same |= {"noun": NONE, "colour": NONE}  # "someone's on the crossing, stop before it"
    return values | same


def _commanded(query: Query, prediction: Prediction) -> tuple[Action, ...]:
    """Return the actions of a query that the network takes for commanded too, and the main one."""
    least = {"other": _LEAST_OTHER}
    return tuple(
        one
        for one in query.actions
        if one == query.action or prediction.actions[one] >= least.get(one, _LEAST_ACTION)
    )


def query_of(command: str, prediction: Prediction) -> Query:
    """Return the network's own query, without an action if it takes the sentence for no command."""
    if prediction.best("status") == "reject":
        return Query(command)
    return command_of(command, prediction)


def command_of(command: str, prediction: Prediction) -> Query:
    """Return the network's reading of a command."""
    values = {field: prediction.best(field) for field in FIELDS}
    action: Any = values["action"]
    return _with_values(Query(command, action, (action,)), values, prediction)


def _with_values(
    query: Query, values: Mapping[str, str], prediction: Prediction, others: tuple[Referent, ...] = ()
) -> Query:
    """Return a query with the given values; what hangs on a changed value changes with it."""
    if values["noun"] == "person":
        query = _about_person(query)
        if any(part.of == "referent" and part.colour == values["colour"] for part in query.secondary):
            values = {**values, "colour": NONE}  # the colour of the vehicle beside the person
    referent = _referent(query.referent, values, _own_qualifiers(query, prediction, others), prediction.head)
    if referent is not None and _is_excluded(referent, query) and referent != query.referent:
        # The command excludes the other one, and the place at it.
        referent, values = query.referent, {**values, "relation": query.relation}
    action: Any = values["action"]
    relation: Any = values["relation"]
    direction: Any = None if values["direction"] == NONE else values["direction"]
    actions = tuple(action if one == query.action else one for one in query.actions)
    landmark = query.landmark
    if relation == NONE:
        landmark = None
    elif landmark is None or (landmark == "referent" and referent is None):
        landmark = "referent" if referent is not None else "secondary" if query.secondary else None
    return replace(
        query,
        action=action,
        actions=actions,
        relation=relation,
        direction=direction,
        landmark=landmark,
        referent=referent,
        unresolved="" if referent is not None else query.unresolved,
        sought=None if referent is not None else query.sought,
    )


def _own_qualifiers(query: Query, prediction: Prediction, others: tuple[Referent, ...]) -> tuple[str, ...]:
    """Return the network's qualifiers but those that the grammar finds elsewhere: "the van and the first car"."""
    of_others = {one for part in query.secondary for one in part.qualifiers}
    of_others |= {one for vehicle in others for one in vehicle.qualifiers}
    own = query.referent.qualifiers if query.referent else ()
    return tuple(one for one in prediction.likely_qualifiers if one in own or one not in of_others)


def _about_person(query: Query) -> Query:
    """Return a query about the person beside its vehicle, if there is one: "the man by the van" is no van."""
    vehicle, beside = query.referent, [one for one in query.secondary if one.of == "inverse"]
    person = next((one for one in beside if one.noun not in VEHICLES), None)
    if vehicle is None or vehicle.noun not in VEHICLES:
        return query
    if person is None:  # "pick up my daughter, she's by the blue van"
        where: Any = "near" if query.relation == NONE else query.relation
        at = Landmark(vehicle.noun, where, "referent", vehicle.colour, vehicle.qualifiers)
        return replace(query, referent=None, secondary=(*query.secondary, at))
    known = Landmark(vehicle.noun, person.relation, "referent", vehicle.colour, vehicle.qualifiers)
    secondary = tuple(known if one is person else one for one in query.secondary)
    return replace(query, referent=Referent("person", person.noun), secondary=secondary)


def _referent(
    said: Referent | None, values: Mapping[str, str], qualifiers: tuple[str, ...], head: str
) -> Referent | None:
    if values["noun"] == NONE:
        return None
    colour = None if values["colour"] == NONE else values["colour"]
    if said is None:
        return Referent(values["noun"], head or values["noun"], colour, qualifiers)
    kept = tuple(one for one in said.qualifiers if one in qualifiers or one not in QUALIFIERS)
    ordered = (*kept, *(one for one in qualifiers if one not in kept))
    optional = tuple(one for one in said.qualifiers_optional if one not in ordered)
    special = said.noun == "vehicle" and said.head not in _ANY_VEHICLE  # an ambulance is no other van
    named = said.head if special or said.noun == values["noun"] else head or values["noun"]
    return replace(
        said, noun=values["noun"], head=named, colour=colour, qualifiers=ordered, qualifiers_optional=optional
    )


def _is_excluded(referent: Referent, query: Query) -> bool:
    """Return whether a command rules out just such a vehicle; one that names no other, also a place at it."""
    return any(
        (one.relation is None or query.referent is None)
        and one.noun in (referent.noun, "vehicle")
        and one.colour in (None, referent.colour)
        and {*one.qualifiers} <= {*referent.qualifiers}
        for one in query.excluded
    )


def _changes(before: Query, after: Query) -> tuple[tuple[str, str, str], ...]:
    pairs = [(field, field_value(before, field), field_value(after, field)) for field in FIELDS]
    said, now = (" ".join(sorted(one.referent.qualifiers)) if one.referent else "" for one in (before, after))
    pairs.append(("qualifiers", said or NONE, now or NONE))
    if len(after.actions) < len(before.actions):
        pairs.append(("actions", " ".join(before.actions), " ".join(after.actions)))
    return tuple(pair for pair in pairs if pair[1] != pair[2])
