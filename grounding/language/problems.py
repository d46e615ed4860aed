"""Problems: why a sentence is not a driving command, and what may be meant."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from appocc.errors import AppoccError
from grounding.language.syntax.lexicon import Lexicon
from grounding.language.syntax.quantities import unheld_amounts
from grounding.language.syntax.spelling import suggest_word
from grounding.language.syntax.tokenizer import Token, normalise
from grounding.language.syntax.word_categories import WordCategory
from grounding.language.syntax.word_model import common_words

_EXAMPLE = "park behind the silver car"
_ACTIONS = "park, stop, follow, overtake, turn and their like"
# What to say of other questions.
ANSWERABLE = "asked for can be vehicles, their distance, size, colour and speed, gaps, and the plan with its reasons"
_FUNCTION_WORDS = (
    WordCategory.FILLER,
    WordCategory.GREETING,
    WordCategory.BREAK,
    WordCategory.COMMA,
    WordCategory.THE,
    WordCategory.ANY,
)
# Unknown words that may be misspelt verbs.
_MAX_MISSPELT = 3


class CommandError(AppoccError, TypeError):
    """A command is no text."""


@dataclass(frozen=True)
class ParseProblem:
    """Why a sentence is not a driving command: a message and a span of the normalised sentence (empty if none).

    `unreadable`: whether its words are the reason: one that is misspelt, or none that is English.
    """

    message: str
    start: int = 0
    end: int = 0
    unreadable: bool = False


def underline(text: str, problem: ParseProblem) -> str:
    """Return the normalised sentence with carets under the span of a problem, '' for a problem without a span."""
    if problem.end <= problem.start:
        return ""
    return f"  {normalise(text)}\n  {' ' * problem.start}{'^' * (problem.end - problem.start)}"


def find_problem(
    normalised: str, tokens: Sequence[Token], lexicon: Lexicon, is_command: Callable[[str], bool]
) -> ParseProblem:
    """Return why a sentence is not a driving command.

    Args:
        normalised: the normalised sentence.
        tokens: its tokens.
        lexicon: verbs to suggest.
        is_command: whether a normalised sentence is a command.
    """
    if not tokens:
        return ParseProblem("the sentence holds no words", unreadable=True)
    if misspelling := _find_misspelt_verb(normalised, tokens, lexicon, is_command):
        return misspelling
    if all(token.category in (WordCategory.UNKNOWN, *_FUNCTION_WORDS) for token in tokens):
        message = f"no word of it is understood: expected a command such as '{_EXAMPLE}'"
        return ParseProblem(message, unreadable=not any(token.text in common_words() for token in tokens))
    if figures := unheld_amounts(tokens):
        return ParseProblem(f"no driving action in it: '{figures[0]}' cannot be set, say 'slower' or 'faster'")
    first = next(token for token in tokens if token.category not in _FUNCTION_WORDS)
    if first.category is WordCategory.QUESTION:
        return ParseProblem(f"a question is no driving command; {ANSWERABLE}", first.start, first.end)
    if first.category is WordCategory.NONDRIVE:
        return ParseProblem(f"'{first.written}' is no driving action: expected {_ACTIONS}", first.start, first.end)
    return ParseProblem(f"no driving action in it: expected {_ACTIONS}")


def _find_misspelt_verb(
    normalised: str, tokens: Sequence[Token], lexicon: Lexicon, is_command: Callable[[str], bool]
) -> ParseProblem | None:
    """Return the problem of a misspelt verb: with the suggested verb the sentence is a command."""
    unknown = [
        token for token in tokens if token.category is WordCategory.UNKNOWN and token.text not in common_words()
    ]
    verbs = lexicon.written_words(WordCategory.VERB) if unknown else []
    for token in unknown[:_MAX_MISSPELT]:
        suggestion = suggest_word(token.text, verbs)
        corrected = f"{normalised[: token.start]}{suggestion}{normalised[token.end :]}"
        if suggestion and is_command(corrected):
            shown = corrected if len(corrected) <= 80 else suggestion
            message = f"'{token.written}' is not understood: did you mean '{shown}'?"
            return ParseProblem(message, token.start, token.end, unreadable=True)
    return None


def check_type(text: object) -> None:
    """Check that a command is text.

    Raises:
        CommandError: if it is not.
    """
    if not isinstance(text, str):
        raise CommandError(f"expected a command as text (str), got {type(text).__name__}")
