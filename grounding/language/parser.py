"""Parser: a sentence to typed queries, best reading first, or the reason why it is not a driving command."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from grounding.language.ambiguity import list_alternatives
from grounding.language.semantics.accounting import account_for
from grounding.language.semantics.contrasts import has_partial_repair, resolve_contrasts
from grounding.language.semantics.interpreter import interpret
from grounding.language.semantics.query_builder import BuiltQuery, build_query
from grounding.language.syntax.clauses import split_clauses
from grounding.language.syntax.lexicon import Lexicon
from grounding.language.syntax.spelling import suggest_word
from grounding.language.syntax.tagger import tag
from grounding.language.syntax.tokenizer import MAX_CHARACTERS, Token, normalise, tokenise
from grounding.language.syntax.word_categories import WordCategory
from grounding.query import Query, Referent

_EXAMPLE = "park behind the silver car"
_ACTIONS = "park, stop, follow, overtake, turn and their like"
_FUNCTION_WORDS = (
    WordCategory.FILLER,
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
        steps: the commanded steps in order, each a query of its own; one of them is the query's.
        dropped: content words that the reading does not use, in order.
        doubt: question about dropped words without which the place may be the wrong one, asked before the reading
            is acted upon; '' if there is none.
    """

    query: Query
    score: float = 0.0
    tokens: tuple[Token, ...] = ()
    notes: tuple[str, ...] = ()
    problem: ParseProblem | None = None
    steps: tuple[Query, ...] = ()
    dropped: tuple[str, ...] = ()
    doubt: str = ""

    def __post_init__(self) -> None:
        """Take the query as the only step if none are given."""
        object.__setattr__(self, "steps", self.steps or (self.query,))


def parse(text: str, lexicon: Lexicon | None = None, antecedent: Referent | None = None) -> Reading:
    """Return the best reading of a sentence; any text is accepted."""
    return parse_all(text, lexicon, antecedent)[0]


def parse_all(text: str, lexicon: Lexicon | None = None, antecedent: Referent | None = None) -> tuple[Reading, ...]:
    """Return all readings of a sentence, best first: between 1 and `MAX_READINGS`; any text is accepted.

    Args:
        text: the sentence.
        lexicon: None: the package's own.
        antecedent: what a pronoun or "one" refers to if the sentence does not name it, such as the referent of the
            command before.
    """
    if len(text) > MAX_CHARACTERS:
        too_long = ParseProblem(f"expected at most {MAX_CHARACTERS} characters, got {len(text)}")
        return (Reading(Query(command=text[:MAX_CHARACTERS]), problem=too_long),)
    normalised = normalise(text)
    tokens = tuple(tokenise(normalised, lexicon))
    written = tag(tokens)
    tagged = resolve_contrasts(written)

    def build(some: Sequence[Token]) -> BuiltQuery:
        return build_query(text, interpret(split_clauses(some), antecedent))

    built = build(tagged)
    query = built.query
    notes = tuple(_notes(tokens))
    if query.action is None:
        return (Reading(query, 0.0, tokens, notes, _find_problem(normalised, tokens, lexicon)),)
    account = account_for(tagged, build, has_partial_repair(written))
    doubt = _compose_doubt(account.doubtful)
    return tuple(
        Reading(
            one,
            score,
            tokens,
            notes,
            steps=_steps_of(one, built),
            dropped=account.dropped,
            doubt=doubt,
        )
        for one, score in list_alternatives(query, built.postmodifiers)
    )


def _steps_of(query: Query, built: BuiltQuery) -> tuple[Query, ...]:
    """Return the steps of a reading: the main one changes as its query does."""
    if len(built.steps) == 1:
        return (query,)
    main = built.steps[built.main_step]
    changed = {
        name: getattr(query, name)
        for name in ("referent", "secondary", "goal_side")
        if getattr(query, name) != getattr(built.query, name)
    }
    return (*built.steps[: built.main_step], replace(main, **changed), *built.steps[built.main_step + 1 :])


def _compose_doubt(doubtful: Sequence[str]) -> str:
    """Return the question about dropped words, '' without any."""
    words = ", ".join(f"'{word}'" for word in doubtful)
    return f"{words} was not understood: could you say it in other words?" if words else ""


def underline(text: str, problem: ParseProblem) -> str:
    """Return the normalised sentence with carets under the span of a problem, '' for a problem without a span."""
    if problem.end <= problem.start:
        return ""
    return f"  {normalise(text)}\n  {' ' * problem.start}{'^' * (problem.end - problem.start)}"


def _build(text: str, tokens: Sequence[Token]) -> BuiltQuery:
    return build_query(text, interpret(split_clauses(resolve_contrasts(tag(tokens)))))


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
    for token in [token for token in tokens if token.category is WordCategory.UNKNOWN][:3]:
        suggestion = suggest_word(token.text, (WordCategory.VERB,), lexicon)
        corrected = f"{normalised[: token.start]}{suggestion}{normalised[token.end :]}"
        if suggestion and _build(corrected, tokenise(corrected, lexicon)).query.action:
            shown = corrected if len(corrected) <= 80 else suggestion
            message = f"'{token.text}' is not understood: did you mean '{shown}'?"
            return ParseProblem(message, token.start, token.end)
    return None


def _notes(tokens: Sequence[Token]) -> list[str]:
    """Return notes on corrected and on ignored words."""
    corrected = [token for token in tokens if _alphanumeric(token.text) != _alphanumeric(token.corrected)]
    notes = [f"'{token.text}' was read as '{token.corrected}'" for token in corrected]
    unknown = [token.text for token in tokens if token.category is WordCategory.UNKNOWN]
    if unknown:
        notes.append("not understood and left out: " + ", ".join(f"'{word}'" for word in unknown[:8]))
    return notes


def _alphanumeric(text: str) -> str:
    """Return the letters and digits of a phrase."""
    return "".join(character for character in text if character.isalnum())
