"""Tables of an ablation study: mean and deviation over seeds, and the effect of appearance on occupancy."""

from __future__ import annotations

import statistics
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from appocc.ablation.paper_results import APPEARANCE_L1, DIFFERENCES, TABLES
from appocc.ablation.rows import BOTH, COLOUR, OCCUPANCY
from appocc.ablation.study import RowOutcome
from appocc.bevmap import CLASSES
from appocc.training.config import Config

IOUS = ("iou", "iou_at_threshold")
Figures = dict[str, Any]
# Keys of a row's evaluation that the results repeat; `result.json` of the row has all of them.
_REPEATED = (*IOUS, "thresholds", "appearance_l1", "appearance_l1_by_class", "appearance_known", "vehicles")


def study_json(base: Config, test: Mapping[str, Any], outcomes: Sequence[RowOutcome]) -> Figures:
    """Return the results of all rows, shares 0..1; without times, so that the same rows give the same bytes."""
    config = base.model_dump(mode="json")
    own = {"network", "parts", "setting", "appearance"}
    settings = list(TABLES)
    return {
        "training": {name: value for name, value in config.items() if name not in own},
        "test": dict(test),
        "iou": {setting: iou_table(outcomes, setting) for setting in settings},
        "differences": {setting: differences(outcomes, setting) for setting in settings},
        "appearance": {setting: appearance_table(outcomes, setting) for setting in settings},
        "published": {
            setting: {
                "iou": {each.name: dict(zip(CLASSES, each.iou, strict=True)) for each in TABLES[setting]},
                "differences": dict(zip(CLASSES, DIFFERENCES[setting], strict=True)),
                "appearance_l1": APPEARANCE_L1[setting],
            }
            for setting in settings
        },
        "rows": [_row(outcome) for outcome in outcomes],
    }


def iou_table(outcomes: Sequence[RowOutcome], setting: str) -> list[Figures]:
    """Return table I or II: IoU of each network that predicts occupancy, finished rows only."""
    return [
        {**about, **{key: _by_class(done, key) for key in IOUS}}
        for about, done in _groups(outcomes, setting)
        if about["answers"] != COLOUR
    ]


def appearance_table(outcomes: Sequence[RowOutcome], setting: str) -> list[Figures]:
    """Return the colour errors of each network that predicts appearance, finished rows only."""
    return [
        {
            **about,
            "appearance_l1": spread(each.result["evaluation"]["appearance_l1"] for each in done),
            "appearance_l1_by_class": _by_class(done, "appearance_l1_by_class"),
            "appearance_known": spread(each.result["evaluation"]["appearance_known"] for each in done),
            "ciede2000_median": spread(each.result["evaluation"]["vehicles"]["ciede2000_median"] for each in done),
        }
        for about, done in _groups(outcomes, setting)
        if about["answers"] != OCCUPANCY
    ]


def differences(outcomes: Sequence[RowOutcome], setting: str) -> list[Figures]:
    """Return table III: IoU with appearance minus IoU of occupancy alone, seed by seed."""
    found = []
    done = {each.row: each for each in outcomes if each.state == "done" and each.row.setting == setting}
    for network in dict.fromkeys(row.label for row in done):
        pairs = [
            (row.seed, each, done[alone])
            for row, each in done.items()
            if row.label == network and row.outputs == BOTH
            for alone in [row._replace(outputs=OCCUPANCY)]
            if alone in done
        ]
        if pairs:
            seeds = [seed for seed, _, _ in pairs]
            figures = {key: _differences([(a, b) for _, a, b in pairs], key) for key in IOUS}
            found.append({"network": network, "seeds": seeds, **figures})
    return found


def spread(values: Iterable[float | None]) -> Figures:
    """Return mean and sample standard deviation (None for fewer than two) of the known values, and all values."""
    kept = list(values)
    known = [value for value in kept if value is not None]
    return {
        "mean": statistics.fmean(known) if known else None,
        "deviation": statistics.stdev(known) if len(known) > 1 else None,
        "values": kept,
    }


def _groups(outcomes: Sequence[RowOutcome], setting: str) -> list[tuple[Figures, list[RowOutcome]]]:
    """Group finished rows that differ in the seed only; return their common values and the rows."""
    groups: dict[tuple[str, str], list[RowOutcome]] = {}
    for each in outcomes:
        if each.state == "done" and each.row.setting == setting:
            groups.setdefault((each.row.label, each.row.outputs), []).append(each)
    return [
        ({"network": network, "answers": answers, "seeds": [each.row.seed for each in done]}, done)
        for (network, answers), done in groups.items()
    ]


def _by_class(done: Sequence[RowOutcome], key: str) -> Figures | None:
    """Return mean and deviation of a metric of each class; None if an evaluation lacks it."""
    parts = [each.result["evaluation"][key] for each in done]
    return None if None in parts else {name: spread(part[name] for part in parts) for name in CLASSES}


def _differences(pairs: Sequence[tuple[RowOutcome, RowOutcome]], key: str) -> Figures | None:
    both, alone = ([each.result["evaluation"][key] for each in side] for side in zip(*pairs, strict=True))
    if None in both or None in alone:
        return None
    return {name: spread(_minus(a[name], b[name]) for a, b in zip(both, alone, strict=True)) for name in CLASSES}


def _minus(a: float | None, b: float | None) -> float | None:
    return None if a is None or b is None else a - b


def _row(outcome: RowOutcome) -> Figures:
    """Return the state and main metrics of a row."""
    row, result = outcome.row, outcome.result
    values: Figures = {"name": row.name, "network": row.label, "setting": row.setting, "answers": row.outputs}
    values |= {"seed": row.seed, "state": outcome.state}
    values |= {key: result[key] for key in ("steps", "best_step", "reason") if key in result}
    if outcome.state == "done":
        values |= {key: result["evaluation"][key] for key in _REPEATED}
    return values
