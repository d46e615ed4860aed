"""Sentence -> queries: what was understood, best reading first, or why it is no driving command."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from grounding.language.ambiguity import MOST, alternatives
from grounding.language.clauses import split
from grounding.language.interpreter import tell
from grounding.language.lexicon import Lexicon
from grounding.language.query_builder import Merged, merge
from grounding.language.tagger import tag
from grounding.language.tokenizer import MAX_CHARACTERS, Token, did_you_mean, normalise, tokenise
from grounding.language.word_categories import Kind
from grounding.query import Query

__all__ = ["MOST", "Problem", "Reading", "caret", "read", "readings"]

_EXAMPLE = "park behind the silver car"
_ACTIONS = "park, stop, follow, overtake, turn and their like"
_SMALL = (Kind.FILLER, Kind.BREAK, Kind.COMMA, Kind.THE, Kind.ANY)


@dataclass(frozen=True)
class Problem:
    """Why a sentence is no driving command: one line, and the characters of the normalised sentence it is about."""

    message: str
    start: int = 0
    end: int = 0


@dataclass(frozen=True)
class Reading:
    """One way to understand a sentence.

    Attributes:
        query: the typed query; without an action where the sentence is no driving command.
        score: log prior, 0 for the best reading.
        tokens: the words as the lexicon knows them.
        notes: what was mended or left out, one sentence each.
        problem: why the sentence is no command; None where it is one.
    """

    query: Query
    score: float = 0.0
    tokens: tuple[Token, ...] = ()
    notes: tuple[str, ...] = ()
    problem: Problem | None = None


def read(text: str, lexicon: Lexicon | None = None) -> Reading:
    """The best reading of a sentence; never raises for any text."""
    return readings(text, lexicon)[0]


def readings(text: str, lexicon: Lexicon | None = None) -> tuple[Reading, ...]:
    """The readings of a sentence, best first: one at least, six at most; never raises for any text.

    Without a `lexicon` the package's own words are known.
    """
    if len(text) > MAX_CHARACTERS:
        too_long = Problem(f"expected at most {MAX_CHARACTERS} characters, got {len(text)}")
        return (Reading(Query(text[:MAX_CHARACTERS]), problem=too_long),)
    normalised = normalise(text)
    tokens = tuple(tokenise(normalised, lexicon))
    query, late = _merged(text, tokens)
    notes = tuple(_notes(tokens))
    if query.action is None:
        return (Reading(query, 0.0, tokens, notes, _problem(normalised, tokens, lexicon)),)
    return tuple(Reading(one, score, tokens, notes) for one, score in alternatives(query, late))


def caret(text: str, problem: Problem) -> str:
    """The normalised sentence with carets under the place of a problem, '' where it has none."""
    if problem.end <= problem.start:
        return ""
    return f"  {normalise(text)}\n  {' ' * problem.start}{'^' * (problem.end - problem.start)}"


def _merged(text: str, tokens: Sequence[Token]) -> Merged:
    return merge(text, tell(split(tag(tokens))))


def _problem(normalised: str, tokens: Sequence[Token], lexicon: Lexicon | None) -> Problem:
    """Why a sentence is no driving command."""
    if not tokens:
        return Problem("the sentence holds no words")
    if slip := _slip(normalised, tokens, lexicon):
        return slip
    if all(token.kind in (Kind.UNKNOWN, *_SMALL) for token in tokens):
        return Problem(f"no word of it is understood: expected a command such as '{_EXAMPLE}'")
    first = next(token for token in tokens if token.kind not in _SMALL)
    if first.kind is Kind.QUESTION:
        return Problem("a question is no driving command", first.start, first.end)
    if first.kind is Kind.NONDRIVE:
        return Problem(f"'{first.text}' is no driving action: expected {_ACTIONS}", first.start, first.end)
    return Problem(f"no driving action in it: expected {_ACTIONS}")


def _slip(normalised: str, tokens: Sequence[Token], lexicon: Lexicon | None) -> Problem | None:
    """The problem of a misspelt verb: with another word for it the sentence is a command."""
    for token in [token for token in tokens if token.kind is Kind.UNKNOWN][:3]:
        guess = did_you_mean(token.text, (Kind.VERB,), lexicon)
        mended = f"{normalised[: token.start]}{guess}{normalised[token.end :]}"
        if guess and _merged(mended, tokenise(mended, lexicon)).query.action:
            shown = mended if len(mended) <= 80 else guess
            return Problem(f"'{token.text}' is not understood: did you mean '{shown}'?", token.start, token.end)
    return None


def _notes(tokens: Sequence[Token]) -> list[str]:
    """What was mended and what was left out."""
    mended = [token for token in tokens if _letters(token.text) != _letters(token.meant)]
    notes = [f"'{token.text}' was read as '{token.meant}'" for token in mended]
    unknown = [token.text for token in tokens if token.kind is Kind.UNKNOWN]
    if unknown:
        notes.append("not understood and left out: " + ", ".join(f"'{word}'" for word in unknown[:8]))
    return notes


def _letters(text: str) -> str:
    """A phrase without the blanks and marks between its words."""
    return "".join(character for character in text if character.isalnum())
