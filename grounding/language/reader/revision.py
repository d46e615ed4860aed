"""Revision of the grammar's reading of a sentence by the reader network, field by field.

Grammar and network vote: the score of a value is the network's log probability, times a weight, plus the grammar's
vote if it is its own value. The vote of the grammar is less where it left words out, corrected words or doubts them.
The weights are learnt by `python -m benchmarks.train_reader` on speakers that the network did not see.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from grounding.language.reader.fields import FIELDS, NONE, QUALIFIERS, VEHICLES
from grounding.language.reader.network import Numbers, Prediction
from grounding.query import Exclusion, Landmark, Query, Referent
from grounding.vocabulary import REFUSED, Action

# Least probability of a value that counts.
_LEAST = 1e-4
# What the grammar's vote gains where it understood every word (nats; a field, a qualifier that it has): it keeps to
# the rules of the labelled files, of which the authors of the sentences knew little.
_TRUST, _TRUST_QUALIFIER = 3.0, 1.5
# Least probability of the class of a vehicle that the grammar does not find.
_LEAST_GUESS = 0.5
# Probability above which the network may change "mind the van" to another action.
_CERTAIN = 0.9
# Least log odds at which a sentence is a command that the grammar takes for none, and at which it remains one: the
# weights are fitted on sentences of which seven in eight are commands.
_LEAST_ODDS, _LEAST_ODDS_KEPT = 2.5, 1.0
# Log odds of a command beyond which they tell no more of its reading.
_MOST_ODDS = 6.0
# Least probability of an action, beside the main one, that stays commanded: "two mins" is no wait, and "I'm walking
# that way" is nothing to do.
_LEAST_ACTION, _LEAST_OTHER = 0.05, 0.1
# Most words of a sentence whose vehicle without a class ("the white one") is found in the scene.
_SHORT = 6
# Actions that may stand for what a sentence forbids: "don't overtake it" is `other`.
_FORBIDDING = ("other", "wait", "slow_down", "give_way")


class Evidence(NamedTuple):
    """How well the grammar understood a sentence.

    Attributes:
        dropped: content words that it left out.
        corrected: words that it read as others.
        doubtful: whether it asks about a word.
        unknown: words that no lexicon holds.
        words: all words.
        contrary: whether it negates, excepts or corrects something.
    """

    dropped: int = 0
    corrected: int = 0
    doubtful: bool = False
    unknown: int = 0
    words: int = 0
    contrary: bool = False

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


def vote(own: str, evidence: Evidence, probabilities: Mapping[str, float], weights: Numbers) -> dict[str, float]:
    """Return value -> score of one field; weights (8,): of the network's log probability, of the evidence."""
    bonus = max(float(evidence.numbers() @ weights[1:]), 0.0)  # what both say is never doubted
    values = {**dict.fromkeys([own], 0.0), **probabilities}
    return {
        value: float(weights[0]) * math.log(share + _LEAST) + (bonus if value == own else 0.0)
        for value, share in values.items()
    }


def qualifier_numbers(said: bool, evidence: Evidence, probability: float) -> Numbers:
    """Return the features (15,) of the vote on one qualifier; `said`: whether the grammar has it."""
    numbers = evidence.numbers()
    return np.array([log_odds(probability), *(numbers * said), *(numbers * (not said))])


