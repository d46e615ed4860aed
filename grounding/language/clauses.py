"""Tagged tokens -> clauses: where one ends, and what links it to those around it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from grounding.language.tagger import DETERMINERS, HEADS, MODIFIERS
from grounding.language.tokenizer import Token
from grounding.language.word_categories import Kind

_LOOK_AHEAD = 30
_JOINTS = {Kind.AND: "and", Kind.OR: "or", Kind.BUT: "but"}
_SAID_BEFORE_VERB = frozenset((Kind.AUX, Kind.EGO, Kind.BE, Kind.NOT, Kind.HERE, Kind.SUB))
_NOUN_PHRASE = DETERMINERS | MODIFIERS | HEADS | {Kind.NUMBER, Kind.UNKNOWN, Kind.PRONOUN}
_AFTER_NOUN = frozenset(
    (Kind.SIDE, Kind.WHERE, Kind.LANE, Kind.RELATION, Kind.OF, Kind.HERE, Kind.DISTANCE, Kind.AWAY)
)
_PREDICATE = frozenset((Kind.BE, Kind.AUX, Kind.NOT))
# What a conjunction is where only a noun follows: "after the van".
_AS_RELATION = {"after": "past", "before": "before", "until": "at", "when": "at", "while": "near"}


@dataclass(frozen=True)
class Clause:
    """Part of a sentence with one predicate at most.

    Attributes:
        link: '' for the first of a sentence or one after a comma; and, or, but, then; when, after, before, until,
            while, if, because, so; correct after what takes back something said ("no, ...").
        tokens: without what divides it from others.
        new: whether a new sentence begins with it.
    """

    link: str
    tokens: tuple[Token, ...]
    new: bool = False


def split(tokens: Sequence[Token]) -> list[Clause]:
    """The clauses of tagged tokens, in order; none is empty."""
    clauses: list[Clause] = []
    current: list[Token] = []
    link, new = "", True

    def close() -> None:
        nonlocal current, new
        if current:
            clauses.append(Clause(link, tuple(current), new))
            new = False
        current = []

    for i, token in enumerate(tokens):
        rest = tokens[i + 1 : i + _LOOK_AHEAD]
        if token.kind is Kind.BREAK:
            waits = link == "correct" and not current  # "no! the blue one"
            close()
            link, new = "correct" if waits else "", True
        elif token.kind is Kind.CORRECT:
            close()
            link = "correct"
        elif link == "correct" and token.kind is Kind.COMMA and not current:
            continue
        elif token.kind is Kind.COMMA:
            close()
            # "When it leaves, ..." ends what hangs on "when"; "so that, ..." does not.
            link = "" if clauses and clauses[-1].tokens else link
        elif token.kind is Kind.THEN:
            close()
            link = "then"
        elif token.kind in _JOINTS:
            if _begins_clause(rest) and not _between_us(current):
                close()
                link = _JOINTS[token.kind]
            elif current:
                current.append(token)
        elif token.kind is Kind.SUB:
            if _is_clause(token, rest, link):
                close()
                link = token.value
            else:
                current.append(token.of_kind(Kind.RELATION, _AS_RELATION.get(token.value, "same_as")))
        elif token.kind is Kind.VERB and token.text.endswith(" after") and _subject_end(rest) is not None:
            current.append(token.of_kind(Kind.VERB, "go"))  # "go after the car has passed"
            close()
            link = "after"
        elif _starts_main(link, current, token, rest):
            close()
            link = "main"
            current.append(token)
        else:
            current.append(token)
    close()
    return clauses


def _between_us(current: Sequence[Token]) -> bool:
    """Whether "and" joins the other end of a gap: "until the gap between us and the van is bigger"."""
    return [token.kind for token in current[-2:]] == [Kind.BETWEEN, Kind.EGO]


def _begins_clause(rest: Sequence[Token]) -> bool:
    """Whether a verb or a new subject follows "and"."""
    for i, token in enumerate(rest):
        if token.kind in (Kind.VERB, Kind.NONDRIVE, Kind.MEANWHILE, Kind.EXISTS, Kind.SUB, Kind.THEN, Kind.QUESTION):
            return not (token.kind is Kind.VERB and token.form == "past")
        if token.kind not in _SAID_BEFORE_VERB:
            return _subject_end(rest[i:]) is not None
    return False


def _subject_end(tokens: Sequence[Token]) -> int | None:
    """Where the predicate of a noun phrase begins, None if the tokens are no noun phrase with one."""
    if not tokens or tokens[0].kind not in _NOUN_PHRASE:
        return None
    relative = False
    for i, token in enumerate(tokens):
        if token.kind in _NOUN_PHRASE | _AFTER_NOUN:
            continue
        if token.kind is Kind.WHICH:
            relative = True
        elif token.kind is Kind.VERB and relative:
            relative = False
        elif token.kind in _PREDICATE:
            if not relative:
                return i
        elif token.kind is Kind.VERB:
            plural = tokens[i - 1].form == "plural"
            if (
                token.form == "s"
                or (token.form == "past" and token.event not in ("", "stop"))
                or (plural and not token.form)
            ):
                return i
            if token.form != "ing" and token.form != "past":
                return None
        elif token.kind is not Kind.TO:
            return None
    return None


def _is_clause(token: Token, rest: Sequence[Token], link: str) -> bool:
    """Whether a conjunction has a predicate of its own to follow."""
    first = next((other.kind for other in rest), Kind.BREAK)
    if token.value in ("so", "because", "if"):
        return token.value != "so" or first not in (Kind.EXTRA, Kind.UNKNOWN)
    if first in (Kind.ANY, Kind.THE) and len(rest) > 1 and rest[1].kind is Kind.VERB:
        return True  # "after a u-turn"
    if first in (Kind.EGO, Kind.EXISTS, Kind.VERB, Kind.NONDRIVE, Kind.AUX, Kind.SUB):
        return True
    return _subject_end(rest) is not None


def _starts_main(link: str, current: Sequence[Token], token: Token, rest: Sequence[Token]) -> bool:
    """Whether the main clause begins without a comma: "when the bus leaves | turn left"."""
    if link not in ("when", "after", "before", "until", "while", "if", "because"):
        return False
    end = _subject_end(current)
    if token.kind is Kind.EGO:
        return end is not None and any(other.kind is Kind.VERB for other in current[end:])
    if token.kind not in (Kind.VERB, Kind.MEANWHILE) or token.form:
        return False
    if any(other.kind is Kind.EXISTS for other in current) and current[-1].kind in _NOUN_PHRASE:
        return True  # "if there is no traffic | overtake"
    last = current[-1].kind if current else Kind.SUB
    if last in (Kind.AUX, Kind.BE, Kind.TO, Kind.NOT, Kind.EGO, Kind.SUB, Kind.WHICH):
        return False
    done = end is not None and len(current) > end
    return done or (current[0].kind in _NOUN_PHRASE and current[-1].form != "plural")
