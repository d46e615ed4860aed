"""Reading: one interpretation of a sentence."""

from __future__ import annotations

from dataclasses import dataclass, replace

from grounding.language.problems import ParseProblem
from grounding.language.syntax.tokenizer import Token
from grounding.query import Query


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
        doubt: question about dropped words without which the place may be the wrong one, to be asked before the
            reading is acted upon; '' if there is none.
        doubts_strange: whether it doubts only words that no lexicon holds.
        corrections: words as written and as read, where they differ.
        revised: (field, value of the grammar, value now) of each field that the reader network changed.
    """

    query: Query
    score: float = 0.0
    tokens: tuple[Token, ...] = ()
    notes: tuple[str, ...] = ()
    problem: ParseProblem | None = None
    steps: tuple[Query, ...] = ()
    dropped: tuple[str, ...] = ()
    doubt: str = ""
    doubts_strange: bool = False
    corrections: tuple[tuple[str, str], ...] = ()
    revised: tuple[tuple[str, str, str], ...] = ()

    def __post_init__(self) -> None:
        """Take the query as the only step if none are given."""
        object.__setattr__(self, "steps", self.steps or (self.query,))

    def with_query(self, query: Query) -> Reading:
        """Return the reading with another query, as its only step."""
        return replace(self, query=query, steps=(query,))