def reading_numbers(query: Query, odds: float, prediction: Prediction) -> Numbers:
    """Return the features (3,) of the probability that a reading is right.

    Args:
        query: the query after the vote.
        odds: log odds that it is a command.
        prediction: the network's probabilities.
    """
    said = query.referent.qualifiers if query.referent else ()
    shares = [prediction.choices[field].get(field_value(query, field), 0.0) for field in FIELDS]
    shares += [share if one in said else 1 - share for one, share in prediction.qualifiers.items()]
    together = math.exp(sum(math.log(share + _LEAST) for share in shares))
    return np.array([1.0, log_odds(min(together, 1.0)), min(odds / _MOST_ODDS, 1.0)])


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
        rule: weights of the votes: "status" (9,), "qualifier" (15,), and each field of `FIELDS` (8,); of the reading:
            "reading" (3,).
    """
    odds = command_odds(query, evidence, prediction, rule)
    revised, changes = vote_on_all(query, odds, evidence, prediction, rule)
    numbers = reading_numbers(revised, odds, prediction) @ rule["reading"] if revised.action else -odds
    return Revision(revised, changes, 1 / (1 + math.exp(-numbers)))


def vote_on_all(
    query: Query, odds: float, evidence: Evidence, prediction: Prediction, rule: Mapping[str, Numbers]
) -> tuple[Query, tuple[tuple[str, str, str], ...]]:
    """Return the query after the vote, and what was changed; `odds`: log odds that it is a command."""
    if query.action is None:
        if odds < _LEAST_ODDS:
            return query, ()
        return command_of(query.command, prediction), (("status", "reject", "ok"),)
    if odds < _LEAST_ODDS_KEPT and query.manoeuvre not in REFUSED:
        return Query(query.command), (("status", "ok", "reject"),)
    values = _vote_on_fields(query, evidence, prediction, rule)
    qualifiers = _vote_on_qualifiers(query, evidence, prediction, rule)
    revised = _with_values(query, values, qualifiers, prediction)
    revised = replace(revised, actions=_commanded(revised, prediction))
    return revised, _changes(query, revised)


def _vote_on_fields(
    query: Query, evidence: Evidence, prediction: Prediction, rule: Mapping[str, Numbers]
) -> dict[str, str]:
    """Return the value of each field after the vote."""
    values = {}
    for field in FIELDS:
        own = field_value(query, field)
        shares = prediction.choices[field]
        scores = vote(own, evidence, shares, rule[field])
        scores[own] += _TRUST * evidence.whole
        best = max(scores, key=scores.__getitem__)
        certain = shares.get(best, 0.0) > _CERTAIN
        values[field] = own if _may_be_opposite(field, own, best, evidence, certain) else best
    if values["action"] in query.actions and query.action is not None:
        values["action"] = query.action  # both are commanded: which one takes the vehicle is the grammar's
    # "The white one": the scene tells which vehicle that is. "That one": no word names a class.
    by_scene = query.sought is not None and not evidence.dropped and evidence.words <= _SHORT
    nameless = query.unresolved and not (prediction.head or evidence.dropped or evidence.unknown)
    guessed = query.referent is None and prediction.choices["noun"].get(values["noun"], 0.0) < _LEAST_GUESS
    if by_scene or nameless or guessed:
        values["noun"] = NONE
    return values


def _vote_on_qualifiers(
    query: Query, evidence: Evidence, prediction: Prediction, rule: Mapping[str, Numbers]
) -> tuple[str, ...]:
    """Return the qualifiers of the vehicle after the vote."""
    said = query.referent.qualifiers if query.referent else ()
    return tuple(
        one
        for one, probability in prediction.qualifiers.items()
        if qualifier_numbers(one in said, evidence, probability) @ rule["qualifier"]
        > (-_TRUST_QUALIFIER * evidence.whole if one in said else 0.0)
        and (one in said or not evidence.contrary)  # "not parked on the right"
    )


def _commanded(query: Query, prediction: Prediction) -> tuple[Action, ...]:
    """Return the actions of a query that the network takes for commanded too, and the main one."""
    least = {"other": _LEAST_OTHER}
    return tuple(
        one
        for one in query.actions
        if one == query.action or prediction.actions[one] >= least.get(one, _LEAST_ACTION)
    )


def _may_be_opposite(field: str, own: str, other: str, evidence: Evidence, certain: bool) -> bool:
    """Return whether another value, which may be all but certain, might turn a sentence into its opposite."""
    if field == "action":
        return (own == "avoid" and not certain) or (evidence.contrary and (own in _FORBIDDING or other == "other"))
    return field == "direction" and evidence.contrary


def query_of(command: str, prediction: Prediction) -> Query:
    """Return the network's own query, without an action if it takes the sentence for no command."""
    if prediction.best("status") == "reject":
        return Query(command)
    return command_of(command, prediction)


def command_of(command: str, prediction: Prediction) -> Query:
    """Return the network's reading of a command."""
    values = {field: prediction.best(field) for field in FIELDS}
    qualifiers = tuple(one for one, probability in prediction.qualifiers.items() if probability > 0.5)
    action: Any = values["action"]
    return _with_values(Query(command, action, (action,)), values, qualifiers, prediction)


def _with_values(
    query: Query, values: Mapping[str, str], qualifiers: tuple[str, ...], prediction: Prediction
) -> Query:
    """Return a query with the given values; what hangs on a changed value changes with it."""
    if values["noun"] == "person":
        query = _about_person(query)
    referent = _referent(query.referent, values, qualifiers, prediction.head)
    if referent is not None and _is_excluded(referent, query.excluded) and referent != query.referent:
        referent = query.referent  # the command excludes the other one
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


def _about_person(query: Query) -> Query:
    """Return a query about the person beside its vehicle, if there is one: "the man by the van" is no van."""
    vehicle, beside = query.referent, [one for one in query.secondary if one.of == "inverse"]
    person = next((one for one in beside if one.noun not in VEHICLES), None)
    if vehicle is None or person is None or vehicle.noun not in VEHICLES:
        return query
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
    named = said.head if said.noun == values["noun"] else head or values["noun"]
    return replace(
        said, noun=values["noun"], head=named, colour=colour, qualifiers=ordered, qualifiers_optional=optional
    )


def _is_excluded(referent: Referent, excluded: tuple[Exclusion, ...]) -> bool:
    """Return whether a command rules out just such a vehicle."""
    return any(
        one.relation is None
        and one.noun in (referent.noun, "vehicle")
        and one.colour in (None, referent.colour)
        and {*one.qualifiers} <= {*referent.qualifiers}
        for one in excluded
    )


def _changes(before: Query, after: Query) -> tuple[tuple[str, str, str], ...]:
    pairs = [(field, field_value(before, field), field_value(after, field)) for field in FIELDS]
    said, now = (" ".join(sorted(one.referent.qualifiers)) if one.referent else "" for one in (before, after))
    pairs.append(("qualifiers", said or NONE, now or NONE))
    if len(after.actions) < len(before.actions):
        pairs.append(("actions", " ".join(before.actions), " ".join(after.actions)))
    return tuple(pair for pair in pairs if pair[1] != pair[2])
