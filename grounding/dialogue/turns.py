"""What a turn of a conversation does: the reader of turns and the grammar vote on its act."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, get_args

from grounding.dialogue.conversation import Conversation
from grounding.dialogue.fragments import begins_with_place, carries_on, has_verb, is_understood, names_pronoun
from grounding.language import Reading, WordCategory
from grounding.language.reader.fields import ACTS, FIELDS, NONE
from grounding.language.reader.network import Numbers, Prediction
from grounding.language.reader.revision import command_of, field_value
from grounding.language.reader.turns import State, default_turn_reader
from grounding.language.replies import SHIFTS, Reply, named_distance
from grounding.language.syntax.noun_phrases import named_clothes
from grounding.language.syntax.tokenizer import Token, normalise, tokenise
from grounding.query import Exclusion, Query, Referent
from grounding.vocabulary import POSITIONS, Action, Relation, ShiftDirection

# Least probability of an act that is taken.
_SURE = 0.55
_LEAST = 1e-4
# Least probability of an act where the grammar finds nothing, and acts that need no other word: they are not tried.
_LIKELY, _BARE = 0.3, ("cancel", "drop", "yes", "no")
# Least probability of a colour that is tried where no vehicle has the likeliest.
_LEAST_COLOUR = 0.02
# Acts that choose and change nothing: chat, and questions. A sentence that is one is left out beside others.
ASIDES = ("remark", "pause", "why", "about", "seek", "seen", "count", "room", "heading", "repeat")
# Acts that choose another vehicle or change its place.
_CHANGES = ("number", "middle", "following", "previous", "describe", "place", "shift", "more", "less")
# Acts that a command or a description in the words may stand for.
DOING = tuple(one for one in ACTS if one not in (*ASIDES, "yes", "no", "any", "neither", "cancel"))
# Least probability that all is to be dropped, and of an act that nothing else in the turn supports.
_SURE_CANCEL, _CERTAIN = 0.9, 0.9
# Least probability of a reply where the grammar finds a command.
_SURE_AGAINST = 0.75
# The same where a pattern covers all words.
_SURE_AGAINST_PATTERN = 0.8
# Least probability at which a command that only the network understands is acted upon.
_SURE_COMMAND = 0.8
# Least probability of a relation that counts more than the grammar's.
_SURE_RELATION = 0.9
# What counts more than an act, if the grammar finds it: "all right, wait behind it", "no, four".
_DETAILED = {"yes": ("command", "number"), "no": ("number",), "remark": ("command", "number"), "pause": ("command",)}
# Acts in which a number without a unit is a distance, and the most words of such a turn.
_MEASURED, _FEW_WORDS = ("more", "less", "shift"), 6
# Least probability of all acts that do something.
_LEAST_DOING = 0.25
# Numbers as a recogniser of speech may write them, and the most words of a turn that is one: "number too".
_FEWEST_WORDS = 3
_HEARD_NUMBERS = {"won": 1, "too": 2, "to": 2, "for": 4, "fore": 4, "ate": 8}
# Kinds of the patterns of replies that have another name as acts.
ACTS_OF_KINDS = {"thanks": "remark", "former": "number", "latter": "number"} | dict.fromkeys(SHIFTS, "shift")
# Kinds that the network has not learnt.
_UNLEARNT = ("roomiest",)


@dataclass(frozen=True)
class Turn:
    """Dialogue act and slots of a turn.

    Attributes:
        act: dialogue act, one of `ACTS`.
        sure: probability of the act after the vote.
        prediction: the network's probabilities of the fields.
        number: number or ordinal that it names, -1 for the last; None without one.
        distance_m: distance that it names; None without one.
        needed: least probability of the act at which it overrules the grammar.
        rules_out: whether the described vehicle is excluded: "no trailer".
        rules_out_place: whether the only relation is negated: "not behind the red one".
        clothes: colour of the clothes that it names; None without.
    """

    act: str
    sure: float
    prediction: Prediction
    number: int | None = None
    distance_m: float | None = None
    needed: float = 0.0
    rules_out: bool = False
    rules_out_place: bool = False
    clothes: str | None = None

    @property
    def is_sure(self) -> bool:
        """Whether the act is believed whatever the grammar finds."""
        return self.sure >= self.needed

    @property
    def is_certain(self) -> bool:
        """Whether the act is believed where nothing else in the turn supports it."""
        return self.sure >= _CERTAIN

    @property
    def likely_acts(self) -> list[str]:
        """Acts that are believed where the grammar finds nothing, likeliest first."""
        shares = self.prediction.choices["act"]
        likely = [one for one in shares if shares[one] >= _LIKELY and one not in _BARE]
        return sorted(likely, key=lambda one: -shares[one])

    @property
    def answers_by_description(self) -> bool:
        """Whether a yes or no may be a description: "yes, the grey one"."""
        return self.act in ("yes", "no") and self.prediction.choices["act"]["describe"] >= _LIKELY

    @property
    def is_change(self) -> bool:
        """Whether it chooses or changes something for certain, by one act or another, and is no command."""
        shares = self.prediction.choices["act"]
        return self.needed <= _SURE and sum(shares[one] for one in _CHANGES) >= _CERTAIN

    @property
    def is_likely_command(self) -> bool:
        """Whether it may ask for something new."""
        shares = self.prediction.choices["act"]
        return shares["command"] + shares["then"] >= _LIKELY

    @property
    def is_chat(self) -> bool:
        """Whether it hardly does anything, whatever command the grammar finds in it."""
        shares = self.prediction.choices["act"]
        return not self.is_sure and sum(shares[one] for one in DOING) < _LEAST_DOING

    @property
    def names_vehicle(self) -> bool:
        """Whether it certainly names the class or the colour of a vehicle."""
        choices = self.prediction.choices
        return min(choices["noun"][NONE], choices["colour"].get(NONE, 0.0)) < 1 - _CERTAIN

    def best(self, field: str) -> str:
        """Return the likeliest value of a field."""
        return self.prediction.best(field)

    @property
    def leaves_out(self) -> Referent | None:
        """The vehicle whose step is given up, None for other turns: "skip the truck"."""
        shares = self.prediction.choices["act"]
        leaves = self.rules_out or shares["drop"] + shares["cancel"] >= _SURE
        return self.described(None) if self.names_vehicle and leaves else None

    @property
    def shift(self) -> ShiftDirection:
        """The likeliest direction of a shift."""
        best = self.best("shift")
        return next(one for one in SHIFTS if one == best)

    @property
    def action(self) -> Action:
        """The likeliest action."""
        best = self.best("action")
        return next(one for one in get_args(Action) if one == best)

    @property
    def relation(self) -> str:
        """The likeliest relation; to go to another vehicle instead keeps the one in force."""
        best = self.best("relation")
        return NONE if self.act == "describe" and best == "toward" else best

    def described(self, antecedent: Referent | None) -> Referent | None:
        """Return the vehicle that it describes, where it names none like the antecedent; None for no description."""
        noun, colour = self.best("noun"), self.best("colour")
        qualifiers, side = self.prediction.likely_qualifiers, self.best("goal_side")
        if noun == colour == NONE and not qualifiers and side != NONE and self.act == "describe":
            qualifiers = (f"{side}_side",)  # "right-hand kerb"
        if noun == colour == NONE and not qualifiers:
            return None
        named = None if colour == NONE else colour
        if noun != NONE:
            worn = self.clothes if noun == "person" else None
            return Referent(noun, self.prediction.head or noun, named, qualifiers, clothes=worn)
        like = antecedent or Referent("vehicle", "one")
        return Referent(like.noun, like.head, named or like.colour, qualifiers, anaphora=True)

    def descriptions(self, antecedent: Referent | None) -> list[Referent]:
        """Return what it describes, first as by `described`, then with its other likely colours, and without one."""
        best = self.described(antecedent)
        if best is None:
            return []
        shares = self.prediction.choices["colour"]
        likely = sorted((one for one in shares if shares[one] > _LEAST_COLOUR), key=lambda one: -shares[one])
        others = (None if one == NONE else one for one in (*likely, NONE))
        return [best, *(replace(best, colour=one) for one in dict.fromkeys(others) if one != best.colour)]

    def as_command(self, reading: Reading) -> Reading:
        """Return the reading of a command, with that of the network where it has none; what both say is no doubt."""
        own = command_of(reading.query.command, self.prediction)
        if reading.problem and self.sure >= _SURE_COMMAND:
            return replace(reading.with_query(own), problem=None)
        qualifiers = [{*one.referent.qualifiers} if one.referent else set() for one in (own, reading.query)]
        alike = all(field_value(own, field) == field_value(reading.query, field) for field in FIELDS)
        return replace(reading, doubt="") if reading.revised and alike and qualifiers[0] == qualifiers[1] else reading

    @property
    def is_plain(self) -> bool:
        """Whether it certainly names both a vehicle and a place: "she's by the green car, go behind that"."""
        return self.names_vehicle and self._names_place

    @property
    def shifts_to_place(self) -> bool:
        """Whether a shift may as well be a place that is certainly named: "make that five metres in front"."""
        return self.act == "shift" and self._names_place and self.prediction.choices["act"]["place"] >= _LIKELY

    @property
    def _names_place(self) -> bool:
        best = self.relation
        return best != NONE and self.prediction.choices["relation"][best] > _SURE_RELATION

    def replaces(self, reading: Reading | None) -> bool:
        """Return whether its place counts more than that of the grammar: "not behind, in front"."""
        own = reading.query.relation if reading is not None else NONE
        best = self.best("relation")
        return (
            reading is None
            or (self.names_vehicle and names_pronoun(reading))
            or own == NONE != best
            or (own != best and self.prediction.choices["relation"][best] > _SURE_RELATION)
        )

    def without_place(self, text: str, antecedent: Referent | None) -> Query | None:
        """Return the partial query that excludes the place which it names at a vehicle; None for other turns."""
        named = self.described(antecedent) if self.rules_out_place and self.names_vehicle else None
        relation = next((one for one in get_args(Relation) if one == self.best("relation") != NONE), None)
        if named is None or relation is None:
            return None
        return Query(text, excluded=(Exclusion(relation, named.noun, named.colour, named.qualifiers),))

    def placed(self, text: str, antecedent: Referent | None) -> Query | None:
        """Return the partial query of the place and the vehicle that it names; None if it names no place."""
        relation, side = self.relation, self.best("goal_side")
        if relation == side == NONE and self.distance_m is None:
            return None
        slots: dict[str, Any] = {"goal_side": None if side == NONE else side}
        named = self.best("noun") != NONE or self.best("colour") != NONE
        if relation == "opposite" and not named and antecedent is None:
            slots |= {"road_side": "opposite"}  # "on the other side", without a vehicle
        elif relation != NONE:
            slots |= {"relation": relation, "landmark": "referent"}
        if self.distance_m is not None:
            slots |= {"distance_m": self.distance_m, "distance_of": "referent"}
        return Query(text, referent=self.described(antecedent) if named else None, **slots)


def predict_turn(talk: Conversation, text: str, reply: Reply) -> tuple[Sequence[Token], Prediction | None]:
    """Return the tokens of some words, and what the network predicts; None for no words."""
    tokens = tokenise(normalise(text), talk.grounder.lexicon)
    state, command = state_of(talk), talk.state.request.query if talk.state.request is not None else None
    key = text, state, command
    if key not in talk.predictions:
        talk.predictions[key] = default_turn_reader().read(tokens, state, reply, command)
    return tokens, talk.predictions[key]


def read_turn(talk: Conversation, text: str, reply: Reply) -> Turn | None:
    """Read a turn; None where the patterns of replies read it alike, or it has no words.

    Args:
        talk: the conversation.
        text: the turn.
        reply: the turn as the patterns of replies split it.
    """
    tokens, prediction = predict_turn(talk, text, reply)
    if prediction is None or (reply.kinds[-1:] and reply.kinds[-1] in _UNLEARNT):
        return None
    reading = talk.read(reply.rest or text)
    own = own_act(reply, reading)
    scores = vote_on_act(prediction.choices["act"], own, default_turn_reader().rule["act"])
    act = max(scores, key=scores.__getitem__)
    if act == "yes" and reply.rest and begins_with_place(reply.rest, talk.readings):
        act = "place"  # "ok, behind it is fine then": at an offer, it is the same wish again
    # "Hold up, wait a sec" is a pause, a bare "wait" a command.
    says_it = own[0] != "command" or _names_something(reading) or len(reading.tokens) == 1
    # "Do carry on" agrees with the goal in force.
    says_it = says_it and not carries_on(reading)
    detailed = own[0] in _DETAILED.get(act, ()) and says_it
    if (act == own[0] and act not in ("command", "undo")) or detailed:
        return None  # the patterns of replies, or the grammar, know the details
    if act == "cancel" and own[0] == "no" and own[1] == 1:
        return None  # "leave it as it is" gives nothing up
    if act == "place" and own[0] == "command" and reading.query.relation == prediction.best("relation") != NONE:
        return None  # "wait behind it then" is another action too
    number, distance_m = reply.number or _number(tokens), named_distance(text, talk.grounder.lexicon)
    if number is None and act == "number" and len(tokens) <= _FEWEST_WORDS:
        number = next((_HEARD_NUMBERS[one.text] for one in tokens if one.text in _HEARD_NUMBERS), None)
    counted = any(one.category is WordCategory.NUMBER for one in tokens) and len(tokens) <= _FEW_WORDS
    # "Leave six".
    bare = act == "place" and all(prediction.best(field) == NONE for field in ("relation", "noun", "colour"))
    if distance_m is None and (act in _MEASURED or bare) and counted:
        distance_m = number and float(number)  # "three more": metres
    needed = _least_probability(talk, reply, reading, act, own)
    # To drop the only step is to drop all.
    drops_all = act == "cancel" and len(talk.state.plan) == 1
    sure = scores[act] + (scores["drop"] if drops_all else 0.0)
    rules_out, rules_out_place = _rules_out(tokens), _rules_out_place(tokens)
    clothes = named_clothes(reading.tokens)
    return Turn(act, sure, prediction, number, distance_m, needed, rules_out, rules_out_place, clothes)


def _least_probability(talk: Conversation, reply: Reply, reading: Reading, act: str, own: tuple[str, int]) -> float:
    """Return the least probability at which an act is believed whatever the grammar finds."""
    doubted = _is_command(reading) and act not in ("command", "then")
    # "Don't wait" may be about one step only, and "skip the stop".
    partly = doubted or "without" in reply.kinds or len(talk.state.plan) > 1
    if (own[0] and own[1] == 1) or (act == "cancel" and reply.rest and partly):
        return _SURE_AGAINST_PATTERN
    if act == "cancel":
        return _SURE_CANCEL
    return _SURE_AGAINST if doubted else _SURE


def _is_command(reading: Reading) -> bool:
    """Return whether the grammar understands a command that asks for, or forbids, something: "move up" does not."""
    forbids = any(token.category is WordCategory.NOT for token in reading.tokens)
    asks = _names_something(reading) or forbids or reading.query.action != "other"
    return has_verb(reading) and is_understood(reading) and asks


def names_command(reading: Reading) -> bool:
    """Return whether the grammar understands a command that says where, about what or how to drive."""
    return has_verb(reading) and is_understood(reading) and _names_something(reading)


def _names_something(reading: Reading) -> bool:
    """Return whether a command says about what, or where."""
    query = reading.query
    named = query.referent or query.secondary or query.direction or query.manoeuvre or query.relation != "none"
    return bool(named)


def state_of(talk: Conversation) -> State:
    """Return where a conversation stands."""
    question = talk.state.question
    if question is not None:
        return "which" if len(question.alternatives or question.candidates) > 1 else "offer"
    return "goal" if talk.state.goal is not None else "lost"


def own_act(reply: Reply, reading: Reading) -> tuple[str, int]:
    """Return the act of a turn by the grammar, '' if it is not certain, and the index of its vote in the rule."""
    if reply.number is not None:
        return "number", 1
    if reply.kinds and not reply.rest:
        return ACTS_OF_KINDS.get(reply.kinds[-1], reply.kinds[-1]), 1
    if reply.rest and has_verb(reading) and is_understood(reading):
        return ("then" if "then" in reply.kinds else "command"), 2
    return "", 1


def vote_on_act(shares: Mapping[str, float], own: tuple[str, int], weights: Numbers) -> dict[str, float]:
    """Return act -> probability after the vote.

    Args:
        shares: the network's probabilities.
        own: act of the grammar, as `own_act` returns it.
        weights: (3,) of the network's log probability, of a reply that covers all words, of a plain command.
    """
    act, vote = own
    scores = {
        name: float(weights[0]) * math.log(share + _LEAST) + (float(weights[vote]) if name == act else 0.0)
        for name, share in shares.items()
    }
    top = max(scores.values())
    total = sum(math.exp(one - top) for one in scores.values())
    return {name: math.exp(one - top) / total for name, one in scores.items()}


def _rules_out(tokens: Sequence[Token]) -> bool:
    """Return whether a turn excludes the described vehicle: "no trailer", "without the van"; not "no, the van"."""
    named = (WordCategory.NOUN, WordCategory.COLOUR)
    return any(
        one.category is WordCategory.NOT and (one.text == "without" or after.category in named)
        for one, after in pairwise(tokens)
    )


def _rules_out_place(tokens: Sequence[Token]) -> bool:
    """Return whether the only relation of a turn is negated: not "not behind, in front"."""
    relations = [i for i, one in enumerate(tokens) if one.category is WordCategory.RELATION]
    return len(relations) == 1 and relations[0] > 0 and tokens[relations[0] - 1].category is WordCategory.NOT


def _number(tokens: Sequence[Token]) -> int | None:
    """Return the only ordinal among some words, else the only number; None without one."""
    ordinals, numbers = (
        [token for token in tokens if token.category is category]
        for category in (WordCategory.ORDINAL, WordCategory.NUMBER)
    )
    named = ordinals or numbers  # "there are two of them, the first one"
    if len(named) != 1:
        return None
    if named[0].category is WordCategory.ORDINAL:
        return -1 if named[0].value == "last" else POSITIONS.get(named[0].value)
    value = float(named[0].value)
    return int(value) if value.is_integer() else None
