"""Words that are several things: what each is in its sentence, by its neighbours."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

from grounding.language.quantities import counted
from grounding.language.tokenizer import Token
from grounding.language.word_categories import NOUNS, Kind

DETERMINERS = frozenset((Kind.THE, Kind.ANY, Kind.POSSESSIVE))
MODIFIERS = frozenset(
    (Kind.COLOUR, Kind.SHADE, Kind.ORDINAL, Kind.SUPERLATIVE, Kind.STATE, Kind.SIZE, Kind.EXTRA, Kind.MAKE)
)
HEADS = NOUNS | {Kind.MAKE, Kind.MODEL, Kind.ONE}
_INSIDE = MODIFIERS | HEADS | {Kind.UNKNOWN, Kind.NUMBER}
_STARTS = DETERMINERS | _INSIDE | {Kind.THAT}
_OURS = frozenset((Kind.EGO, Kind.BREAK, Kind.COMMA, Kind.THEN, Kind.AND))
_ENDS_CLAUSE = frozenset((Kind.BREAK, Kind.THEN))
# What follows a verb that has no object of its own.
_AFTER_VERB = frozenset(
    (Kind.BREAK, Kind.COMMA, Kind.AND, Kind.THEN, Kind.SUB, Kind.SIDE, Kind.WHERE, Kind.LANE, Kind.HERE)
)
_PREDICATE = frozenset((Kind.VERB, Kind.BE, Kind.AUX, Kind.EGO, Kind.NOT, Kind.QUESTION, Kind.MEANWHILE))
# Verbs that are also nouns: "the next turn", "at that stop".
_NOUN_VERBS = {"park": "park", "stop": "stop", "turn": "turn", "pass": "pass", "drive": "driveway", "exit": "exit"}
# Nouns that are also verbs: "shadow that van".
_VERBS_TOO = {"shadow": "follow", "mirror": "follow", "dodge": "avoid", "block": "danger", "track": "follow"}
_DIRECTED = ("turn left", "turn right", "turn around")
_STRAIGHT_TO, _RIGHT_AT = ("go right", "drive right", "head right"), ("behind", "in_front_of", "next_to", "near")


# What follows "parking" where that is a verb.
_PARKING = (Kind.RELATION, Kind.SIDE, Kind.BETWEEN, Kind.HERE, Kind.WHERE, Kind.THERE, Kind.DISTANCE, Kind.SUB)


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
    "right after": _Split(
        frozenset((Kind.THEN, Kind.AND, Kind.EXCEPT)), (Kind.DIRECTION, Kind.SUB), ("right", "after")
    ),
    "right before": _Split(
        frozenset((Kind.THEN, Kind.AND, Kind.EXCEPT)), (Kind.DIRECTION, Kind.SUB), ("right", "before")
    ),
}


def tag(tokens: Sequence[Token]) -> list[Token]:
    """The tokens that bear meaning, each as what it is here; fillers are left out."""
    tagged: list[Token] = []
    kept = [token for token in counted(tokens) if token.kind is not Kind.FILLER]
    for i, token in enumerate(kept):
        after = kept[i + 1 : i + 6]
        if (parts := _SPLIT.get(token.text)) is not None and _kind(tagged, -1) in parts.after:
            tagged += parts.of(token)
        elif (rule := _RULES.get(token.kind)) is not None:
            tagged.append(rule(tagged, token, after))
        else:
            tagged.append(token)
    return [token for token in tagged if token.kind is not Kind.FILLER]


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
    if token.value == "turn" and token.form and _kind(after, 0) is Kind.COLOUR:
        return replace(token, value="none", state="", event="other")  # "until the light turns green"
    onward = token.text in ("go", "come") and last not in (Kind.NOT, Kind.EGO)
    if onward and _kind(after, 0) is Kind.VERB and not after[0].form:
        return token.of_kind(Kind.FILLER)  # "go park there"
    if token.text == "lets" and last in _ENDS_CLAUSE | {Kind.COMMA}:
        return token.of_kind(Kind.FILLER)  # "lets park here"
    if token.value in _DIRECTED and after and after[0].text.startswith("lane"):
        return token.of_kind(Kind.VERB, token.value.replace("turn", "change_lane"))  # "take the left lane"
    if token.meant in ("pull in", "move in") and after and after[0].text in ("front of", "back of"):
        return token.of_kind(Kind.VERB, token.meant.split()[0])
    if token.meant in _STRAIGHT_TO and after and after[0].kind is Kind.RELATION and after[0].value in _RIGHT_AT:
        return token.of_kind(Kind.VERB, token.meant.split()[0])  # "go right behind it" is no turn
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
    first = _kind(before, -1) in _ENDS_CLAUSE | {Kind.COMMA} and token.value != "straight"
    if first and _kind(after, 0) is Kind.RELATION and after[0].value in ("at", "into"):
        return token.of_kind(Kind.VERB, f"turn {token.value}")  # "left at the lights"
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
    alone = all(other.kind in DETERMINERS for other in before[_clause_start(before) :])
    if alone and _kind(after, 0) is Kind.DIRECTION and _kind(after, 1) not in HEADS | MODIFIERS:
        return token.of_kind(Kind.VERB, "turn")  # "next left, please"
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
    said = not token.text.startswith(("there", "here"))
    inside = said and _kind(before, -1) in HEADS | {Kind.WHICH, Kind.THAT}
    inside = inside or (token.text in ("see", "notice") and bool(before))
    return token.of_kind(Kind.FILLER) if inside and _kind(before, -1) not in _ENDS_CLAUSE else token


def _joint(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """A comma or "and" between two modifiers of one noun."""
    inside = _kind(before, -1) in MODIFIERS and _kind(after, 0) in MODIFIERS
    same = inside and (token.kind is Kind.COMMA or before[-1].kind is after[0].kind is Kind.COLOUR)
    return token.of_kind(Kind.FILLER) if same else token


def _region(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """The verb in "would you mind parking beside"."""
    if _is_verb(before, token, after):
        return token.of_kind(Kind.VERB, _VERBS_TOO[token.text])
    if token.text == "blocks" and _kind(before, -1) in HEADS:
        return replace(token, kind=Kind.VERB, value="none", form="s")  # "that van blocks the road"
    if token.text == "exit" and _kind(before, -1) in _OURS | {Kind.AUX, Kind.TO}:
        return token.of_kind(Kind.VERB, "turn")
    verb = token.text == "parking" and _kind(after, 0) in _PARKING
    verb = verb or (token.text == "parking" and _kind(before, -1) is Kind.SUB)
    begins = (Kind.BREAK, Kind.BE, Kind.AUX, Kind.EGO, Kind.COMMA, Kind.NOT, Kind.AND, Kind.SUB)
    if verb and _kind(before, -1) in begins:
        return Token(Kind.VERB, "park", token.text, token.meant, token.start, token.end, "ing", "parked", "stop")
    return token


def _thing(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """The verb in "the man crossing the street"."""
    if _is_verb(before, token, after):
        return token.of_kind(Kind.VERB, _VERBS_TOO[token.text])
    walks = token.text == "crossing" and _kind(before, -1) in HEADS - {Kind.THING} | {
        Kind.BE,
        Kind.WHICH,
        Kind.PRONOUN,
    }
    return replace(token, kind=Kind.VERB, value="none", form="ing", event="pass") if walks else token


def _is_verb(before: Sequence[Token], token: Token, after: Sequence[Token]) -> bool:
    commanded = _kind(before, -1) in _OURS | {Kind.AUX, Kind.TO, Kind.NOT}
    return token.text in _VERBS_TOO and commanded and _kind(after, 0) in _STARTS


def _ego(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """The "which" that is left out in "the first van we pass"; what follows is said of the van."""
    if _kind(before, -1) not in HEADS:
        return token
    said = [other for other in after if other.kind not in (Kind.AUX, Kind.BE, Kind.NOT)]
    verb = _kind(said, 0) in (Kind.VERB, Kind.NONDRIVE)
    open_end = _kind(said, 1) in _AFTER_VERB or (
        _kind(said, 1) in (Kind.RELATION, Kind.TO) and _kind(said, 2) in _AFTER_VERB
    )
    clause = [other.kind for other in before[_clause_start(before) :]]
    named = Kind.VERB in clause or clause[0] in DETERMINERS | MODIFIERS | {Kind.THAT}
    return token.of_kind(Kind.WHICH, "ego") if verb and open_end and named else token


def _clause_start(tokens: Sequence[Token]) -> int:
    ends = [i for i, token in enumerate(tokens) if token.kind in _ENDS_CLAUSE | {Kind.COMMA}]
    return ends[-1] + 1 if ends else 0


def _correct(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """No correction in "never mind the bus", "there is actually no space"."""
    if token.text.endswith(" no") and _kind(after, 0) in _INSIDE:
        return token.of_kind(Kind.NOT)
    dropped = token.text in ("never mind", "nevermind", "cancel that", "forget that", "scratch that")
    return token.of_kind(Kind.EXCEPT) if dropped and _kind(after, 0) in _STARTS else token


def _not(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """A "no" that stands alone takes back what was said."""
    alone = token.text == "no" and _kind(after, 0) in (Kind.COMMA, Kind.BREAK, Kind.CORRECT)
    return token.of_kind(Kind.CORRECT) if alone and _kind(before, -1) in _ENDS_CLAUSE | {Kind.COMMA} else token


def _nondrive(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    named = _kind(before, -1) in DETERMINERS | MODIFIERS
    return token.of_kind(Kind.UNKNOWN) if named and " " not in token.text else token


def _relation(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """The verb in "I like that car"."""
    return token.of_kind(Kind.NONDRIVE) if token.text == "like" and _kind(before, -1) is Kind.EGO else token


def _noun(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """No truck in "pick up my friend"."""
    named = _kind(before, -1) in DETERMINERS | MODIFIERS | {Kind.RELATION, Kind.THAT}
    # Written as one word it is a truck, unless it takes an object: "pickup that girl".
    verb = token.text == "pick up" or (token.text == "pickup" and _kind(after, 0) in _STARTS)
    return token.of_kind(Kind.VERB, "stop") if verb and not named else token


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
    Kind.THING: _thing,
    Kind.MAKE: _thing,
    Kind.PART: _thing,
    Kind.EGO: _ego,
    Kind.CORRECT: _correct,
    Kind.NOT: _not,
}
