"""From the outcomes of rows to the paper's tables: means and spreads over seeds, and what appearance changes."""

from __future__ import annotations

import statistics
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from appocc.ablation.published import APPEARANCE_L1, DIFFERENCES, TABLES
from appocc.ablation.rows import BOTH, COLOUR, OCCUPANCY
from appocc.ablation.study import Outcome
from appocc.bevmap import CLASSES
from appocc.training.config import Config

IOUS = ("iou", "iou_at_threshold")
Figures = dict[str, Any]
# Of a row's evaluation, what the file of all rows repeats; the rest stays in the row's own folder.
_KEPT = (*IOUS, "thresholds", "appearance_l1", "appearance_l1_by_class", "appearance_known", "vehicles")


def study_json(base: Config, test: Mapping[str, Any], outcomes: Sequence[Outcome]) -> Figures:
    """Everything for machines, shares 0..1; nothing that a clock says, so the same rows give the same bytes."""
    config = base.model_dump(mode="json")
    own = {"network", "setting", "appearance"}
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


def iou_table(outcomes: Sequence[Outcome], setting: str) -> list[Figures]:
    """Tables I and II: IoU of each network that answers occupancy, done rows only."""
    return [
        {**about, **{key: _by_class(done, key) for key in IOUS}}
        for about, done in _groups(outcomes, setting)
        if about["answers"] != COLOUR
    ]


def appearance_table(outcomes: Sequence[Outcome], setting: str) -> list[Figures]:
    """Colour errors of each network that answers colours, done rows only."""
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


def differences(outcomes: Sequence[Outcome], setting: str) -> list[Figures]:
    """Table III: IoU with appearance minus IoU of occupancy alone, seed by seed."""
    found = []
    done = {each.row: each for each in outcomes if each.state == "done" and each.row.setting == setting}
    for network in dict.fromkeys(row.network for row in done):
        pairs = [
            (row.seed, each, done[alone])
            for row, each in done.items()
            if row.network == network and row.answers == BOTH
            for alone in [row._replace(answers=OCCUPANCY)]
            if alone in done
        ]
        if pairs:
            seeds = [seed for seed, _, _ in pairs]
            figures = {key: _differences([(a, b) for _, a, b in pairs], key) for key in IOUS}
            found.append({"network": network, "seeds": seeds, **figures})
    return found


def spread(values: Iterable[float | None]) -> Figures:
    """Mean, and sample standard deviation of two or more (else null), of what there is; the values themselves."""
    kept = list(values)
    there = [value for value in kept if value is not None]
    return {
        "mean": statistics.fmean(there) if there else None,
        "deviation": statistics.stdev(there) if len(there) > 1 else None,
        "values": kept,
    }


def _groups(outcomes: Sequence[Outcome], setting: str) -> list[tuple[Figures, list[Outcome]]]:
    """Done rows that differ in their seed alone, and what they have in common."""
    groups: dict[tuple[str, str], list[Outcome]] = {}
    for each in outcomes:
        if each.state == "done" and each.row.setting == setting:
            groups.setdefault((each.row.network, each.row.answers), []).append(each)
    return [
        ({"network": network, "answers": answers, "seeds": [each.row.seed for each in done]}, done)
        for (network, answers), done in groups.items()
    ]


def _by_class(done: Sequence[Outcome], key: str) -> Figures | None:
    """Spread of a figure of each class; None where the evaluation has none."""
    parts = [each.result["evaluation"][key] for each in done]
    return None if None in parts else {name: spread(part[name] for part in parts) for name in CLASSES}


def _differences(pairs: Sequence[tuple[Outcome, Outcome]], key: str) -> Figures | None:
    both, alone = ([each.result["evaluation"][key] for each in side] for side in zip(*pairs, strict=True))
    if None in both or None in alone:
        return None
    return {name: spread(_minus(a[name], b[name]) for a, b in zip(both, alone, strict=True)) for name in CLASSES}


def _minus(a: float | None, b: float | None) -> float | None:
    return None if a is None or b is None else a - b


def _row(outcome: Outcome) -> Figures:
    """A row for machines."""
    row, result = outcome.row, outcome.result
    told = {"name": row.name, **row._asdict(), "state": outcome.state}
    told |= {key: result[key] for key in ("steps", "best_step", "reason") if key in result}
    if outcome.state == "done":
        told |= {key: result["evaluation"][key] for key in _KEPT}
    return told
