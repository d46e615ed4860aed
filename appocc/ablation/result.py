"""Reading of `result.json` of a row; the fields used by the tables are validated."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pydantic import ValidationError

from appocc.errors import DataError
from appocc.files import read_json
from appocc.jsonparts import JsonPart, first_problem

_Number = float | None


class _ByClass(JsonPart):
    road: _Number
    vehicle: _Number
    lane: _Number


class _Vehicles(JsonPart):
    ciede2000_median: _Number


class _Evaluation(JsonPart):
    iou: _ByClass
    iou_at_threshold: _ByClass | None
    thresholds: dict[str, float] | None
    appearance_l1: _Number
    appearance_l1_by_class: _ByClass | None
    appearance_known: _Number
    vehicles: _Vehicles


class _Done(JsonPart):
    evaluation: _Evaluation
    steps: int | None = None
    seconds: _Number = None
    best_step: int | None = None


def read_result(path: Path, key: str) -> dict[str, Any] | None:
    """Read the result of a row; return None if it belongs to other weights or another test set.

    Raises:
        DataError: if the file is damaged.
    """
    result = read_json(path)
    if not isinstance(result, dict) or result.get("key") != key:
        return None
    if "reason" not in result:
        try:
            _Done.model_validate(result)
        except ValidationError as error:
            raise DataError(f"{path}: damaged ({first_problem(error)}); remove it and run again") from error
    return result
