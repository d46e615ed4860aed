"""The HTML page of a report."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from appocc.bevmap import BEVMap
from appocc.files import read_text, write_bytes
from appocc.version import __version__
from cli.report.charts import COLOURS, calibration_chart, frame_chart, range_chart, training_chart
from cli.report.content import ReportContent
from cli.report.pictures import frame_pictures, svg_uri, worst_pictures

PICTURES, WORST = 3, 3
_TEMPLATE = "page.html.j2"
_GROUPS = {
    "by_range": "by distance",
    "by_sight": "by sight",
    "by_weather": "by weather",
}
_TRACK_COLUMNS = ("MOTA", "IDF1", "HOTA", "MOTP", "IDS", "FRAG", "FP", "FN", "GT")
_TRACK_SHARES = ("MOTA", "IDF1", "HOTA")
_TRACK_ROWS = {"metrics": "all", "metrics_moving": "moving", "metrics_parked": "parked"}


def write_report(
    content: ReportContent,
    path: Path,
    training: Sequence[Mapping[str, Any]] = (),
    advance: Callable[[float], None] = lambda _: None,
) -> None:
    """Write a report as one HTML file without outside parts.

    Args:
        content: contents of the report.
        path: the file.
        training: lines of `metrics.jsonl` of the training run; empty for none.
        advance: progress callback, up to `PICTURES` + `WORST` steps.

    Raises:
        DataError: if an image or a map is missing or damaged, or the file cannot be written.
    """
    pictures = frame_pictures(content, PICTURES)
    advance(PICTURES)
    worst = worst_pictures(content, WORST)
    advance(WORST)
    answer = None if content.evaluation is None else content.evaluation.as_json()
    text = _template().render(
        title=f"{content.source} maps of {content.dataset.root.resolve().name}",
        made=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        version=__version__,
        content=content,
        facts=_facts(content),
        answer=answer,
        colours=COLOURS,
        groups=_GROUPS,
        charts=_charts(content, answer, training),
        pictures=pictures,
        worst=worst,
        tracks=_track_rows(content),
        untracked=[(one.scene, one.reason) for one in content.tracks if one.metrics is None],
        track_columns=_TRACK_COLUMNS,
    )
    write_bytes(path, text.encode())


def _template() -> Any:
    """Return the template; every value that it inserts is escaped."""
    from jinja2 import Environment, StrictUndefined

    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters.update(percent=_percent, number=_number, interval=_interval)
    return environment.from_string(read_text(Path(__file__).with_name(_TEMPLATE)))


def _percent(share: float | None, digits: int = 1) -> str:
    """Format a share as percent; a dash for unknown."""
    return "–" if share is None or share != share else f"{100 * share:.{digits}f}"


def _number(value: float | None, digits: int = 1) -> str:
    """Format a number; a dash for unknown."""
    return "–" if value is None or value != value else f"{value:.{digits}f}"


def _interval(bounds: Sequence[float] | None, times: float = 1.0) -> str:
    """Format an interval; nothing if there is none, as for a single scene."""
    return "" if bounds is None else f"{bounds[0] * times:.1f} – {bounds[1] * times:.1f}"


def _facts(content: ReportContent) -> list[tuple[str, str]]:
    """Return what was evaluated, as pairs of a name and a value."""
    dataset, samples = content.dataset, content.samples
    seconds = sum(_duration_s(content, scene) for scene in content.scenes)
    names = ", ".join(scene.name for scene in content.scenes[:8]) + (" …" if len(content.scenes) > 8 else "")
    places = sorted({dataset.location(scene) for scene in content.scenes} - {""})
    grid = content.first.grid
    extent = f"x {grid.x_min_m:g} to {grid.x_max_m:g} m, y {grid.y_min_m:g} to {grid.y_max_m:g} m"
    facts = [
        ("Dataset", f"{dataset.root.resolve().name}, version {dataset.tables.version}"),
        ("Scenes", f"{len(content.scenes)} ({names})"),
        ("Key frames", f"{len(samples)} over {seconds:.0f} s"),
        ("Places", ", ".join(places) or "not recorded"),
        ("Maps", f"{content.source}: {_origin(content.first)}"),
        ("True maps", _truth_text(content)),
        ("Grid", f"{extent}, cells of {grid.cell_m:g} m"),
    ]
    weights = content.first.meta.get("weights")
    if isinstance(weights, Mapping):
        facts.append(("Weights", f"{weights.get('name', 'unnamed')}, SHA-256 {weights.get('sha256', 'unknown')}"))
    cameras = content.first.meta.get("cameras")
    if isinstance(cameras, Sequence) and not isinstance(cameras, str):
        facts.append(("Cameras", ", ".join(map(str, cameras))))
    if content.first.thresholds is not None:
        kept = ", ".join(f"{name} {value:.2f}" for name, value in content.first.thresholds.items())
        facts.append(("Decision thresholds", f"{kept} (of the first map)"))
    return facts


def _duration_s(content: ReportContent, scene: Any) -> float:
    times = [sample.timestamp_us for sample in content.dataset.samples(scene)]
    return (times[-1] - times[0]) * 1e-6


def _origin(bev: BEVMap) -> str:
    """Return how a map was made, from its meta."""
    if bev.meta.get("source") == "simulated":
        return "exact maps of the simulator"
    sources = bev.meta.get("sources")
    if isinstance(sources, Mapping):
        return "composed from " + "; ".join(f"{part}: {source}" for part, source in sources.items())
    return "predicted from camera images" if bev.thresholds is not None else "unknown origin"


def _truth_text(content: ReportContent) -> str:
    if content.first_truth is None:
        return "none: no errors can be measured"
    return f"{content.against}: {_origin(content.first_truth)}"


def _charts(
    content: ReportContent, answer: Mapping[str, Any] | None, training: Sequence[Mapping[str, Any]]
) -> dict[str, str]:
    """Return the charts by name as data URIs."""
    charts = {}
    if answer is not None and content.evaluation is not None:
        charts["range"] = range_chart(answer)
        charts["frames"] = frame_chart({s.name: [f.mean_iou for f in s.frames] for s in content.evaluation.scenes})
        if answer["calibration"] is not None:
            charts["calibration"] = calibration_chart(answer["calibration"])
    if training:
        charts["training"] = training_chart(training)
    return {name: svg_uri(svg) for name, svg in charts.items()}


def _track_rows(content: ReportContent) -> list[tuple[str, str, list[str]]]:
    """Return scene, group of vehicles and figures for the table of tracks."""
    rows = []
    for scored in content.tracks:
        for key, name in _TRACK_ROWS.items() if scored.metrics is not None else ():
            own = scored.metrics[key] if scored.metrics else {}
            figures = [
                _percent(own.get(c)) if c in _TRACK_SHARES else _number(own.get(c), 2 if c == "MOTP" else 0)
                for c in _TRACK_COLUMNS
            ]
            rows.append((scored.scene, name, figures))
    return rows
