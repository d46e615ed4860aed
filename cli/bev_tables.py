"""Tables of `appocc eval bev`, not wider than a terminal of 80 columns."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from cli.common import say, wide_console

if TYPE_CHECKING:
    from rich.table import Table

_INTERVAL = "95 % interval"


def show_evaluation(answer: dict[str, Any]) -> None:
    """Print the figures of an evaluation of maps (`Evaluation.as_json`, and its `source`) as tables to stderr."""
    within = f", within {answer['range_m']:g} m" if answer["range_m"] else ""
    counted = f"{answer['samples']} samples of {answer['scenes']} scenes"
    say(f"{answer['source']} against {answer['against']}, setting {answer['setting']}{within}: {counted}")
    console = wide_console(80)
    console.print(_class_table(answer))
    console.print(_colour_table(answer))
    console.print(_vehicle_table(answer))
    if answer["calibration"] is not None:
        console.print(_calibration_table(answer["calibration"]))


def _add_parts(
    table: Table, answer: dict[str, Any], row: Callable[[str, dict[str, Any]], None], intervals: Sequence[str]
) -> None:
    """Add a row of all cells, one of intervals, and one of each part: rings, seen and unseen cells, weathers."""
    row("all", answer)
    _add_intervals(table, intervals)
    for group in ("by_range", "by_sight", "by_weather"):
        for name, part in (answer[group] or {}).items():
            row(name, part)


def _class_table(answer: dict[str, Any]) -> Table:
    kept = answer["thresholds"]
    also = ", and at the thresholds of the maps (in the mean)" if kept else ""
    table = _table(f"IoU %, at probability 0.5{also}", "cells")
    for head in (*answer["iou"], *(f"{name}\nat {value:.2f}" for name, value in (kept or {}).items())):
        table.add_column(head, justify="right")

    def row(name: str, part: dict[str, Any]) -> None:
        table.add_row(
            name, *(_number(100 * v) for key in ("iou", "iou_at_threshold") for v in (part[key] or {}).values())
        )

    ranges = answer["confidence"]
    bounds = [*ranges["iou"].values(), *ranges.get("iou_at_threshold", {}).values()]
    _add_parts(table, answer, row, [_range(each, 100) for each in bounds])
    return table


def _colour_table(answer: dict[str, Any]) -> Table:
    table = _table("colour error (L1) of 255, PSNR in dB", "cells")
    for head in ("all", *answer["appearance_l1_by_class"], "PSNR"):
        table.add_column(head, justify="right")

    def row(name: str, part: dict[str, Any]) -> None:
        colours = (part["appearance_l1"], *part["appearance_l1_by_class"].values(), part["appearance_psnr"])
        table.add_row(name, *map(_number, colours))

    ranges = answer["confidence"]
    bounds = [ranges["appearance_l1"], *ranges["appearance_l1_by_class"].values()]
    _add_parts(table, answer, row, [_range(each, 1) for each in bounds])
    return table


def _vehicle_table(answer: dict[str, Any]) -> Table:
    table = _table("detected: half of the cells are found; mean L1 of 255, median CIEDE2000", "vehicles")
    for head in ("count", "detected\n%", "cells\nfound %", "L1", "CIEDE\n2000", "same, of\ndetected"):
        table.add_column(head, justify="right")

    def row(name: str, part: dict[str, Any]) -> None:
        shares = [_number(100 * part[key]) for key in ("detected_share", "cells_found")]
        errors = ("appearance_l1", "ciede2000_median", "ciede2000_median_detected")
        table.add_row(name, str(part["count"]), *shares, *(_number(part[key]) for key in errors))

    row("all", answer["vehicles"])
    ranges = [answer["confidence"][key] for key in ("ciede2000_median", "ciede2000_median_detected")]
    _add_intervals(table, ["", "", "", "", *(_range(bounds, 1) for bounds in ranges)])
    for group in ("by_range", "by_weather"):
        for name, part in answer[group].items():
            row(name, part["vehicles"])
    for name, part in answer["by_visibility"].items():
        row(f"visible {name.removeprefix('v')} %", part)
    return table


def _calibration_table(classes: dict[str, Any]) -> Table:
    """Return the observed share of each class by predicted probability, with the share of the cells in brackets."""
    table = _table("observed %, in brackets % of the valid cells", "probability %")
    for name in classes:
        table.add_column(name, justify="right")
    totals = [max(sum(row["cells"] for row in part["table"]), 1) for part in classes.values()]
    for rows in zip(*(part["table"] for part in classes.values()), strict=True):
        share = [
            f"{_number(100 * r['observed_share'])} ({100 * r['cells'] / n:4.1f})"
            for r, n in zip(rows, totals, strict=True)
        ]
        table.add_row(f"{100 * rows[0]['from']:.0f}-{100 * rows[0]['to']:.0f}", *share)
    table.add_section()
    table.add_row("calibration error", *(_number(100 * part["ece"]) for part in classes.values()))
    return table


def _table(title: str, first: str) -> Table:
    from rich.table import Table

    return Table(first, title=title, title_justify="left", title_style="")


def _add_intervals(table: Table, texts: Sequence[str]) -> None:
    """Add a row of confidence intervals, if there are any: a single scene has none."""
    if any(text.strip("-") for text in texts):
        table.add_row(_INTERVAL, *texts)


def _number(value: float) -> str:
    """Format a number; a dash stands for NaN, nothing measured."""
    return f"{value:.1f}" if value == value else "-"


def _range(bounds: tuple[float, float] | None, times: float) -> str:
    return "..".join(f"{bound * times:.0f}" for bound in bounds) if bounds else "-"
