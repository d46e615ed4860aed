"""Clauses: split tagged tokens at connectives and marks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from grounding.language.syntax.tokenizer import Token
from grounding.language.syntax.word_categories import DETERMINERS, HEADS, MODIFIERS, WordCategory

# Connectives that set the time of the main clause.
TEMPORAL = ("when", "after", "before", "until")
_LOOKAHEAD = 30
_COORDINATORS = {WordCategory.AND: "and", WordCategory.OR: "or", WordCategory.BUT: "but"}
_BEFORE_VERB = frozenset(
    (WordCategory.AUX, WordCategory.EGO, WordCategory.BE, WordCategory.NOT, WordCategory.HERE, WordCategory.SUB)
)
_NOUN_PHRASE = DETERMINERS | MODIFIERS | HEADS | {WordCategory.NUMBER, WordCategory.UNKNOWN, WordCategory.PRONOUN}
_AFTER_NOUN = frozenset(
    (
        WordCategory.SIDE,
        WordCategory.WHERE,
        WordCategory.LANE,
        WordCategory.RELATION,
        WordCategory.OF,
        WordCategory.HERE,
        WordCategory.DISTANCE,
        WordCategory.AWAY,
    )
)
_PREDICATE = frozenset((WordCategory.BE, WordCategory.AUX, WordCategory.NOT))
_CLAUSE_STARTS = frozenset(
    (
        WordCategory.VERB,
        WordCategory.NONDRIVE,
        WordCategory.MEANWHILE,
        WordCategory.EXISTS,
        WordCategory.SUB,
        WordCategory.THEN,
        WordCategory.QUESTION,
    )
)
# Categories after a conjunction that introduces a clause.
_AFTER_CONJUNCTION = frozenset(
    (
        WordCategory.EGO,
        WordCategory.EXISTS,
        WordCategory.VERB,
        WordCategory.NONDRIVE,
        WordCategory.AUX,
        WordCategory.SUB,
    )
)
# Categories after which a verb belongs to the subordinate clause.
_BEFORE_SUBORDINATE_VERB = frozenset(
    (
        WordCategory.AUX,
        WordCategory.BE,
        WordCategory.TO,
        WordCategory.NOT,
        WordCategory.EGO,
        WordCategory.SUB,
        WordCategory.WHICH,
    )
)
# Relation of a conjunction that only a noun follows: "after the van".
_AS_RELATION = {"after": "past", "before": "before", "until": "at", "when": "at", "while": "near"}


@dataclass(frozen=True)
class Clause:
    """Part of a sentence with at most one predicate.

    Attributes:
        connective: '' at the start of a sentence and after a comma; and, or, but, then; when, after, before, until,
            while, if, because, unless, so; main for a main clause without a comma before it; correct for a
            self-repair ("no, ...").
        tokens: tokens of the clause, without its connective and the marks around it.
        starts_sentence: whether the clause is the first of a sentence.
    """

    connective: str
    tokens: tuple[Token, ...]
    starts_sentence: bool = False


def split_clauses(tokens: Sequence[Token]) -> list[Clause]:
    """Return the clauses of tagged tokens in order; no clause is empty."""
    clauses: list[Clause] = []
    current: list[Token] = []
    connective, starts_sentence = "", True

    def close() -> None:
        nonlocal current, starts_sentence
        if current:
            clauses.append(Clause(connective, tuple(current), starts_sentence))
            starts_sentence = False
        current = []

    for i, token in enumerate(tokens):
        rest = tokens[i + 1 : i + _LOOKAHEAD]
        if token.category is WordCategory.BREAK:
            repairs = connective == "correct" and not current  # "no! the blue one"
            close()
            connective, starts_sentence = "correct" if repairs else "", True
        elif token.category is WordCategory.CORRECT:
            close()
            connective = "correct"
        elif connective == "correct" and token.category is WordCategory.COMMA and not current:
            continue
        elif token.category is WordCategory.COMMA:
            close()
            # A comma ends the clause of "when it leaves, ..."; "so that, ..." keeps its connective.
            connective = "" if clauses and clauses[-1].tokens else connective
        elif token.category is WordCategory.THEN or (token.category is WordCategory.AND and _names_turn(rest)):
            close()
            connective = "then"
        elif token.category in _COORDINATORS:
            if _begins_clause(rest) and not _ends_with_between_ego(current):
                close()
                connective = _COORDINATORS[token.category]
            elif current:
                current.append(token)
        elif token.category is WordCategory.SUB:
            if _has_predicate(token, rest):
                close()
                connective = token.value
            else:
                current.append(_as_relation(token))
        elif token.category is WordCategory.VERB and token.text.endswith(" after") and _subject_end(rest) is not None:
            current.append(token.with_category(WordCategory.VERB, "go"))  # "go after the car has passed"
            close()
            connective = "after"
        elif _starts_main(connective, current, token, rest):
            close()
            connective = "main"
            current.append(token)
        else:
            current.append(token)
    close()
    return clauses


def conjunction_as_relation(token: Token, rest: Sequence[Token]) -> Token:
    """Return a conjunction without a predicate after it as a relation ("after the van"), other tokens as they are."""
    is_relation = token.category is WordCategory.SUB and token.value in _AS_RELATION
    return _as_relation(token) if is_relation and not _has_predicate(token, rest[:_LOOKAHEAD]) else token


def _as_relation(token: Token) -> Token:
    return token.with_category(WordCategory.RELATION, _AS_RELATION.get(token.value, "same_as"))


def _ends_with_between_ego(current: Sequence[Token]) -> bool:
    """Return whether "and" continues "between us": "until the gap between us and the van is bigger"."""
    return [token.category for token in current[-2:]] == [WordCategory.BETWEEN, WordCategory.EGO]


def _names_turn(rest: Sequence[Token]) -> bool:
    """Return whether a next turn follows: "the first left and | the second right"."""
    named = [token.category for token in rest if token.category is not WordCategory.THE][:2]
    return named == [WordCategory.BRANCH, WordCategory.DIRECTION]


def _begins_clause(rest: Sequence[Token]) -> bool:
    """Return whether a verb or a new subject follows "and"."""
    for i, token in enumerate(rest):
        if token.category in _CLAUSE_STARTS:
            return not (token.category is WordCategory.VERB and token.form == "past")
        if token.category not in _BEFORE_VERB:
            return _subject_end(rest[i:]) is not None
    return False


def _subject_end(tokens: Sequence[Token]) -> int | None:
    """Return where the predicate of a subject begins, None if the tokens are not a subject with a predicate."""
    if not tokens or tokens[0].category not in _NOUN_PHRASE:
        return None
    relative = False
    for i, token in enumerate(tokens):
        if token.category in _NOUN_PHRASE | _AFTER_NOUN:
            continue
        if token.category is WordCategory.WHICH:
            relative = True
        elif token.category is WordCategory.VERB and relative:
            relative = False
        elif token.category in _PREDICATE:
            if not relative:
                return i
        elif token.category is WordCategory.VERB:
            past = token.form == "past" and token.event not in ("", "stop")
            plural = tokens[i - 1].form == "plural" and not token.form
            if token.form == "s" or past or plural:
                return i
            if token.form not in ("ing", "past"):
                return None
        elif token.category is not WordCategory.TO:
            return None
    return None


def _has_predicate(token: Token, rest: Sequence[Token]) -> bool:
    """Return whether a predicate follows a conjunction."""
    first = next((other.category for other in rest), WordCategory.BREAK)
    if token.value in ("so", "because", "if", "unless"):
        return token.value != "so" or first not in (WordCategory.EXTRA, WordCategory.UNKNOWN)
    if first in (WordCategory.ANY, WordCategory.THE) and len(rest) > 1 and rest[1].category is WordCategory.VERB:
        return True  # "after a u-turn"
    return first in _AFTER_CONJUNCTION or _subject_end(rest) is not None


def _starts_main(connective: str, current: Sequence[Token], token: Token, rest: Sequence[Token]) -> bool:
    """Return whether the main clause begins without a comma: "when the bus leaves | turn left"."""
    if connective not in ("when", "after", "before", "until", "while", "if", "because", "unless"):
        return False
    end = _subject_end(current)
    if token.category is WordCategory.EGO:
        return end is not None and any(other.category is WordCategory.VERB for other in current[end:])
    if token.category not in (WordCategory.VERB, WordCategory.MEANWHILE) or token.form:
        return False
    if any(other.category is WordCategory.EXISTS for other in current) and current[-1].category in _NOUN_PHRASE:
        return True  # "if there is no traffic | overtake"
    last = current[-1].category if current else WordCategory.SUB
    if last in _BEFORE_SUBORDINATE_VERB:
        return False
    has_predicate = end is not None and len(current) > end
    return has_predicate or (current[0].category in _NOUN_PHRASE and current[-1].form != "plural")
