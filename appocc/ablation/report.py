"""Report of an ablation study: the tables in Markdown."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

from appocc.ablation.paper_results import APPEARANCE_L1, DIFFERENCES, TABLES
from appocc.ablation.study import RowOutcome
from appocc.ablation.tables import IOUS, appearance_table, differences, iou_table
from appocc.bevmap import CLASSES
from appocc.training.config import Config

_OUTPUTS = {"occupancy": "occupancy", "both": "occupancy + appearance", "colour": "appearance"}
_THRESHOLD_NAMES = {"iou": "0.5", "iou_at_threshold": "val"}
_NONE = "-"
_NEAT = (
    "NEAT's published vehicle IoU is over 64 balanced points per class and not comparable with IoU over a grid; "
    "`neat` here is retrained and evaluated on every cell."
)


def render_report(base: Config, test: Mapping[str, Any], outcomes: Sequence[RowOutcome]) -> str:
    """Return the report in Markdown; IoU in percent."""
    done = sum(each.state == "done" for each in outcomes)
    parts = [
        "# Ablation study",
        _introduction(base, test, f"{done} of {len(outcomes)} rows are done."),
        *_iou_part("Table I: IoU, 360 degrees (6 cameras, 80 x 80 m)", "360", outcomes),
        *_iou_part("Table II: IoU, 180 degrees (3 front cameras, 40 x 80 m ahead)", "180", outcomes),
        *_difference_part(outcomes),
        *_appearance_part(outcomes),
        *_row_part(outcomes),
    ]
    return "\n\n".join(parts) + "\n"


def _introduction(base: Config, test: Mapping[str, Any], done: str) -> str:
    train, samples = base.train, base.train.batch * base.train.accumulate
    budget = f"{train.steps} steps" if train.steps else f"{train.minutes:g} minutes of steps"
    data = base.data
    val = f"`{data.val}`" if data.val is not None else f"the last {data.held_out} samples of each of its scenes"
    views = " Networks with auxiliary image heads (`appocc`, `paper`) also learn from depth and pixel classes."
    roots = ", ".join(data.train_roots)
    trained = (
        f"All networks were trained with the same budget: {budget} of {samples} sample{'s' * (samples > 1)}, from "
        f"scratch, on `{roots}`, learning rate {train.lr:g}, the same losses. The weights are the best of the "
        f"run on {val}.{views if base.losses.depth or base.losses.kind else ''}"
    )
    evaluated = (
        f"All rows were evaluated on the same {test['samples']} frames of {test['scenes']} scenes of "
        f"`{test['root']}`, against `{test['against']}`. {done}"
    )
    how = (
        "IoU in percent, at threshold 0.5 and (*val*) at the thresholds chosen on validation data; ± is the standard "
        "deviation over seeds. Rows in *italics* are the paper's, on other data and with a much larger budget: "
        "compare differences between rows, not absolute values."
    )
    return "\n\n".join(_filled(text) for text in (trained, evaluated, how))


def _iou_part(title: str, setting: str, outcomes: Sequence[RowOutcome]) -> list[str]:
    heads = ["network", "outputs", "seeds", *CLASSES, *(f"{name}, val" for name in CLASSES)]
    rows = [
        [f"*published: {each.name}*", "", "", *(_italic(_percent(value)) for value in each.iou), *[""] * len(CLASSES)]
        for each in TABLES[setting]
    ]
    for each in iou_table(outcomes, setting):
        figures = [_spread(each[key][name] if each[key] else None, 100) for key in IOUS for name in CLASSES]
        rows.append([f"`{each['network']}`", _OUTPUTS[each["answers"]], str(len(each["seeds"])), *figures])
    neat = [_filled(_NEAT)] if setting == "180" else []
    return [f"## {title}", _table(heads, rows), *neat]


def _difference_part(outcomes: Sequence[RowOutcome]) -> list[str]:
    rows = []
    for setting, published in DIFFERENCES.items():
        figures = [_italic(f"{100 * value:+.2f}") for value in published]
        rows.append([setting, "*published*", "", "", *figures])
        for each in differences(outcomes, setting):
            for key, at in _THRESHOLD_NAMES.items():
                figures = [_signed(each[key][name] if each[key] else None) for name in CLASSES]
                rows.append([setting, f"`{each['network']}`", at, str(len(each["seeds"])), *figures])
    return [
        "## Table III: effect of appearance on occupancy",
        _filled(
            "IoU with appearance minus IoU of occupancy alone, in percentage points; in brackets for each seed. A "
            "difference from one seed, or whose sign differs between seeds, is not significant."
        ),
        _table(["setting", "network", "threshold", "seeds", *CLASSES], rows),
    ]


def _appearance_part(outcomes: Sequence[RowOutcome]) -> list[str]:
    rows = []
    for setting, published in APPEARANCE_L1.items():
        rows.append([setting, "*published*", "", _italic(f"{published:g}"), "", "", "", "", ""])
        for each in appearance_table(outcomes, setting):
            classes = [_spread(each["appearance_l1_by_class"][name], 1) for name in CLASSES]
            rows.append(
                [
                    *(
                        setting,
                        f"`{each['network']}`",
                        str(len(each["seeds"])),
                        _spread(each["appearance_l1"], 1),
                        *classes,
                    ),
                    *(_spread(each["ciede2000_median"], 1), _spread(each["appearance_known"], 100)),
                ]
            )
    heads = ["setting", "network", "seeds", "L1", *CLASSES, "vehicles' CIEDE2000", "cells with a colour, %"]
    return [
        "## Appearance",
        _filled(
            "L1 0..255: over all cells of known colour in truth and map, and over the true cells of each class. "
            "CIEDE2000: median over vehicles, detected or not, of the difference of mean colours. The paper does not "
            "specify the cells of its L1. `ipm` is not learnt: it has colours of visible cells, and no occupancy."
        ),
        _table(heads, rows),
    ]


def _row_part(outcomes: Sequence[RowOutcome]) -> list[str]:
    rows = []
    for each in outcomes:
        steps, seconds = each.result.get("steps"), each.result.get("seconds")
        minutes = f"{seconds / 60:.1f}" if seconds is not None else ""
        state = f"{each.state}: {each.result['reason']}" if each.state == "failed" else each.state
        best = each.result.get("best_step", "")
        rows.append([f"`{each.row.name}`", state, "" if steps is None else str(steps), str(best), minutes])
    missing = [f"`{each.row.name}`" for each in outcomes if each.state != "done"]
    summary = f"Without a result: {', '.join(missing)}." if missing else "All rows have a result."
    return ["## Rows", _filled(summary), _table(["row", "state", "steps", "best at step", "minutes of steps"], rows)]


def _filled(text: str) -> str:
    return textwrap.fill(text, 118, break_long_words=False, break_on_hyphens=False)


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join(f"| {' | '.join(cell.replace('|', '/') for cell in line)} |" for line in lines)


def _spread(figure: Mapping[str, Any] | None, times: float) -> str:
    if figure is None or figure["mean"] is None:
        return _NONE
    deviation = f" ± {times * figure['deviation']:.1f}" if figure["deviation"] is not None else ""
    return f"{times * figure['mean']:.1f}{deviation}"


def _signed(figure: Mapping[str, Any] | None) -> str:
    if figure is None or figure["mean"] is None:
        return _NONE
    each = ", ".join(_NONE if value is None else f"{100 * value:+.2f}" for value in figure["values"])
    return f"{100 * figure['mean']:+.2f} ({each})" if len(figure["values"]) > 1 else f"{100 * figure['mean']:+.2f}"


def _percent(value: float | None) -> str:
    return _NONE if value is None else f"{100 * value:.2f}"


def _italic(text: str) -> str:
    return f"*{text}*"
