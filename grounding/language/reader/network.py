"""Reader network: the words of a sentence to probabilities of the fields of its query, in numpy.

A sum of hashed feature vectors for each word, two bidirectional GRU layers (Cho et al., EMNLP 2014), and for each
field a pooling by attention. Class and colour of the vehicle point to words, so that they hold for any colour and
class; the probability of a qualifier, and of a commanded action, is that of its best words. Several networks, trained
from different seeds, are averaged. `python -m benchmarks.train_reader` makes the weights in torch.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grounding.language.reader.features import WordFacts, token_features, word_facts
from grounding.language.reader.fields import ACTIONS, CHOICES, NONE, NOUNS, QUALIFIERS, TAGS
from grounding.language.syntax.tokenizer import Token

# Floating-point numbers of any precision.
Numbers = NDArray[np.floating[Any]]
# Probability above which a qualifier is likely.
_LIKELY = 0.5
# Words read; what follows is left to the grammar.
MAX_TOKENS = 80


@dataclass(frozen=True)
class Prediction:
    """Probabilities of the fields of a query.

    Attributes:
        choices: field of the network's choices or "noun" or "colour" -> value -> probability; NONE stands for no
            value.
        qualifiers: qualifier -> probability.
        actions: action -> probability that it is commanded.
        head: word that names the vehicle most likely; '' for a word that the lexicon knows as no vehicle's name.
    """

    choices: Mapping[str, Mapping[str, float]]
    qualifiers: Mapping[str, float]
    actions: Mapping[str, float]
    head: str = ""

    @property
    def likely_qualifiers(self) -> tuple[str, ...]:
        """Qualifiers that are likelier than not."""
        return tuple(one for one, share in self.qualifiers.items() if share > _LIKELY)

    def best(self, field: str) -> str:
        """Return the likeliest value of a field."""
        shares = self.choices[field]
        return max(shares, key=shares.__getitem__)


class ReaderNetwork:
    """An ensemble of M networks with their weights; `predict` takes about a millisecond and returns their mean."""

    def __init__(self, weights: Mapping[str, Numbers], choices: Mapping[str, tuple[str, ...]] = CHOICES) -> None:
        """Take the weights (M, ...) by name, as `benchmarks.reader.network.stacked` returns them, and the fields."""
        self.choices = choices
        self.weights = {name: array.astype(np.float32) for name, array in weights.items()}

    def predict(self, tokens: Sequence[Token]) -> Prediction:
        """Return the probabilities for a sentence.

        Args:
            tokens: its tokens, not yet tagged; at least one. Those after `MAX_TOKENS` are left out.
        """
        tokens = tokens[:MAX_TOKENS]
        return self.predict_rows(token_features(tokens), word_facts(tokens))

    def predict_rows(self, rows: Sequence[Sequence[int]], facts: Sequence[WordFacts]) -> Prediction:
        """Return the probabilities for the feature rows and the facts of each word."""
        table = self.weights["table"]
        inputs = np.stack([table[:, row].sum(axis=1) / np.sqrt(len(row)) for row in rows], axis=1)
        words = self._layer(self._layer(inputs, 0), 1)
        attention = _softmax(self._linear("attention", words), axis=1)
        # (M, fields + 1, 4 H): of each field what its attention pools, and the peaks.
        pooled = attention.transpose(0, 2, 1) @ words
        pooled = np.concatenate([pooled, np.broadcast_to(words.max(axis=1, keepdims=True), pooled.shape)], axis=2)
        choices = {
            field: dict(zip(values, _mean(_softmax(self._linear(field, pooled[:, i : i + 1]))), strict=True))
            for i, (field, values) in enumerate(self.choices.items())
        }
        nothing = self._linear("nothing", pooled[:, -1:])
        pointed = self._linear("point", words)
        by_noun = _softmax(np.concatenate([nothing[:, :, 0], pointed[:, :, 0]], axis=1))
        choices["noun"] = self._nouns(words, facts, by_noun)
        coloured = [i for i, fact in enumerate(facts) if fact.colour]
        by_colour = _softmax(np.concatenate([nothing[:, :, 1], pointed[:, coloured, 1]], axis=1))
        choices["colour"] = _colours([facts[i].colour for i in coloured], by_colour.mean(axis=0))
        scores = _log_sum_exp(self._linear("tag", words), axis=1) + self.weights["tag_prior"]
        tags = dict(zip(TAGS, _mean(1 / (1 + np.exp(-scores[:, None]))), strict=True))
        qualifiers, actions = ({one: tags[one] for one in names} for names in (QUALIFIERS, ACTIONS))
        best = int(by_noun.mean(axis=0)[1:].argmax())
        return Prediction(choices, qualifiers, actions, facts[best].text if facts[best].noun else "")

    def _layer(self, inputs: Numbers, number: int) -> Numbers:
        """Return (M, T, 2 H) of a bidirectional GRU layer over (M, T, D)."""
        weight = self.weights
        outputs = []
        for direction in ("forward", "backward"):
            name = f"gru{number}.{direction}"
            order = inputs if direction == "forward" else inputs[:, ::-1]
            gates = order @ weight[f"{name}.input"] + weight[f"{name}.input_bias"][:, None]
            states = _gru(gates, weight[f"{name}.state"], weight[f"{name}.state_bias"][:, None])
            outputs.append(states if direction == "forward" else states[:, ::-1])
        return np.concatenate(outputs, axis=2)

    def _linear(self, name: str, values: Numbers) -> Numbers:
        """Return (M, T, outputs) of values (M, T, inputs)."""
        return values @ self.weights[f"{name}.weight"] + self.weights[f"{name}.bias"][:, None]

    def _nouns(self, words: Numbers, facts: Sequence[WordFacts], pointed: Numbers) -> dict[str, float]:
        """Return the probability of each class: of the words pointed to (M, 1 + T), by lexicon or guessed."""
        guessed = _softmax(self._linear("class", words))
        found = np.zeros((len(pointed), len(NOUNS)))
        found[:, 0] = pointed[:, 0]
        for i, fact in enumerate(facts):
            if fact.noun:
                found[:, NOUNS.index(fact.noun)] += pointed[:, i + 1]
            else:
                found[:, 1:] += pointed[:, i + 1, None] * guessed[:, i]
        return dict(zip(NOUNS, found.mean(axis=0).tolist(), strict=True))


def _gru(gates: Numbers, state_weight: Numbers, state_bias: Numbers) -> Numbers:
    """Return the states (M, T, H) of a GRU over input gates (M, T, 3 H): reset, update, new."""
    size = gates.shape[2] // 3
    state = np.zeros((len(gates), 1, size), dtype=gates.dtype)
    states = np.empty((*gates.shape[:2], size), dtype=gates.dtype)
    for i in range(gates.shape[1]):
        gate = gates[:, i : i + 1]
        own = state @ state_weight + state_bias
        reset, update = np.split(1 / (1 + np.exp(-(gate[..., : 2 * size] + own[..., : 2 * size]))), 2, axis=-1)
        new = np.tanh(gate[..., 2 * size :] + reset * own[..., 2 * size :])
        state = new + update * (state - new)
        states[:, i] = state[:, 0]
    return states


def _colours(words: Sequence[str], pointed: Numbers) -> dict[str, float]:
    found: dict[str, float] = defaultdict(float, {NONE: float(pointed[0])})
    for word, share in zip(words, pointed[1:].tolist(), strict=True):
        found[word] += share
    return dict(found)


def _mean(shares: Numbers) -> list[float]:
    """Return the mean over the members of (M, 1, V)."""
    found: list[float] = shares[:, 0].mean(axis=0).tolist()
    return found


def _softmax(scores: Numbers, axis: int = -1) -> Numbers:
    powers = np.exp(scores - scores.max(axis=axis, keepdims=True))
    result: Numbers = powers / powers.sum(axis=axis, keepdims=True)
    return result


def _log_sum_exp(scores: Numbers, axis: int) -> Numbers:
    top = scores.max(axis=axis, keepdims=True)
    result: Numbers = top.squeeze(axis) + np.log(np.exp(scores - top).sum(axis=axis))
    return result
