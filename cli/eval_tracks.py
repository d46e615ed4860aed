"""`appocc eval tracks`: how good anybody's tracks are."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cli.common import JsonOption, VersionOption, emit, say

if TYPE_CHECKING:
    from tracking.evaluation.evaluate import EvaluationReport


def tracks(
    truth: Annotated[
        Path, typer.Option("--gt", help="The truth: a file in the format of the tracks, or a dataset's root.")
    ],
    found: Annotated[
        Path, typer.Option("--tracks", help="nuScenes tracking JSON, MOTChallenge text or KITTI tracking text.")
    ],
    range_m: Annotated[
        float | None,
        typer.Option(
            "--range", min=0.1, help="Only within so many metres of the ego; in a dataset 40 or 50 by class."
        ),
    ] = None,
    gate_m: Annotated[
        float | None, typer.Option("--gate", min=0.01, help="Metres between centres that still match; 2 by default.")
    ] = None,
    kind: Annotated[
        str | None, typer.Option(help="Only this category, such as car; 'vehicle': all vehicles but bicycles.")
    ] = None,
    version: VersionOption = None,
    as_json: JsonOption = False,
) -> None:
    """Score a tracker's file: CLEAR, identity, HOTA and, of nuScenes files with scores, AMOTA.

    Example: appocc eval tracks --gt ROOT --tracks tracking.json --kind car
    """
    from tracking.evaluation.evaluate import EvaluationOptions, evaluate_files

    answer = evaluate_files(truth, found, EvaluationOptions(kind, range_m, gate_m), version)
    if as_json:
        emit(answer.as_json())
    _show(answer)


def _show(answer: EvaluationReport) -> None:
    """The scores as tables on stderr."""
    from rich.console import Console
    from rich.table import Table

    p, m = answer.protocol, answer.metrics
    gate = "IoU of 0.5 or more" if "gate_iou" in p else f"centres nearer than {p['gate_m']:g} m"
    within = _reach(p.get("range_m"))
    say(f"{p['format']}, {p['kind'] or 'all kinds'}: {p['frames']} frames, {m.GT} objects in them; {gate}{within}")
    if p["samples_without_truth"]:
        say(f"{p['samples_without_truth']} samples of the tracks have no truth and are left out")
    table = Table()
    cells = {
        name: _known(100 * getattr(m, name), 2) for name in ("MOTA", "IDF1", "IDP", "IDR", "HOTA", "DetA", "AssA")
    }
    cells |= {"MOTP": _known(m.MOTP, 3)} | {name: str(getattr(m, name)) for name in ("IDS", "FRAG", "MT", "ML")}
    if answer.amota is not None:
        cells |= {"AMOTA": _known(100 * answer.amota.AMOTA, 2), "AMOTP": _known(answer.amota.AMOTP, 3)}
    for name in cells:
        table.add_column(name, justify="right")
    table.add_row(*cells.values())
    console = Console(stderr=True)
    console.width = max(console.width, 120)  # in a narrow window lines break, but no number is left out
    console.print(table)
    best = answer.amota.best if answer.amota is not None else None
    if answer.amota is not None and best is not None:
        counts = ", ".join(f"{name} {_known(getattr(best, name), 0)}" for name in ("IDS", "FRAG", "FP", "FN"))
        at = _known(answer.amota.threshold, 4)
        say(f"by nuScenes' rules, with scores from {at}, where MOTA is best: MOTA {100 * best.MOTA:.2f}, {counts}")


def _reach(range_m: float | dict[str, float] | None) -> str:
    """How far objects are looked for."""
    if range_m is None:
        return ""
    return ", within 40 or 50 m by class" if isinstance(range_m, dict) else f", within {range_m:g} m"


def _known(value: float, digits: int) -> str:
    """A number, or a dash where there was nothing to be measured."""
    return f"{value:.{digits}f}" if value == value else "-"
