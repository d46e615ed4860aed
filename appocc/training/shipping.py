"""Weights for others to use: half the size, with a card that says what they came from and what they can do."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, ValidationError

from appocc.errors import DataError
from appocc.files import read_json
from appocc.jsonparts import JsonPart, first_problem
from appocc.models.weights import load_model, read_thresholds, save_weights

_ENDING = ".safetensors"
_Count = Annotated[int, Field(ge=0)]
_Shares = dict[str, Annotated[float, Field(ge=0, le=1)] | None]


class _Figures(JsonPart):
    samples: _Count
    iou: _Shares
    iou_at_threshold: _Shares | None = None


class _Steps(JsonPart):
    batch: _Count
    seed: _Count


class _Training(JsonPart):
    train: _Steps


class _Validation(JsonPart):
    best_iou: _Shares


class _Told(JsonPart):
    """What is shown of a card; weights that no training of this project left may have none of it."""

    training: _Training | None = None
    step: _Count | None = None
    validation: _Validation | None = None
    figures: _Figures | None = None
    commands: list[str] = Field(default_factory=list)


def read_figures(path: Path) -> dict[str, Any]:
    """What `appocc eval bev --json` said, from a file.

    Raises:
        DataError: if it is missing or something else.
    """
    figures: dict[str, Any] = read_json(path)
    try:
        _Figures.model_validate(figures)
    except ValidationError as error:
        raise DataError(
            f"{path}: expected the answer of 'appocc eval bev --json', got something else ({first_problem(error)})"
        ) from error
    return figures


def ship(source: Path, out: Path, figures: Mapping[str, Any] | None, commands: Sequence[str]) -> None:
    """Write the weights of a training as float16, with more on their card.

    Args:
        source: weights that a training left.
        out: ends in .safetensors.
        figures: what `appocc eval bev --json` said of their maps of unseen places.
        commands: that made the data and the weights.

    Raises:
        DataError: if the weights are missing or damaged, or `out` has another ending or cannot be written.
    """
    if out.suffix != _ENDING:
        raise DataError(f"{out}: expected a name that ends in {_ENDING}")
    model, card = load_model(source)
    more = {"figures": json.dumps(figures, sort_keys=True), "commands": json.dumps(list(commands))}
    save_weights(out, model, {**card, **more}, half=True)


def described(path: Path) -> dict[str, Any]:
    """What a file of weights says of itself, as JSON values.

    Raises:
        DataError: if it is missing or damaged, or its card says what cannot be.
    """
    model, card = load_model(path)
    told = {name: _value(text) for name, text in card.items()}
    try:
        _Told.model_validate(told)
    except ValidationError as error:
        raise DataError(f"{path}: the card cannot be true ({first_problem(error)})") from error
    numbers = sum(parameter.numel() for parameter in model.parameters())
    own = {"file": str(path), "bytes": path.stat().st_size, "parameters": numbers}
    # First, and whatever a card says of the same names.
    return {**own, **told, **own, "thresholds": list(read_thresholds(card))}


def _value(text: str) -> Any:
    """Entries are JSON, or plain texts."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return text
