"""The reader network in torch, the twin of `grounding.language.reader.network`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn

from grounding.language.reader.features import TABLE_ROWS, WORD_ROWS, WordFacts
from grounding.language.reader.fields import NOUNS, TAGS
from grounding.language.reader.network import Numbers

_IMPOSSIBLE = -1e4


@dataclass(frozen=True, eq=False)
class Batch:
    """Sentences of equal or padded length.

    Attributes:
        rows: (B, T, K) rows of the feature table, 0 for none.
        mask: (B, T) whether there is a word.
        nouns: (B, T) class that the word names, as an index into `NOUNS`, 0 if the lexicon knows none.
        colours: (B, T) whether the word names a colour.
    """

    rows: Tensor
    mask: Tensor
    nouns: Tensor
    colours: Tensor


def batch_of(sentences: Sequence[tuple[Sequence[Sequence[int]], Sequence[WordFacts]]]) -> Batch:
    """Return the batch of (feature rows, facts) of sentences."""
    length = max(len(rows) for rows, _ in sentences)
    widest = max(len(row) for rows, _ in sentences for row in rows)
    numbers = np.zeros((len(sentences), length, widest), dtype=np.int64)
    nouns, colours = np.zeros(numbers.shape[:2], dtype=np.int64), np.zeros(numbers.shape[:2], dtype=bool)
    for i, (rows, facts) in enumerate(sentences):
        for j, (row, fact) in enumerate(zip(rows, facts, strict=True)):
            numbers[i, j, : len(row)] = row
            nouns[i, j] = NOUNS.index(fact.noun) if fact.noun else 0
            colours[i, j] = bool(fact.colour)
    mask = numbers[:, :, 0] > 0
    return Batch(*(torch.from_numpy(one) for one in (numbers, mask, nouns, colours)))


class TorchReader(nn.Module):
    """The network; `forward` returns log probabilities of each field."""

    def __init__(
        self,
        choices: Mapping[str, tuple[str, ...]],
        *,
        size: int,
        hidden: int,
        dropout: float,
        feature_dropout: float,
        word_dropout: float,
    ) -> None:
        """Make the layers for fields with the given values: `size` numbers a word, `hidden` states a direction."""
        super().__init__()
        self.fields = tuple(choices)
        both = 2 * hidden
        self.table = nn.Embedding(TABLE_ROWS, size, padding_idx=0)
        with torch.no_grad():
            self.table.weight.mul_(0.3)
        self.gru = nn.GRU(size, hidden, 2, bidirectional=True, batch_first=True, dropout=dropout)
        self.attention = nn.Linear(both, len(choices) + 1)
        self.choices = nn.ModuleDict({field: nn.Linear(2 * both, len(values)) for field, values in choices.items()})
        self.nothing, self.point = nn.Linear(2 * both, 2), nn.Linear(both, 2)
        self.classes, self.tag = nn.Linear(both, len(NOUNS) - 1), nn.Linear(both, len(TAGS))
        self.tag_prior = nn.Parameter(torch.full((len(TAGS),), -2.0))
        self._drop, self._feature_dropout, self._word_dropout = nn.Dropout(dropout), feature_dropout, word_dropout

    def forward(self, batch: Batch) -> dict[str, Tensor]:
        """Return field -> (B, values) log probabilities; "colour": (B, 1 + T), none and each word.

        "tag" has (B, tags) log odds.
        """
        rows = batch.rows
        if self.training:
            rows = rows * (torch.rand(rows.shape) > self._feature_dropout)
            # A word that was never seen has its category and its classes.
            rows = rows * ~((torch.rand((*rows.shape[:2], 1)) < self._word_dropout) & (rows >= WORD_ROWS))
        scale = (rows > 0).sum(-1, keepdim=True).clamp(min=1).sqrt()
        summed = nn.functional.embedding_bag(rows.flatten(0, 1), self.table.weight, mode="sum", padding_idx=0)
        inputs = self._drop(summed.view(*rows.shape[:2], -1) / scale)
        lengths = batch.mask.sum(1)
        packed = nn.utils.rnn.pack_padded_sequence(inputs, lengths, batch_first=True, enforce_sorted=False)
        words, _ = nn.utils.rnn.pad_packed_sequence(self.gru(packed)[0], batch_first=True, total_length=rows.shape[1])
        words = self._drop(words)
        padding = (~batch.mask).float() * _IMPOSSIBLE
        attention = torch.softmax(self.attention(words) + padding[..., None], dim=1)
        pooled = torch.einsum("btf,btd->bfd", attention, words)
        peak = (words + padding[..., None]).amax(1)
        found = {
            field: torch.log_softmax(self.choices[field](torch.cat([pooled[:, i], peak], -1)), -1)
            for i, field in enumerate(self.fields)
        }
        nothing = self.nothing(torch.cat([pooled[:, -1], peak], -1))
        pointed = self.point(words) + padding[..., None]
        found["noun"] = self._nouns(words, batch.nouns, torch.cat([nothing[:, :1], pointed[..., 0]], 1))
        coloured = pointed[..., 1] + (~batch.colours).float() * _IMPOSSIBLE
        found["colour"] = torch.log_softmax(torch.cat([nothing[:, 1:], coloured], 1), -1)
        found["tag"] = torch.logsumexp(self.tag(words) + padding[..., None], 1) + self.tag_prior
        return found

    def _nouns(self, words: Tensor, known: Tensor, pointed: Tensor) -> Tensor:
        shares = torch.log_softmax(pointed, -1)
        certain = torch.log(nn.functional.one_hot(known, len(NOUNS))[..., 1:].float() + 1e-9)
        classes = torch.where((known > 0)[..., None], certain, torch.log_softmax(self.classes(words), -1))
        return torch.cat([shares[:, :1], torch.logsumexp(shares[:, 1:, None] + classes, 1)], 1)


def export_weights(network: TorchReader) -> dict[str, Numbers]:
    """Return the weights by the names and in the layout of `grounding.language.reader.network`, float16."""
    state = {name: value.detach().numpy() for name, value in network.state_dict().items()}
    weights = {name: _turned(name, state[source]) for name, source in _sources(network).items()}
    return {name: np.ascontiguousarray(value, dtype=np.float16) for name, value in weights.items()}


def stacked(networks: Sequence[Mapping[str, Numbers]]) -> dict[str, Numbers]:
    """Return the weights of several networks as those of an ensemble, (M, ...) each."""
    return {name: np.stack([one[name] for one in networks]) for name in networks[0]}


def start_from(network: TorchReader, weights: Mapping[str, Numbers], fields: Sequence[str]) -> None:
    """Copy the weights of another network, as exported, where both have the same; `fields`: those of the other."""
    state = network.state_dict()
    for name, source in _sources(network).items():
        if name in weights and weights[name].shape == _turned(name, state[source].numpy()).shape:
            state[source].copy_(torch.from_numpy(_turned(name, weights[name].astype(np.float32)).copy()))
    for i, field in enumerate((*network.fields, "pointers")):
        if field in (*fields, "pointers"):
            column = [*fields, "pointers"].index(field)
            state["attention.weight"][i] = torch.from_numpy(weights["attention.weight"][:, column].astype(np.float32))
            state["attention.bias"][i] = float(weights["attention.bias"][column])
    network.load_state_dict(state)


def _sources(network: TorchReader) -> dict[str, str]:
    """Return exported name -> name in the state of the network."""
    sources = {"table": "table.weight", "tag_prior": "tag_prior"}
    for layer in (0, 1):
        for direction, suffix in (("forward", ""), ("backward", "_reverse")):
            for name, source in (("input", "ih"), ("state", "hh")):
                sources[f"gru{layer}.{direction}.{name}"] = f"gru.weight_{source}_l{layer}{suffix}"
                sources[f"gru{layer}.{direction}.{name}_bias"] = f"gru.bias_{source}_l{layer}{suffix}"
    names = {"attention": "attention", "nothing": "nothing", "point": "point"}
    names |= {"class": "classes", "tag": "tag"} | {one: f"choices.{one}" for one in network.fields}
    for name, source in names.items():
        sources |= {f"{name}.{part}": f"{source}.{part}" for part in ("weight", "bias")}
    return sources


def _turned(name: str, array: Numbers) -> Numbers:
    """Return an array as exported, or back: matrices but the table are transposed."""
    return array.T if array.ndim == 2 and name != "table" else array
