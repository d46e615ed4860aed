"""Weights for distribution: float16, with a model card of their training and evaluation."""

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

_SUFFIX = ".safetensors"
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


class _ModelCard(JsonPart):
    """Checked entries of a model card; weights from other projects may lack all of them."""

    training: _Training | None = None
    step: _Count | None = None
    validation: _Validation | None = None
    figures: _Figures | None = None
    commands: list[str] = Field(default_factory=list)
    attribution: str | None = None


def read_figures(path: Path) -> dict[str, Any]:
    """Read the output of `appocc eval bev --json` from a file.

    Raises:
        DataError: if the file is missing or holds something else.
    """
    figures: dict[str, Any] = read_json(path)
    try:
        _Figures.model_validate(figures)
    except ValidationError as error:
        raise DataError(
            f"{path}: expected the output of 'appocc eval bev --json', got something else ({first_problem(error)})"
        ) from error
    return figures


def ship_weights(source: Path, out: Path, figures: Mapping[str, Any] | None, commands: Sequence[str]) -> None:
    """Write the weights of a training as float16 with an extended model card.

    Args:
        source: weights file of a training.
        out: new file, `*.safetensors`.
        figures: output of `appocc eval bev --json` on test data.
        commands: commands that made data and weights.

    Raises:
        DataError: if the weights are missing or damaged, or `out` has another suffix or cannot be written.
    """
    if out.suffix != _SUFFIX:
        raise DataError(f"{out}: expected a name that ends in {_SUFFIX}")
    model, card = load_model(source)
    more = {"figures": json.dumps(figures, sort_keys=True), "commands": json.dumps(list(commands))}
    save_weights(out, model, {**card, **more}, half=True)


def describe_weights(path: Path) -> dict[str, Any]:
    """Return the model card of a weights file as JSON values.

    Raises:
        DataError: if the file is missing or damaged, or its model card is invalid.
    """
    model, card = load_model(path)
    values = {name: _value(text) for name, text in card.items()}
    try:
        _ModelCard.model_validate(values)
    except ValidationError as error:
        raise DataError(f"{path}: invalid model card ({first_problem(error)})") from error
    numbers = sum(parameter.numel() for parameter in model.parameters())
    own = {"file": str(path), "bytes": path.stat().st_size, "parameters": numbers}
    # These come first, and entries of the same names on the card are ignored.
    return {**own, **values, **own, "thresholds": list(read_thresholds(card))}


def _value(text: str) -> Any:
    """Return an entry of the card: JSON or plain text."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return text
