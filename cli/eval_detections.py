"""`appocc eval detections`: evaluate detected objects by nuScenes' detection metric."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from cli.common import JsonOption, RootArgument, VersionOption, emit, in_path, progress, say, wide_console
from cli.engine import LOCAL, ClusterOption, ProcessesOption, engine, processes, shared, shared_source


def detections(
    root: RootArgument,
    file: Annotated[
        Path | None, typer.Option("--detections", parser=in_path, help="nuScenes detection results.")
    ] = None,
    source: Annotated[
        str | None, typer.Option("--bev", help="Source of maps with objects, instead of --detections.")
    ] = None,
    range_m: Annotated[
        float | None,
        typer.Option("--range", min=0.1, help="Upper limit of the ranges of 40 and 50 m by class, in metres."),
    ] = None,
    scene: Annotated[str | None, typer.Option(help="Only this scene.")] = None,
    workers: ProcessesOption = None,
    cluster: ClusterOption = LOCAL,
    version: VersionOption = None,
    as_json: JsonOption = False,
) -> None:
    """Evaluate detected objects: nuScenes' mAP, errors and NDS; vehicles' F1, headings and paints.

    Paints are compared with the true maps: exact if ROOT has them, else groundtruth.

    Example: appocc eval detections ROOT --detections results.json
    """
    from appocc.errors import DataError
    from appocc.evaluation.detections.evaluate import (
        DetectionEvaluationConfig,
        evaluate_detections,
        true_map_source,
    )
    from appocc.nuscenes import Dataset

    if (file is None) == (source is None):
        raise DataError(f"expected either --detections or --bev, got {'neither' if file is None else 'both'}")
    root = shared(cluster, root)
    dataset = Dataset(root, version)
    scenes = [dataset.scene(scene)] if scene else list(dataset.scenes)
    name = file or str(source)
    read = file or shared_source(cluster, str(source))
    config = DetectionEvaluationConfig(read, true_map_source(root), range_m)
    total = sum(len(dataset.samples(one)) for one in scenes)
    with (
        engine(cluster, processes(workers, total), root, writes=False) as pool,
        progress("comparing", total) as advance,
    ):
        answer = evaluate_detections(dataset, scenes, config, advance, pool).as_json() | {"source": str(name)}
    if as_json:
        emit(answer)
    _show(answer)


# The true-positive errors of nuScenes and their units.
_ERRORS = {"ATE": "m", "ASE": "1 - IoU", "AOE": "rad", "AVE": "m/s", "AAE": "share"}


def _show(answer: dict[str, Any]) -> None:
    """Print the figures as tables to stderr."""
    within = f", within {answer['range_m']:g} m" if answer["range_m"] else ""
    say(f"{answer['source']}: {answer['samples']} samples of {answer['scenes']} scenes{within}")
    console = wide_console(80)
    console.print(_precision_table(answer))
    console.print(_error_table(answer))
    console.print(_vehicle_table(answer["vehicles"]))
    say(f"NDS {_number(100 * answer['NDS'])}; vehicles: scores from {_number(answer['vehicles']['score'], 3)}")


def _precision_table(answer: dict[str, Any]) -> Any:
    from rich.table import Table

    table = Table("class")
    gates = next((list(one["AP_at_m"]) for one in answer["by_class"].values()), list[str]())
    for head in ("count", "AP %", *(f"at {gate} m" for gate in gates)):
        table.add_column(head, justify="right")
    for kind, one in answer["by_class"].items():
        shares = [_number(100 * value) for value in (one["AP"], *one["AP_at_m"].values())]
        table.add_row(kind, str(one["count"]), *shares)
    table.add_row("mean", "", _number(100 * answer["mAP"]), *[""] * len(gates))
    return table


def _error_table(answer: dict[str, Any]) -> Any:
    from rich.table import Table

    table = Table("class")
    for name, unit in _ERRORS.items():
        table.add_column(f"{name}\n{unit}", justify="right")
    for kind, one in answer["by_class"].items():
        table.add_row(kind, *(_number(one[name], 2) for name in _ERRORS))
    table.add_row("mean", *(_number(answer[f"m{name}"], 2) for name in _ERRORS))
    return table


_COUNTS = {"true": "vehicles", "found": "found", "false": "false"}
_SHARES = {
    "precision %": "precision",
    "recall %": "recall",
    "F1 %": "F1",
    "heading within 20 degrees %": "heading_within_20_deg",
    "paint of the right word %": "colour_word_right",
}


def _vehicle_table(vehicles: dict[str, Any]) -> Any:
    from rich.table import Table

    ranges = {name: one for name, one in vehicles.items() if name != "score"}
    table = Table("vehicles")
    for name in ranges:
        table.add_column(name.replace("_", " "), justify="right")
    for title, key in _COUNTS.items():
        table.add_row(title, *(str(one[key]) for one in ranges.values()))
    for title, key in _SHARES.items():
        table.add_row(title, *(_number(100 * one[key]) for one in ranges.values()))
    table.add_row("paint, median CIEDE2000", *(_number(one["ciede2000_median"]) for one in ranges.values()))
    return table


def _number(value: float, digits: int = 1) -> str:
    """Format a number; a dash stands for NaN, nothing measured."""
    return f"{value:.{digits}f}" if value == value else "-"
