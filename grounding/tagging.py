"""Words that are several things: what each is in its sentence, by its neighbours."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

from grounding.kinds import NOUNS, Kind
from grounding.tokens import Token

DETERMINERS = frozenset((Kind.THE, Kind.ANY, Kind.POSSESSIVE))
MODIFIERS = frozenset(
    (Kind.COLOUR, Kind.SHADE, Kind.ORDINAL, Kind.SUPERLATIVE, Kind.STATE, Kind.SIZE, Kind.EXTRA, Kind.MAKE)
)
HEADS = NOUNS | {Kind.MAKE, Kind.MODEL, Kind.ONE}
_INSIDE = MODIFIERS | HEADS | {Kind.UNKNOWN, Kind.NUMBER}
_STARTS = DETERMINERS | _INSIDE | {Kind.THAT}
_OURS = frozenset((Kind.EGO, Kind.BREAK, Kind.COMMA, Kind.THEN, Kind.AND))
_ENDS_CLAUSE = frozenset((Kind.BREAK, Kind.THEN))
_PREDICATE = frozenset((Kind.VERB, Kind.BE, Kind.AUX, Kind.EGO, Kind.NOT, Kind.QUESTION, Kind.MEANWHILE))
# Verbs that are also nouns: "the next turn", "at that stop".
_NOUN_VERBS = {"park": "park", "stop": "stop", "turn": "turn", "pass": "pass", "drive": "driveway", "exit": "exit"}
_DIRECTED = ("turn left", "turn right", "turn around")


class _Split(NamedTuple):
    """A phrase that is two, after some kinds: "when the bus stops", "turn left, then right after the van"."""

    after: frozenset[Kind]
    kinds: tuple[Kind, Kind]
    values: tuple[str, str]
    event: str = ""

    def of(self, token: Token) -> tuple[Token, Token]:
        """Both words."""
        first, second = token.text.split()
        middle = token.start + len(first)
        form = "s" if self.event else ""
        return (
            Token(self.kinds[0], self.values[0], first, first, token.start, middle),
            Token(self.kinds[1], self.values[1], second, second, middle + 1, token.end, form, "stopped", self.event),
        )


_SPLIT = {
    "bus stops": _Split(DETERMINERS | {Kind.COLOUR, Kind.THAT}, (Kind.NOUN, Kind.VERB), ("bus", "stop"), "stop"),
    "right after": _Split(frozenset((Kind.THEN, Kind.AND)), (Kind.DIRECTION, Kind.SUB), ("right", "after")),
    "right before": _Split(frozenset((Kind.THEN, Kind.AND)), (Kind.DIRECTION, Kind.SUB), ("right", "before")),
}


def tag(tokens: Sequence[Token]) -> list[Token]:
    """The tokens that bear meaning, each as what it is here; fillers are left out."""
    tagged: list[Token] = []
    kept = [token for token in _counted(tokens) if token.kind is not Kind.FILLER]
    for i, token in enumerate(kept):
        after = kept[i + 1 : i + 6]
        if (rule := _RULES.get(token.kind)) is not None:
            tagged.append(rule(tagged, token, after))
        elif (parts := _SPLIT.get(token.text)) is not None and _kind(tagged, -1) in parts.after:
            tagged += parts.of(token)
        else:
            tagged.append(token)
    return [token for token in tagged if token.kind is not Kind.FILLER]


def _counted(tokens: Sequence[Token]) -> list[Token]:
    """Numbers with their units as one DISTANCE in metres; times are left out."""
    counted: list[Token] = []
    i = 0
    while i < len(tokens):
        end, value, any_number = i, 0.0, False
        while end < len(tokens) and (amount := _amount(tokens, end)) is not None:
            # "two hundred" multiplies, "twenty five" adds.
            value = value * amount if any_number and amount in (100, 1000) else value + amount
            any_number, end = True, end + 1
            if end + 1 < len(tokens) and tokens[end].kind is Kind.AND and (_amount(tokens, end + 1) or 1) < 1:
                end += 1  # "two and a half"
        article = end == i and tokens[i].kind is Kind.ANY
        unit_at = end + article
        unit = tokens[unit_at] if unit_at < len(tokens) and (any_number or article) else None
        if unit is not None and unit.kind is Kind.UNIT:
            counted.append(_joined(tokens[i : unit_at + 1], (value if any_number else 1.0) * float(unit.value)))
            i = unit_at + 1
        elif unit is not None and unit.kind is Kind.TIME:
            i = unit_at + 1
        else:
            counted.append(tokens[i])
            i += 1
    return counted


def _amount(tokens: Sequence[Token], i: int) -> float | None:
    token = tokens[i]
    if token.kind is Kind.NUMBER:
        return float(token.value)
    followed = i + 1 < len(tokens) and tokens[i + 1].kind in (Kind.UNIT, Kind.TIME)
    return 1.0 if token.kind is Kind.ONE and token.text == "one" and followed else None


def _joined(tokens: Sequence[Token], metres: float) -> Token:
    text, meant = (" ".join(part) for part in zip(*((t.text, t.meant) for t in tokens), strict=True))
    return Token(Kind.DISTANCE, f"{metres:.10g}", text, meant, tokens[0].start, tokens[-1].end)


def _kind(tokens: Sequence[Token], i: int) -> Kind:
    """The kind of the i-th token, BREAK beyond the ends."""
    return tokens[i].kind if -len(tokens) <= i < len(tokens) else Kind.BREAK


def _that(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    following = _kind(after, 0)
    if _kind(before, -1) in HEADS | {Kind.WHERE, Kind.SIDE, Kind.PRONOUN} and following in _PREDICATE:
        return token.of_kind(Kind.WHICH)
    if following in _INSIDE or (following is Kind.VERB and _adjective(before, after[0], after[1:])):
        return token.of_kind(Kind.THE)
    if following in DETERMINERS:
        return token.of_kind(Kind.WHICH if _kind(before, -1) in HEADS else Kind.FILLER)
    return token.of_kind(Kind.PRONOUN)


def _adjective(before: Sequence[Token], verb: Token, after: Sequence[Token]) -> bool:
    """Whether a verb stands before its noun: "parked black car", "the moving van"."""
    if verb.form not in ("ing", "past") or not verb.state or _kind(after, 0) not in MODIFIERS | HEADS:
        return False
    return verb.form == "past" or _kind(before, -1) in DETERMINERS | MODIFIERS | {Kind.RELATION, Kind.THAT}


def _verb(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    last = _kind(before, -1)
    if last in _ENDS_CLAUSE and after and after[0].text in ("is", "was"):
        return token.of_kind(Kind.THING, token.text)  # "park is closed"
    if _adjective(before, token, after) and last not in HEADS:
        return token.of_kind(Kind.STATE, token.state)
    if token.text == "lets" and last in _ENDS_CLAUSE | {Kind.COMMA}:
        return token.of_kind(Kind.FILLER)  # "lets park here"
    if token.value in _DIRECTED and after and after[0].text.startswith("lane"):
        return token.of_kind(Kind.VERB, token.value.replace("turn", "change_lane"))  # "take the left lane"
    if token.meant == "pull in" and after and after[0].text == "front of":
        return token.of_kind(Kind.VERB, "pull")
    if token.form == "ing" and last in DETERMINERS and _kind(after, 0) in HEADS | {Kind.COLOUR}:
        return token.of_kind(Kind.EXTRA)
    named = last in DETERMINERS or (last in MODIFIERS and _kind(before, -2) in DETERMINERS)
    if named and not token.form and token.value not in _DIRECTED and " " not in token.text:
        return token.of_kind(Kind.THING, _NOUN_VERBS.get(token.value, token.text))
    if token.text == "passed" and last in (Kind.VERB, Kind.DIRECTION, Kind.COMMA, Kind.SIDE, Kind.HERE):
        return token.of_kind(Kind.RELATION, "past") if _kind(after, 0) in _STARTS else token
    return token


def _shade(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    following = [other for other in after if other.kind is not Kind.EXTRA][:1]
    if _kind(following, 0) in MODIFIERS | HEADS:
        return token
    thing = token.text == "light" and _kind(before, -1) in DETERMINERS | {Kind.COLOUR, Kind.ORDINAL, Kind.RELATION}
    return token.of_kind(Kind.THING, "traffic_light") if thing else token


def _one(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    return token.of_kind(Kind.NUMBER, "1") if _kind(after, 0) in HEADS | {Kind.COLOUR} else token


def _direction(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """A side in "the left car", a direction in "take the next left"."""
    following = [other for other in after if other.kind not in MODIFIERS][:1]
    if token.value != "straight" and _kind(following, 0) in HEADS and _kind(before, -1) in _STARTS | {Kind.RELATION}:
        return token.of_kind(Kind.STATE, f"{token.value}_side")
    return token


def _side(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """In "the left car" a side of the car."""
    following = [other for other in after if other.kind not in MODIFIERS][:1]
    inside = token.text.split()[0] in ("the", "our", "my") and _kind(following, 0) in HEADS
    return token.of_kind(Kind.STATE, token.value) if inside else token


def _ordinal(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    turning = _kind(after, 0) is Kind.DIRECTION or (_kind(after, 0) is Kind.VERB and after[0].value in _DIRECTED)
    return token.of_kind(Kind.FILLER) if turning else token


def _determiner(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    return token if _kind(after, 0) in _STARTS | {Kind.VERB, Kind.DIRECTION} else _bare(token)


def _bare(token: Token) -> Token:
    """Without a noun "this", "her", "those" stand for something said before, articles for nothing."""
    alone = token.text in ("this", "these", "those", "her", "both", "all", "another", "each")
    return token.of_kind(Kind.PRONOUN if alone else Kind.FILLER)


def _possessive(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    if token.text == "whose":
        return token.of_kind(Kind.WHICH)
    return _determiner(before, token, after)


def _person(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """An owner: "my friend's car", with the mark or without."""
    owner = token.form == "own" or _kind(after, 0) in (Kind.NOUN, Kind.MAKE, Kind.MODEL)
    return token.of_kind(Kind.POSSESSIVE) if owner else token


def _to(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    verb = next((other for other in after if other.kind not in (Kind.AUX, Kind.BE, Kind.NOT)), None)
    infinitive = verb is not None and verb.kind in (Kind.VERB, Kind.NONDRIVE) and not verb.form
    return token if infinitive else token.of_kind(Kind.RELATION, "toward")


def _question(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """Question words begin a sentence; elsewhere they are what else they may be."""
    if _kind(before, -1) in _ENDS_CLAUSE or (len(before) == 1 and before[0].kind in (Kind.AND, Kind.COMMA)):
        return token
    if token.text.startswith("where"):
        return token.of_kind(Kind.RELATION, "at")
    if token.text.startswith("when"):
        return token.of_kind(Kind.SUB, "when")
    if token.text.startswith("who "):
        return token.of_kind(Kind.WHICH)
    if token.text in ("is", "are", "was", "were", "has"):
        return token.of_kind(Kind.BE)
    return token.of_kind(Kind.AUX if token.text in ("does", "did") else Kind.FILLER)


def _exists(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """In "the truck we have on our right" nothing new exists."""
    inside = _kind(before, -1) in HEADS | {Kind.WHICH, Kind.THAT} or (token.text in ("see", "notice") and before)
    return token.of_kind(Kind.FILLER) if inside and _kind(before, -1) not in _ENDS_CLAUSE else token


def _joint(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """A comma or "and" between two modifiers of one noun."""
    inside = _kind(before, -1) in MODIFIERS and _kind(after, 0) in MODIFIERS
    same = inside and (token.kind is Kind.COMMA or before[-1].kind is after[0].kind is Kind.COLOUR)
    return token.of_kind(Kind.FILLER) if same else token


def _region(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """The verb in "would you mind parking beside"."""
    if token.text == "blocks" and _kind(before, -1) in HEADS:
        return replace(token, kind=Kind.VERB, value="none", form="s")  # "that van blocks the road"
    if token.text == "exit" and _kind(before, -1) in _OURS | {Kind.AUX, Kind.TO}:
        return token.of_kind(Kind.VERB, "turn")
    verb = token.text == "parking" and _kind(after, 0) in (Kind.RELATION, Kind.SIDE, Kind.BETWEEN, Kind.HERE)
    if verb and _kind(before, -1) in (Kind.BREAK, Kind.BE, Kind.AUX, Kind.EGO, Kind.COMMA, Kind.NOT, Kind.AND):
        return Token(Kind.VERB, "park", token.text, token.meant, token.start, token.end, "ing", "parked", "stop")
    return token


def _nondrive(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    named = _kind(before, -1) in DETERMINERS | MODIFIERS
    return token.of_kind(Kind.UNKNOWN) if named and " " not in token.text else token


def _relation(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """The verb in "I like that car"."""
    return token.of_kind(Kind.NONDRIVE) if token.text == "like" and _kind(before, -1) is Kind.EGO else token


def _noun(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """No truck in "pick up my friend"."""
    named = _kind(before, -1) in DETERMINERS | MODIFIERS | {Kind.RELATION, Kind.THAT}
    return token.of_kind(Kind.VERB, "stop") if token.text == "pick up" and not named else token


def _aux(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """The verb in "we are going to the house"."""
    if not (token.text.endswith("going to") and _kind(after, 0) in _STARTS):
        return token
    ours = _kind(before, -1) in _OURS
    return token.of_kind(Kind.VERB, "approach toward") if ours else token.of_kind(Kind.FILLER)


def _be(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """To get there, in "we need to be behind that truck"."""
    placed = _kind(after, 0) in (Kind.LANE, Kind.RELATION, Kind.SIDE, Kind.THERE)
    wanted = token.text == "be" and _kind(before, -1) in (Kind.AUX, Kind.TO) and _kind(before, -2) in _OURS
    return token.of_kind(Kind.VERB, "get") if placed and wanted else token


def _out(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    ours = " " in token.text and _kind(before, -1) in _OURS | {Kind.AUX}
    return token.of_kind(Kind.VERB, "other") if ours else token


def _idle(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    return token.of_kind(Kind.FILLER)


def _then(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """No "after that" in "after that van"."""
    named = token.text.endswith(("that", "this")) and _kind(after, 0) in _INSIDE
    return token.of_kind(Kind.SUB, "after") if named else token


def _extra(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """The verb in "slow, there is a bus"."""
    alone = token.text == "slow" and _kind(before, -1) in _ENDS_CLAUSE and _kind(after, 0) not in _INSIDE
    return token.of_kind(Kind.VERB, "slow_down") if alone else token


def _number(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    return token if _kind(after, 0) in _INSIDE | {Kind.OF, Kind.VERB} else token.of_kind(Kind.FILLER)


_Rule = Callable[[Sequence[Token], Token, Sequence[Token]], Token]
_RULES: dict[Kind, _Rule] = {
    Kind.THAT: _that,
    Kind.VERB: _verb,
    Kind.SHADE: _shade,
    Kind.ONE: _one,
    Kind.DIRECTION: _direction,
    Kind.SIDE: _side,
    Kind.ORDINAL: _ordinal,
    Kind.THE: _determiner,
    Kind.ANY: _determiner,
    Kind.POSSESSIVE: _possessive,
    Kind.PERSON: _person,
    Kind.TO: _to,
    Kind.QUESTION: _question,
    Kind.EXISTS: _exists,
    Kind.COMMA: _joint,
    Kind.AND: _joint,
    Kind.REGION: _region,
    Kind.NONDRIVE: _nondrive,
    Kind.NUMBER: _number,
    Kind.THEN: _then,
    Kind.RELATION: _relation,
    Kind.NOUN: _noun,
    Kind.AUX: _aux,
    Kind.BE: _be,
    Kind.OUT: _out,
    Kind.UNIT: _idle,
    Kind.ABOUT: _idle,
    Kind.EXTRA: _extra,
}
