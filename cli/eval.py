"""`appocc eval`: evaluation of maps (`bev`), detections, tracks and parsed commands (`parses`)."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated, Any

import typer

from cli.common import JsonOption, RootArgument, VersionOption, emit, progress, say, wide_console
from cli.engine import LOCAL, ClusterOption, ProcessesOption, engine, processes, shared, shared_source
from cli.eval_detections import detections
from cli.eval_parses import parses
from cli.eval_tracks import tracks

app = typer.Typer(name="eval", help="Evaluate results against the truth.", no_args_is_help=True)


class TruthSource(StrEnum):
    """The truth to compare with."""

    exact = "exact"
    groundtruth = "groundtruth"


class GridSetting(StrEnum):
    """The paper's two settings: the full surround grid, or its front half."""

    all_around = "360"
    ahead = "180"


@app.command()
def bev(
    root: RootArgument,
    source: Annotated[
        str, typer.Option("--bev", help="Source of the maps: ROOT/bev/SOURCE, or a folder with a slash in its name.")
    ],
    against: Annotated[
        TruthSource | None, typer.Option(help="The truth; default: exact if ROOT has it, else groundtruth.")
    ] = None,
    setting: Annotated[GridSetting, typer.Option(help="360: all cells; 180: cells ahead.")] = GridSetting.all_around,
    range_m: Annotated[
        float | None,
        typer.Option("--range", min=0.1, help="Only cells within this distance of the ego, in metres."),
    ] = None,
    scene: Annotated[str | None, typer.Option(help="Only this scene.")] = None,
    workers: ProcessesOption = None,
    cluster: ClusterOption = LOCAL,
    version: VersionOption = None,
    as_json: JsonOption = False,
) -> None:
    """Evaluate BEV maps: IoU by class, colour errors and vehicles; by distance, visibility and weather.

    Example: appocc eval bev ROOT --bev groundtruth --against exact
    """
    from appocc.bevmap import bev_folder
    from appocc.evaluation.bev import EvaluationConfig, evaluate
    from appocc.nuscenes import Dataset

    root = shared(cluster, root)
    dataset = Dataset(root, version)
    scenes = [dataset.scene(scene)] if scene else list(dataset.scenes)
    if against is None:
        against = TruthSource.exact if bev_folder(root, "exact").is_dir() else TruthSource.groundtruth
    question = EvaluationConfig(shared_source(cluster, source), against.value, setting is GridSetting.ahead, range_m)
    total = sum(len(dataset.samples(one)) for one in scenes)
    with (
        engine(cluster, processes(workers, total), root, writes=False) as pool,
        progress("comparing", total) as advance,
    ):
        answer = evaluate(dataset, scenes, question, advance, pool).as_json() | {"source": source}
    if as_json:
        emit(answer)
    _show(answer)


app.command()(detections)
app.command()(tracks)
app.command()(parses)


def _show(answer: dict[str, Any]) -> None:
    """Print the figures as tables to stderr."""
    within = f", within {answer['range_m']:g} m" if answer["range_m"] else ""
    counted = f"{answer['samples']} samples of {answer['scenes']} scenes"
    say(f"{answer['source']} against {answer['against']}, setting {answer['setting']}{within}: {counted}")
    console = wide_console(150)
    console.print(_cell_table(answer))
    console.print(_vehicle_table(answer))
    if answer["calibration"] is not None:
        console.print(_calibration_table(answer["calibration"]))


def _cell_table(answer: dict[str, Any]) -> Any:
    from rich.table import Table

    kept, ranges = answer["thresholds"], answer["confidence"]
    table = Table("cells")
    heads = [f"IoU {name}" for name in ("road", "vehicle", "lane")]
    heads += [f"{name} at {value:.2f}" for name, value in kept.items()] if kept else []
    for head in (*heads, "L1", "L1 road", "L1 vehicle", "L1 lane", "PSNR"):
        table.add_column(head, justify="right")

    def row(name: str, part: dict[str, Any]) -> None:
        shares = [_number(100 * v) for key in ("iou", "iou_at_threshold") for v in (part[key] or {}).values()]
        colours = (part["appearance_l1"], *part["appearance_l1_by_class"].values(), part["appearance_psnr"])
        table.add_row(name, *shares, *map(_number, colours))

    row("all", answer)
    bounds = [*ranges["iou"].values(), *ranges.get("iou_at_threshold", {}).values()]
    colour = [ranges["appearance_l1"], *ranges["appearance_l1_by_class"].values()]
    table.add_row("95 % of draws", *(_range(b, 100) for b in bounds), *(_range(b, 1) for b in colour))
    for group in ("by_range", "by_sight", "by_weather"):
        for name, part in (answer[group] or {}).items():
            row(name, part)
    return table


def _vehicle_table(answer: dict[str, Any]) -> Any:
    from rich.table import Table

    table = Table("vehicles")
    for head in ("count", "detected %", "cells found %", "L1", "CIEDE2000", "of detected"):
        table.add_column(head, justify="right")

    def row(name: str, part: dict[str, Any]) -> None:
        shares = [_number(100 * part[key]) for key in ("detected_share", "cells_found")]
        errors = ("appearance_l1", "ciede2000_median", "ciede2000_median_detected")
        table.add_row(name, str(part["count"]), *shares, *(_number(part[key]) for key in errors))

    row("all", answer["vehicles"])
    ranges = [answer["confidence"][key] for key in ("ciede2000_median", "ciede2000_median_detected")]
    table.add_row("95 % of draws", "", "", "", "", *(_range(bounds, 1) for bounds in ranges))
    for group in ("by_range", "by_weather"):
        for name, part in answer[group].items():
            row(name, part["vehicles"])
    for name, part in answer["by_visibility"].items():
        row(f"visibility {name}", part)
    return table


def _calibration_table(classes: dict[str, Any]) -> Any:
    """Return the observed share of each class by predicted probability, with the share of the cells in brackets."""
    from rich.table import Table

    table = Table("probability %", title="observed %, in brackets % of the valid cells", title_justify="left")
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


def _number(value: float) -> str:
    """Format a number; a dash stands for NaN, nothing measured."""
    return f"{value:.1f}" if value == value else "-"


def _range(bounds: tuple[float, float] | None, times: float) -> str:
    return f"{bounds[0] * times:.1f}..{bounds[1] * times:.1f}" if bounds else "-"
