"""Parser: a sentence to typed queries, best reading first, or the reason why it is not a driving command."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from grounding.language.ambiguity import MAX_READINGS, list_alternatives
from grounding.language.semantics.interpreter import interpret
from grounding.language.semantics.query_builder import BuiltQuery, build_query
from grounding.language.syntax.clauses import split_clauses
from grounding.language.syntax.lexicon import Lexicon, default_lexicon
from grounding.language.syntax.spelling import suggest_word
from grounding.language.syntax.tagger import tag
from grounding.language.syntax.tokenizer import MAX_CHARACTERS, Token, Tokenised, normalise, tokenise, tokenise_all
from grounding.language.syntax.word_categories import WordCategory
from grounding.query import Query

_EXAMPLE = "park behind the silver car"
_ACTIONS = "park, stop, follow, overtake, turn and their like"
# Most ways to read the words of a sentence, and how much less likely (nats) than the best one they may be.
_MAX_WAYS, _MAX_LOSS = 6, 4.0
_FUNCTION_WORDS = (
    WordCategory.FILLER,
    WordCategory.GREETING,
    WordCategory.BREAK,
    WordCategory.COMMA,
    WordCategory.THE,
    WordCategory.ANY,
)


@dataclass(frozen=True)
class ParseProblem:
    """Why a sentence is not a driving command: a message and a span of the normalised sentence (empty if none)."""

    message: str
    start: int = 0
    end: int = 0


@dataclass(frozen=True)
class Reading:
    """One interpretation of a sentence.

    Attributes:
        query: typed query; its action is None if the sentence is not a driving command.
        score: log prior, 0 for the best reading.
        tokens: tokens of the sentence.
        notes: spelling corrections and ignored words, one sentence each.
        problem: why the sentence is not a command, None if it is one.
        corrections: words as written and as read, where they differ.
    """

    query: Query
    score: float = 0.0
    tokens: tuple[Token, ...] = ()
    notes: tuple[str, ...] = ()
    problem: ParseProblem | None = None
    corrections: tuple[tuple[str, str], ...] = ()


def parse(text: str, lexicon: Lexicon | None = None) -> Reading:
    """Return the best reading of a sentence; any text is accepted."""
    return parse_all(text, lexicon)[0]


def parse_all(text: str, lexicon: Lexicon | None = None) -> tuple[Reading, ...]:
    """Return all readings of a sentence, best first: between 1 and `MAX_READINGS`; any text is accepted.

    Without a `lexicon`, the package's own is used.
    """
    if len(text) > MAX_CHARACTERS:
        too_long = ParseProblem(f"expected at most {MAX_CHARACTERS} characters, got {len(text)}")
        return (Reading(Query(command=text[:MAX_CHARACTERS]), problem=too_long),)
    normalised = normalise(text)
    found: list[Reading] = []
    for way in _ways_to_read(normalised, lexicon):
        found += _readings(text, normalised, way, lexicon)
    commands = [one for one in found if one.problem is None] or found[:1]
    best = max(one.score for one in commands)
    unique: dict[Query, Reading] = {}
    for one in sorted(commands, key=lambda reading: -reading.score):
        if one.score >= best - _MAX_LOSS:
            unique.setdefault(one.query, replace(one, score=one.score - best))
    return tuple(unique.values())[:MAX_READINGS]


def _ways_to_read(normalised: str, lexicon: Lexicon | None) -> list[Tokenised]:
    """Return the likely ways to read the words, their costs relative to the first."""
    first, *others = tokenise_all(normalised, lexicon, _MAX_WAYS)
    return [first, *(one for one in others if one.cost <= first.cost + _MAX_LOSS)]


def _readings(text: str, normalised: str, way: Tokenised, lexicon: Lexicon | None) -> list[Reading]:
    """Return the readings of a sequence of tokens, best first."""
    query, postmodifiers = _build(text, way.tokens)
    reading = Reading(query, -way.cost, way.tokens, tuple(_notes(way)), corrections=way.corrections)
    if query.action is None:
        return [replace(reading, problem=_find_problem(normalised, way.tokens, lexicon))]
    return [
        replace(reading, query=one, score=score - way.cost) for one, score in list_alternatives(query, postmodifiers)
    ]


def underline(text: str, problem: ParseProblem) -> str:
    """Return the normalised sentence with carets under the span of a problem, '' for a problem without a span."""
    if problem.end <= problem.start:
        return ""
    return f"  {normalise(text)}\n  {' ' * problem.start}{'^' * (problem.end - problem.start)}"


def _build(text: str, tokens: Sequence[Token]) -> BuiltQuery:
    return build_query(text, interpret(split_clauses(tag(tokens))))


def _find_problem(normalised: str, tokens: Sequence[Token], lexicon: Lexicon | None) -> ParseProblem:
    """Return why a sentence is not a driving command."""
    if not tokens:
        return ParseProblem("the sentence holds no words")
    if misspelling := _find_misspelt_verb(normalised, tokens, lexicon):
        return misspelling
    if all(token.category in (WordCategory.UNKNOWN, *_FUNCTION_WORDS) for token in tokens):
        return ParseProblem(f"no word of it is understood: expected a command such as '{_EXAMPLE}'")
    first = next(token for token in tokens if token.category not in _FUNCTION_WORDS)
    if first.category is WordCategory.QUESTION:
        return ParseProblem("a question is no driving command", first.start, first.end)
    if first.category is WordCategory.NONDRIVE:
        return ParseProblem(f"'{first.text}' is no driving action: expected {_ACTIONS}", first.start, first.end)
    return ParseProblem(f"no driving action in it: expected {_ACTIONS}")


def _find_misspelt_verb(normalised: str, tokens: Sequence[Token], lexicon: Lexicon | None) -> ParseProblem | None:
    """Return the problem of a misspelt verb: with the suggested verb the sentence is a command."""
    verbs = (lexicon or default_lexicon()).written_words(WordCategory.VERB)
    for token in [token for token in tokens if token.category is WordCategory.UNKNOWN][:3]:
        suggestion = suggest_word(token.text, verbs)
        corrected = f"{normalised[: token.start]}{suggestion}{normalised[token.end :]}"
        if suggestion and _build(corrected, tokenise(corrected, lexicon)).query.action:
            shown = corrected if len(corrected) <= 80 else suggestion
            message = f"'{token.written}' is not understood: did you mean '{shown}'?"
            return ParseProblem(message, token.start, token.end)
    return None


def _notes(way: Tokenised) -> list[str]:
    """Return notes on corrected and on ignored words."""
    notes = [f"'{written}' was read as '{read}'" for written, read in way.corrections]
    unknown = [token.written for token in way.tokens if token.category is WordCategory.UNKNOWN]
    if unknown:
        notes.append("not understood and left out: " + ", ".join(f"'{word}'" for word in unknown[:8]))
    return notes
