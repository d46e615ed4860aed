"""Charts of a report as SVG."""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from appocc.bevmap import CLASSES

COLOURS = {"road": "#6b6f76", "vehicle": "#2f6fdb", "lane": "#d9930d"}
_STYLE: Any = {"svg.fonttype": "none", "svg.hashsalt": "appocc", "font.family": "sans-serif", "font.size": 9}


def range_chart(answer: Mapping[str, Any]) -> str:
    """Return an SVG of IoU and of the share of detected vehicles by distance from the ego."""

    def draw(cells: Any, vehicles: Any) -> None:
        rings = answer["by_range"]
        key = "iou" if answer["thresholds"] is None else "iou_at_threshold"
        for name in CLASSES:
            values = [_percent(part[key][name]) for part in rings.values()]
            cells.plot(list(rings), values, marker="o", color=COLOURS[name], label=name)
        cells.set(title="IoU by distance", ylabel="IoU, %", ylim=(0, 100))
        shares = [_percent(part["vehicles"]["detected_share"]) for part in rings.values()]
        vehicles.bar(list(rings), shares, color=COLOURS["vehicle"], width=0.6)
        vehicles.set(title="vehicles detected, by distance", ylabel="share, %", ylim=(0, 100))
        cells.legend(frameon=False)

    return _svg(2, draw)


def calibration_chart(calibration: Mapping[str, Any]) -> str:
    """Return an SVG of the observed share of cells by predicted probability, with the diagonal of a perfect map."""

    def draw(axes: Any) -> None:
        axes.plot([0, 100], [0, 100], color="#bbbbbb", linestyle="--", linewidth=1)
        for name in CLASSES:
            rows = [row for row in calibration[name]["table"] if row["cells"]]
            middle = [50 * (row["from"] + row["to"]) for row in rows]
            observed = [_percent(row["observed_share"]) for row in rows]
            axes.plot(middle, observed, marker="o", color=COLOURS[name], label=name)
        axes.set(title="calibration", xlabel="predicted, %", ylabel="observed, %", xlim=(0, 100), ylim=(0, 100))
        axes.legend(frameon=False)

    return _svg(1, draw)


def frame_chart(scenes: Mapping[str, Sequence[float]]) -> str:
    """Return an SVG of the mean IoU of each key frame, a line per scene."""

    def draw(axes: Any) -> None:
        for name, values in scenes.items():
            axes.plot(range(len(values)), [_percent(value) for value in values], marker=".", label=name)
        axes.set(title="mean IoU of each key frame", xlabel="key frame", ylabel="IoU, %", ylim=(0, 100))
        if len(scenes) <= _MOST_NAMED:
            axes.legend(frameon=False)

    return _svg(1, draw)


_MOST_NAMED = 8


def training_chart(lines: Sequence[Mapping[str, Any]]) -> str:
    """Return an SVG of the losses and the validation IoU of a training run, from the lines of `metrics.jsonl`."""

    def draw(losses: Any, shares: Any) -> None:
        for kind, label, shade in (("train", "training", "#9db4cc"), ("val", "validation", "#c0392b")):
            own = [line for line in lines if line["kind"] == kind]
            known = [[v for v in line["losses"].values() if v is not None] for line in own]
            losses.plot([line["step"] for line in own], [sum(v) for v in known], color=shade, label=label)
        losses.set(title="sum of the losses", xlabel="step", ylim=(0, None))
        own = [line for line in lines if line["kind"] == "val"]
        for name in CLASSES:
            values = [_percent(line["best_iou"][name]) for line in own]
            shares.plot([line["step"] for line in own], values, marker=".", color=COLOURS[name], label=name)
        shares.set(title="validation IoU", xlabel="step", ylabel="IoU, %", ylim=(0, 100))
        losses.legend(frameon=False)
        shares.legend(frameon=False)

    return _svg(2, draw)


def _percent(share: float | None) -> float:
    """Return a share as percent; NaN leaves a gap."""
    return math.nan if share is None else 100 * share


def _svg(panels: int, draw: Callable[..., None]) -> str:
    """Draw panels side by side and return them as SVG text."""
    import matplotlib as mpl
    from matplotlib.figure import Figure  # pyplot would keep figures and look for a display

    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(4.6 * panels, 3.0), layout="constrained")
        axes = figure.subplots(1, panels, squeeze=False)[0]
        draw(*axes)
        for one in axes:
            one.grid(alpha=0.3)
            one.spines[["top", "right"]].set_visible(False)
        written = io.StringIO()
        figure.savefig(written, format="svg", metadata={"Date": None, "Creator": None}, transparent=True)
    return written.getvalue()
