"""`appocc eval tracks`: score the tracks of any tracker."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cli.common import JsonOption, VersionOption, emit, in_path, say, wide_console

if TYPE_CHECKING:
    from tracking.evaluation.evaluate import EvaluationReport


def tracks(
    truth: Annotated[
        Path,
        typer.Option(
            "--gt",
            parser=in_path,
            help="Ground truth: a file in the format of the tracks, a folder of them, or a dataset root.",
        ),
    ],
    found: Annotated[
        Path,
        typer.Option(
            "--tracks",
            parser=in_path,
            help="nuScenes tracking JSON, MOTChallenge or KITTI text, or a folder of them, which is pooled.",
        ),
    ],
    range_m: Annotated[
        float | None,
        typer.Option(
            "--range", min=0.1, help="Maximum distance from the ego in metres; in a dataset, 40 or 50 by class."
        ),
    ] = None,
    gate_m: Annotated[
        float | None,
        typer.Option("--gate", min=0.01, help="Metres below which two centres match; by default 2."),
    ] = None,
    kind: Annotated[
        str | None, typer.Option(help="Only this category, such as car; 'vehicle': all vehicles but bicycles.")
    ] = None,
    min_score: Annotated[
        float | None, typer.Option(help="Only rows of tracks with at least this score, in the unit of the file.")
    ] = None,
    version: VersionOption = None,
    as_json: JsonOption = False,
) -> None:
    """Score a file of tracks: CLEAR, identity, HOTA and, for nuScenes files with scores, AMOTA.

    Example: appocc eval tracks --gt ROOT --tracks tracking.json --kind car
    """
    from tracking.evaluation.evaluate import EvaluationOptions, evaluate_files

    report = evaluate_files(truth, found, EvaluationOptions(kind, range_m, gate_m, min_score), version)
    if as_json:
        emit(report.as_json())
    _show(report)


_IN_A_ROW = 7  # as many scores as fit a terminal of 80 columns


def _show(report: EvaluationReport) -> None:
    """Print the scores as tables on stderr."""
    from rich.table import Table

    p, m = report.protocol, report.metrics
    gate = "IoU of 0.5 or more" if "gate_iou" in p else f"centres nearer than {p['gate_m']:g} m"
    within = _range_text(p.get("range_m"))
    say(f"{p['format']}, {p['kind'] or 'all kinds'}: {p['frames']} frames, {m.GT} objects in them; {gate}{within}")
    if p["samples_without_truth"]:
        say(f"{p['samples_without_truth']} samples of the tracks have no truth and are left out")
    cells = {
        name: _digits(100 * getattr(m, name), 2) for name in ("MOTA", "IDF1", "IDP", "IDR", "HOTA", "DetA", "AssA")
    }
    cells |= {"MOTP": _digits(m.MOTP, 3)} | {name: str(getattr(m, name)) for name in ("IDS", "FRAG", "MT", "ML")}
    if report.amota is not None:
        cells |= {
            "AMOTA": _digits(100 * report.amota.AMOTA, 2),
            "AMOTP": _digits(report.amota.AMOTP, 3),
        }
    names = list(cells)
    for part in (names[:_IN_A_ROW], names[_IN_A_ROW:]):
        table = Table()
        for name in part:
            table.add_column(name, justify="right")
        table.add_row(*(cells[name] for name in part))
        wide_console(80).print(table)
    best = report.amota.best if report.amota is not None else None
    if report.amota is not None and best is not None:
        counts = ", ".join(f"{name} {_digits(getattr(best, name), 0)}" for name in ("IDS", "FRAG", "FP", "FN"))
        at = _digits(report.amota.threshold, 4)
        say(f"by nuScenes' rules, with scores from {at}, where MOTA is best: MOTA {100 * best.MOTA:.2f}, {counts}")


def _range_text(range_m: float | dict[str, float] | None) -> str:
    """Describe the range of the evaluation."""
    if range_m is None:
        return ""
    return ", within 40 or 50 m by class" if isinstance(range_m, dict) else f", within {range_m:g} m"


def _digits(value: float, digits: int) -> str:
    """Format a number; a dash for NaN."""
    return f"{value:.{digits}f}" if value == value else "-"
