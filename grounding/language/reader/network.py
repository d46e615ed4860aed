"""Reader network: the words of a sentence to probabilities of the fields of its query, in numpy.

A sum of hashed feature vectors for each word, two bidirectional GRU layers (Cho et al., EMNLP 2014), and for each
field a pooling by attention. Class and colour of the vehicle point to words, so that they hold for any colour and
class; the probability of a qualifier is that of its best words. `python -m benchmarks.train_reader` makes the weights
in torch.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grounding.language.reader.features import WordFacts, token_features, word_facts
from grounding.language.reader.fields import CHOICES, FIELDS, NONE, NOUNS, QUALIFIERS
from grounding.language.syntax.tokenizer import Token

# Floating-point numbers of any precision.
Numbers = NDArray[np.floating[Any]]
# Words read; what follows is left to the grammar.
MAX_TOKENS = 80


@dataclass(frozen=True)
class Prediction:
    """Probabilities of the fields of a query.

    Attributes:
        choices: field of the network's choices or "noun" or "colour" -> value -> probability; NONE stands for no
            value.
        qualifiers: qualifier -> probability.
        head: word that names the vehicle most likely; '' for a word that the lexicon knows as no vehicle's name.
    """

    choices: Mapping[str, Mapping[str, float]]
    qualifiers: Mapping[str, float]
    head: str = ""

    @property
    def certainty(self) -> float:
        """Probability that the likeliest values of all voted fields are right, if they are independent."""
        chosen = [max(self.choices[field].values()) for field in FIELDS]
        return math.prod((*chosen, *(max(one, 1 - one) for one in self.qualifiers.values())))


class ReaderNetwork:
    """The network with its weights; `predict` takes about a millisecond."""

    def __init__(self, weights: Mapping[str, Numbers], choices: Mapping[str, tuple[str, ...]] = CHOICES) -> None:
        """Take the weights by name, those of `benchmarks.reader.network.export_weights`, and the fields' values."""
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
        inputs = np.stack([table[row].sum(axis=0) / np.sqrt(len(row)) for row in rows])
        words = self._layer(self._layer(inputs, 0), 1)
        attention = _softmax(self._linear("attention", words), axis=0)
        pooled, peak = attention.T @ words, words.max(axis=0)
        choices = {
            field: dict(zip(values, _softmax(self._linear(field, np.concatenate([own, peak]))).tolist(), strict=True))
            for (field, values), own in zip(self.choices.items(), pooled, strict=False)
        }
        nothing = self._linear("nothing", np.concatenate([pooled[-1], peak]))
        pointed = self._linear("point", words)
        by_noun = _softmax(np.concatenate([nothing[:1], pointed[:, 0]]))
        choices["noun"] = self._nouns(words, facts, by_noun)
        coloured = [i for i, fact in enumerate(facts) if fact.colour]
        by_colour = _softmax(np.concatenate([nothing[1:], pointed[coloured, 1]]))
        choices["colour"] = _colours([facts[i].colour for i in coloured], by_colour)
        scores = _log_sum_exp(self._linear("qualifier", words)) + self.weights["qualifier_prior"]
        qualifiers = dict(zip(QUALIFIERS, (1 / (1 + np.exp(-scores))).tolist(), strict=True))
        best = int(by_noun[1:].argmax())
        return Prediction(choices, qualifiers, facts[best].text if facts[best].noun else "")

    def _layer(self, inputs: Numbers, number: int) -> Numbers:
        """Return (T, 2 H) of a bidirectional GRU layer over (T, D)."""
        weight = self.weights
        outputs = []
        for direction in ("forward", "backward"):
            name = f"gru{number}.{direction}"
            order = inputs if direction == "forward" else inputs[::-1]
            gates = order @ weight[f"{name}.input"] + weight[f"{name}.input_bias"]
            states = _gru(gates, weight[f"{name}.state"], weight[f"{name}.state_bias"])
            outputs.append(states if direction == "forward" else states[::-1])
        return np.concatenate(outputs, axis=1)

    def _linear(self, name: str, values: Numbers) -> Numbers:
        return values @ self.weights[f"{name}.weight"] + self.weights[f"{name}.bias"]

    def _nouns(self, words: Numbers, facts: Sequence[WordFacts], pointed: Numbers) -> dict[str, float]:
        """Return the probability of each class: of the words pointed to, by lexicon or guessed."""
        guessed = _softmax(self._linear("class", words), axis=1)
        found = np.zeros(len(NOUNS))
        found[0] = pointed[0]
        for fact, share, classes in zip(facts, pointed[1:], guessed, strict=True):
            if fact.noun:
                found[NOUNS.index(fact.noun)] += share
            else:
                found[1:] += share * classes
        return dict(zip(NOUNS, found.tolist(), strict=True))


def _gru(gates: Numbers, state_weight: Numbers, state_bias: Numbers) -> Numbers:
    """Return the states (T, H) of a GRU over input gates (T, 3 H): reset, update, new."""
    size = gates.shape[1] // 3
    state = np.zeros(size, dtype=gates.dtype)
    states = np.empty((len(gates), size), dtype=gates.dtype)
    for i, gate in enumerate(gates):
        own = state @ state_weight + state_bias
        reset, update = np.split(1 / (1 + np.exp(-(gate[: 2 * size] + own[: 2 * size]))), 2)
        new = np.tanh(gate[2 * size :] + reset * own[2 * size :])
        state = new + update * (state - new)
        states[i] = state
    return states


def _colours(words: Sequence[str], pointed: Numbers) -> dict[str, float]:
    found: dict[str, float] = defaultdict(float, {NONE: float(pointed[0])})
    for word, share in zip(words, pointed[1:].tolist(), strict=True):
        found[word] += share
    return dict(found)


def _softmax(scores: Numbers, axis: int = -1) -> Numbers:
    powers = np.exp(scores - scores.max(axis=axis, keepdims=True))
    result: Numbers = powers / powers.sum(axis=axis, keepdims=True)
    return result


def _log_sum_exp(scores: Numbers) -> Numbers:
    top = scores.max(axis=0)
    result: Numbers = top + np.log(np.exp(scores - top).sum(axis=0))
    return result
