"""Reading: one interpretation of a sentence."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

from grounding.language.problems import ParseProblem
from grounding.language.syntax.tokenizer import Token
from grounding.query import Query


def compose_doubt(doubtful: Sequence[str]) -> str:
    """Return the question about dropped words, '' without any."""
    words = ", ".join(f"'{word}'" for word in doubtful)
    return f"{words} was not understood: could you say it in other words?" if words else ""


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
        doubtful: the words that the question is about; () if it is about another thing.
        doubts_strange: whether it doubts only words that no lexicon holds.
        corrections: words as written and as read, where they differ.
        revised: (field, value of the grammar, value now) of each field that the reader network changed.
        otherwise: the command that counts where the scene has no place for this one; None without one.
        condition: the case in which this command counts and `otherwise` does not; without `otherwise`, the event to
            which it is the reaction; '' without a condition.
        motion: whether the vehicle of the condition has to move or to stand; '' for another condition.
        prefers_nearer: whether the nearer place of both is asked for: "whichever is closer".
    """

    query: Query
    score: float = 0.0
    tokens: tuple[Token, ...] = ()
    notes: tuple[str, ...] = ()
    problem: ParseProblem | None = None
    steps: tuple[Query, ...] = ()
    dropped: tuple[str, ...] = ()
    doubt: str = ""
    doubtful: tuple[str, ...] = ()
    doubts_strange: bool = False
    corrections: tuple[tuple[str, str], ...] = ()
    revised: tuple[tuple[str, str, str], ...] = ()
    otherwise: Reading | None = None
    prefers_nearer: bool = False
    condition: str = ""
    motion: str = ""

    def __post_init__(self) -> None:
        """Take the query as the only step if none are given."""
        object.__setattr__(self, "steps", self.steps or (self.query,))

    def without_dropped(self, used: Collection[str]) -> Reading:
        """Return the reading, of whose dropped words some are used after all: they are neither told nor doubted."""
        doubtful = tuple(word for word in self.doubtful if word not in used)
        doubt = compose_doubt(doubtful) if self.doubtful else self.doubt
        dropped = tuple(word for word in self.dropped if word not in used)
        return replace(self, dropped=dropped, doubt=doubt, doubtful=doubtful)

    @property
    def is_plain(self) -> bool:
        """Whether it is a command that is understood whole."""
        return not (self.problem or self.doubt or self.dropped or self.query.unresolved)

    def with_query(self, query: Query) -> Reading:
        """Return the reading with another query, as its only step."""
        return replace(self, query=query, steps=(query,))
