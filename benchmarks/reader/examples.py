"""Labelled sentences as examples for the reader network."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from grounding.language.evaluation import read_labelled_commands
from grounding.language.reader.features import WordFacts, token_features, word_facts
from grounding.language.reader.fields import ACTIONS, CHOICES, NONE, NOUNS, QUALIFIERS
from grounding.language.reader.network import MAX_TOKENS
from grounding.language.syntax.tokenizer import normalise, tokenise

ROOT = Path(__file__).parents[2]
STRANGERS = Path(__file__).parent / "sentences" / "strangers.jsonl"
UNSEEN = Path(__file__).parent / "sentences" / "unseen_sentences.jsonl"
_SPEAKERS = ROOT / "benchmarks" / "grounding_truth" / "speakers"
_TESTS = ROOT / "tests" / "grounding" / "language"
# Where several values are right, how likely the first is preferred (nats).
_ALTERNATIVE = 0.3


@dataclass(frozen=True, eq=False)
class Sentence:
    """A labelled sentence.

    Attributes:
        label: the record, as `read_labelled_commands` returns it.
        speaker: who says it; all sentences of one speaker are learnt or held out together.
        weight: how often it is drawn.
    """

    label: dict[str, Any]
    speaker: str
    weight: float

    @property
    def is_stranger(self) -> bool:
        """Whether its speaker was written after the grammar, so that held-out figures are fair."""
        return self.speaker.startswith("stranger ")


def read_sentences() -> list[Sentence]:
    """Return the project's own labelled sentences: those of the strangers, of earlier speakers, and of the tests."""
    found = [Sentence(one, f"stranger {one['source']}", 2.0) for one in read_labelled_commands(STRANGERS)]
    for name in ("seen", "unread", "later", "latest_seen"):
        labels = read_labelled_commands(_SPEAKERS / f"sentences_{name}.jsonl")
        found += [Sentence(one, f"earlier {one['source']}", 2.5) for one in labels]
    found += [Sentence(one, "own", 1.6) for one in read_labelled_commands(_TESTS / "commands.jsonl")]
    everyday = filter(None, (_TESTS / "everyday.txt").read_text(encoding="utf-8").splitlines())
    return found + [Sentence(rejected(text), "everyday", 1.6) for text in everyday]


def read_unseen_sentences() -> list[Sentence]:
    """Return the sentences of authors of whom nothing is learnt."""
    return [Sentence(one, one["source"], 1.0) for one in read_labelled_commands(UNSEEN)]


def rejected(text: str) -> dict[str, Any]:
    """Return the label of a sentence that is no command."""
    empty: dict[str, Any] = {"command": text, "status": "reject", "relation": "none"}
    empty |= dict.fromkeys(("action", "direction", "goal_side", "landmark", "trigger", "referent"))
    empty |= dict.fromkeys(("distance_m", "distance_of"))
    return empty | {key: [] for key in ("action_alt", "actions", "relation_alt", "secondary", "excluded")}


@dataclass(frozen=True, eq=False)
class Example:
    """A sentence as the network sees it.

    Attributes:
        rows: rows of the feature table of each word.
        facts: facts of each word.
        right: field -> indices of the right values, the preferred one first; empty: not trained.
        tags: (G,) whether the label has each of `TAGS`, and (G,) whether that counts.
    """

    rows: list[list[int]]
    facts: list[WordFacts]
    right: dict[str, list[int]]
    tags: tuple[np.ndarray, np.ndarray]


def example_of(label: dict[str, Any]) -> Example | None:
    """Return the example of a labelled sentence, None for one without words."""
    rows, facts = _read_words(label["command"])
    tags = tags_of(label["referent"], label["status"] == "ok", label)
    return Example(rows, facts, _right_values(label, facts), tags) if rows else None


def _read_words(text: str) -> tuple[list[list[int]], list[WordFacts]]:
    tokens = tokenise(normalise(text))[:MAX_TOKENS]
    return token_features(tokens), word_facts(tokens)


def _right_values(label: dict[str, Any], facts: list[WordFacts]) -> dict[str, list[int]]:
    if label["status"] == "reject":
        return {"status": [CHOICES["status"].index("reject")]}
    right = {}
    for field, values in CHOICES.items():
        named = [one or NONE for one in (label[field], *label.get(f"{field}_alt", ()))]
        right[field] = [values.index(one) for one in named if one in values]
    referent = label["referent"] or {"noun": NONE}
    nouns = (referent["noun"], *referent.get("noun_alt", ()))
    right["noun"] = [NOUNS.index(one) for one in nouns if one in NOUNS]
    right["colour"] = colour_words(referent.get("colour"), facts)
    return right


def colour_words(colour: str | None, facts: Sequence[WordFacts]) -> list[int]:
    """Return the indices of the words of a colour, from 1; 0 for no colour."""
    return [1 + i for i, fact in enumerate(facts) if fact.colour == colour] if colour else [0]


def tags_of(
    referent: dict[str, Any] | None, describes: bool, command: dict[str, Any] | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return (G,) which of `TAGS` a label has, and (G,) which of them are trained.

    Args:
        referent: the vehicle of the label.
        describes: whether its qualifiers are trained.
        command: the label of a whole sentence; without one the actions are not trained.
    """
    said, optional = (set((referent or {}).get(key, ())) for key in ("qualifiers", "qualifiers_optional"))
    actions, others = (set((command or {}).get(key, ())) for key in ("actions", "action_alt"))
    has = [*(one in said for one in QUALIFIERS), *(one in actions for one in ACTIONS)]
    counts = [describes and one not in optional for one in QUALIFIERS]
    counts += [command is not None and (one in actions or one not in others) for one in ACTIONS]
    return np.array(has, np.float32), np.array(counts, np.float32)


def preferences(examples: Iterable[Example], field: str, width: int) -> tuple[Tensor, Tensor]:
    """Return (B, width) what is added to the log probabilities of a field, and (B,) whether it is trained."""
    rights = [one.right.get(field, []) for one in examples]
    added = torch.full((len(rights), width), -1e4)
    for i, values in enumerate(rights):
        for order, value in enumerate(values):
            added[i, value] = -_ALTERNATIVE if order and field != "colour" else 0.0
    return added, torch.tensor([bool(values) for values in rights])
