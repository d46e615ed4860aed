"""Training curves: losses of training and validation over steps, and validation IoU (the paper's loss figure)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from appocc.bevmap import CLASSES
from appocc.files import whole_file

_TRAIN, _VAL = "#9db4cc", "#c0392b"
_CLASS_COLOURS = {"road": "#555555", "vehicle": "#1f77b4", "lane": "#e08e0b"}


def plot_curves(lines: Sequence[dict[str, Any]], path: Path) -> None:
    """Plot the lines of `metrics.jsonl` to a PNG file.

    Raises:
        DataError: if it cannot be written.
    """
    # pyplot would keep figures in memory and look for a display.
    from matplotlib.figure import Figure

    train = [line for line in lines if line["kind"] == "train"]
    val = [line for line in lines if line["kind"] == "val"]
    figure = Figure(figsize=(12, 3.6), dpi=110, layout="constrained")
    occupancy, colour, iou = figure.subplots(1, 3)
    for axes, title, names in ((occupancy, "occupancy loss", CLASSES), (colour, "colour loss (L1)", ("colour",))):
        for label, part, shade in (("training", train, _TRAIN), ("validation", val, _VAL)):
            own = [line for line in part if all(line["losses"].get(name) is not None for name in names)]
            totals = [sum(line["losses"][name] for name in names) for line in own]
            axes.plot([line["step"] for line in own], totals, color=shade, label=label, marker=_marker(own))
        axes.set(title=title, xlabel="step")
    for name in CLASSES:
        own = [line for line in val if line["best_iou"][name] is not None]
        steps, values = [line["step"] for line in own], [100 * line["best_iou"][name] for line in own]
        iou.plot(steps, values, color=_CLASS_COLOURS[name], label=name, marker=_marker(own))
    iou.set(title="validation IoU, percent", xlabel="step; IoU at the best threshold", ylim=(0, 100))
    for axes in (occupancy, colour, iou):
        axes.set_xlim(left=0)
        axes.grid(alpha=0.3)
        axes.legend(frameon=False)
    for axes in (occupancy, colour):
        axes.set_ylim(bottom=0)
    with whole_file(path) as temporary:
        figure.savefig(temporary, format="png", metadata={"Software": None})


def _marker(points: Sequence[Any]) -> str:
    """Mark few points: a line through a single point is invisible."""
    return "o" if len(points) < 20 else ""
