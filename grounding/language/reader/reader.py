"""The reader: network and voting rule from one weights file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load

from appocc.errors import DataError
from appocc.files import read_file
from appocc.typing import PathLike
from grounding.language.reader.features import TABLE_ROWS
from grounding.language.reader.fields import CHOICES, NOUNS, TAGS
from grounding.language.reader.network import MAX_TOKENS, Numbers, ReaderNetwork
from grounding.language.reader.revision import Evidence, Revision, revise
from grounding.language.syntax.tokenizer import Token
from grounding.query import Query

WEIGHTS_PATH = Path(__file__).parent / "data" / "reader.safetensors"
_MOST_BYTES = 10_000_000
_RULE = "rule."
_RULE_SHAPES = {"status": (9,), "reading": (3,)}


@dataclass(frozen=True)
class Reader:
    """A network and the weights of its votes.

    Attributes:
        network: the network.
        rule: weights as `revise` takes them.
    """

    network: ReaderNetwork
    rule: Mapping[str, Numbers]

    def revise(self, query: Query, evidence: Evidence, tokens: Sequence[Token]) -> Revision | None:
        """Return the grammar's query after the vote of the network; None for a text that is too long for it.

        Args:
            query: the grammar's query; without an action if it finds no command.
            evidence: how well the grammar understood the sentence.
            tokens: tokens of the sentence, not yet tagged.
        """
        if not 0 < len(tokens) <= MAX_TOKENS:
            return None
        return revise(query, evidence, self.network.predict(tokens), self.rule)


def load_reader(path: PathLike) -> Reader:
    """Return the reader of a weights file.

    Raises:
        DataError: if the file is missing, damaged, or holds other weights.
    """
    arrays, rule = load_weights(path, CHOICES, _RULE_SHAPES)
    return Reader(ReaderNetwork(arrays), rule)


def load_weights(
    path: PathLike, choices: Mapping[str, tuple[str, ...]], rule_shapes: Mapping[str, tuple[int, ...]]
) -> tuple[dict[str, Numbers], dict[str, Numbers]]:
    """Return the arrays of a weights file by name, and those of its rule.

    Args:
        path: the file.
        choices: fields of the network and their values.
        rule_shapes: shape of each array of the rule.

    Raises:
        DataError: if the file is missing, damaged, or holds other weights.
    """
    try:
        arrays = {name: array.astype(np.float32) for name, array in load(read_file(path, _MOST_BYTES)).items()}
    except (SafetensorError, ValueError, TypeError) as error:
        raise DataError(f"{path}: no weights of the reader ({error})") from error
    size, hidden = (arrays[name].shape[-1] if name in arrays else 0 for name in ("table", "gru0.forward.state"))
    members = len(arrays["table"]) if "table" in arrays else 0
    expected = {name: (members, *shape) for name, shape in _expected_shapes(size, hidden // 3, choices).items()}
    expected |= {f"{_RULE}{name}": shape for name, shape in rule_shapes.items()}
    for name, shape in expected.items():
        got = arrays[name].shape if name in arrays else None
        if got != shape:
            raise DataError(f"{path}: {name}: expected shape {shape}, got {got}")
        if not np.isfinite(arrays[name]).all():
            raise DataError(f"{path}: {name}: expected finite numbers")
    rule = {name.removeprefix(_RULE): array for name, array in arrays.items() if name.startswith(_RULE)}
    return arrays, rule


def _expected_shapes(size: int, hidden: int, choices: Mapping[str, tuple[str, ...]]) -> dict[str, tuple[int, ...]]:
    """Return array name -> shape in one network, for `size` numbers a feature and `hidden` states a direction."""
    both = 2 * hidden
    shapes: dict[str, tuple[int, ...]] = {"table": (TABLE_ROWS, size), "tag_prior": (len(TAGS),)}
    for layer, inputs in enumerate((size, both)):
        for name in (f"gru{layer}.forward", f"gru{layer}.backward"):
            shapes |= {f"{name}.input": (inputs, 3 * hidden), f"{name}.state": (hidden, 3 * hidden)}
            shapes |= {f"{name}.input_bias": (3 * hidden,), f"{name}.state_bias": (3 * hidden,)}
    linear = {field: (2 * both, len(values)) for field, values in choices.items()}
    linear |= {"attention": (both, len(choices) + 1), "nothing": (2 * both, 2), "point": (both, 2)}
    linear |= {"class": (both, len(NOUNS) - 1), "tag": (both, len(TAGS))}
    for name, (inputs, outputs) in linear.items():
        shapes |= {f"{name}.weight": (inputs, outputs), f"{name}.bias": (outputs,)}
    return shapes


@cache
def default_reader() -> Reader:
    """Return the reader of the package, loaded once.

    Raises:
        DataError: if its weights file is missing or damaged.
    """
    return load_reader(WEIGHTS_PATH)
