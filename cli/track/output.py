"""What the sub-commands of `appocc track` print."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from cli.common import say, wide_console

if TYPE_CHECKING:
    from tracking.evaluation.clear_id_hota import Metrics


def say_files(paths: Iterable[Path]) -> None:
    """Print the paths of written files."""
    for path in paths:
        say(f"  {path}")


def say_below(scores: Sequence[float], min_score: float) -> None:
    """Print how many tracks are not written, given the highest score of each, which is below the minimum."""
    if scores:
        say(f"{len(scores)} more stay below --min-score {min_score:g}; their highest score is {max(scores):.4f}")


def show_metrics(title: str, scores: Mapping[str, Metrics]) -> None:
    """Print named scores as a table on stderr."""
    from rich.table import Table

    table = Table(title, "MOTA %", "IDF1 %", "HOTA %", "MOTP m", "IDS", "FRAG", "FP", "FN", "GT")
    for name, m in scores.items():
        shares = [_format_number(100 * share, 1) for share in (m.MOTA, m.IDF1, m.HOTA)]
        counts = [str(count) for count in (m.IDS, m.FRAG, m.FP, m.FN, m.GT)]
        table.add_row(name, *shares, _format_number(m.MOTP, 2), *counts)
    console = wide_console(80)
    console.print(table)


def _format_number(value: float, digits: int) -> str:
    """Format a number; a dash for NaN."""
    return f"{value:.{digits}f}" if value == value else "-"
