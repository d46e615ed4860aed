"""Dialogue acts of turns in a conversation, classified by a network from the words and the state of the dialogue.

The network is that of whole commands with other fields (`TURN_CHOICES`). Before the words it reads one more token:
the state of the conversation, the last command, and how the patterns of replies split the turn. `python -m
benchmarks.train_turns` makes its weights.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Literal

from appocc.typing import PathLike
from grounding.language.reader.features import WordFacts, feature_row, token_features, word_facts
from grounding.language.reader.fields import TURN_CHOICES
from grounding.language.reader.network import MAX_TOKENS, Numbers, Prediction, ReaderNetwork
from grounding.language.reader.reader import load_weights
from grounding.language.replies import Reply
from grounding.language.syntax.tokenizer import Token
from grounding.query import Query

TURNS_PATH = Path(__file__).parent / "data" / "turns.safetensors"
# Where a conversation stands: a question which vehicle is meant, an offer, a goal in force, nothing found.
State = Literal["which", "offer", "goal", "lost"]
_RULE_SHAPES = {"act": (3,)}


@dataclass(frozen=True)
class TurnReader:
    """The network of turns and the weights of its vote with the patterns of replies.

    Attributes:
        network: the network.
        rule: "act": (3,) weights as `grounding.dialogue.turns.vote_on_act` takes them.
    """

    network: ReaderNetwork
    rule: Mapping[str, Numbers]

    def read(
        self, tokens: Sequence[Token], state: State, reply: Reply, command: Query | None = None
    ) -> Prediction | None:
        """Return the probabilities of the fields of a turn; None for one without words, or too long.

        Args:
            tokens: tokens of the turn, not yet tagged.
            state: where the conversation stands.
            reply: the turn as the patterns of replies split it.
            command: the last command.
        """
        if not 0 < len(tokens) < MAX_TOKENS:
            return None
        return self.network.predict_rows(*turn_rows(tokens, state, reply, command))


def turn_rows(
    tokens: Sequence[Token], state: State, reply: Reply, command: Query | None = None
) -> tuple[list[list[int]], list[WordFacts]]:
    """Return the feature rows and the facts of each token of a turn, that of the conversation first."""
    first = [*dict.fromkeys(map(feature_row, _names(state, reply, command)))]
    return [first, *token_features(tokens)], [WordFacts(""), *word_facts(tokens)]


def _names(state: State, reply: Reply, command: Query | None) -> Iterator[str]:
    yield f"state:{state}"
    if command is not None:
        yield f"doing:{command.action}"
        yield f"about:{command.referent.noun if command.referent else None}"
        yield f"at:{command.relation}"
    part = "begins" if reply.rest else "is"
    yield from (f"{part}:{kind}" for kind in reply.kinds)
    if reply.number is not None:
        yield f"{part}:number"
    yield f"{part}:known" if reply.kinds else f"{part}:unknown"


def load_turn_reader(path: PathLike) -> TurnReader:
    """Return the reader of turns of a weights file.

    Raises:
        DataError: if the file is missing, damaged, or holds other weights.
    """
    arrays, rule = load_weights(path, TURN_CHOICES, _RULE_SHAPES)
    return TurnReader(ReaderNetwork(arrays, TURN_CHOICES), rule)


@cache
def default_turn_reader() -> TurnReader:
    """Return the reader of turns of the package, loaded once.

    Raises:
        DataError: if its weights file is missing or damaged.
    """
    return load_turn_reader(TURNS_PATH)
