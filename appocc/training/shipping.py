"""Weights for others to use: half the size, with a card that says what they came from and what they can do."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from appocc.models.weights import load_model, save_weights


def ship(source: Path, out: Path, figures: Mapping[str, Any] | None, commands: Sequence[str]) -> None:
    """Write the weights of a training as float16, with more on their card.

    Args:
        source: weights that a training left.
        out: ends in .safetensors.
        figures: what `appocc eval bev --json` said of their maps of unseen places.
        commands: that made the data and the weights.

    Raises:
        DataError: if the weights are missing or damaged, or `out` cannot be written.
    """
    model, card = load_model(source)
    more = {"figures": json.dumps(figures, sort_keys=True), "commands": json.dumps(list(commands))}
    save_weights(out, model, {**card, **more}, half=True)


def described(path: Path) -> dict[str, Any]:
    """What a file of weights says of itself, as JSON values.

    Raises:
        DataError: if it is missing or damaged.
    """
    model, card = load_model(path)
    told = {name: _value(text) for name, text in card.items()}
    numbers = sum(parameter.numel() for parameter in model.parameters())
    return {"file": str(path), "bytes": path.stat().st_size, "parameters": numbers, **told}


def _value(text: str) -> Any:
    """Entries are JSON, or plain texts."""
    try:
        return json.loads(text)
    except ValueError:
        return text
