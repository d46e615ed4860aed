"""`appocc report`: an evaluation as one HTML file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from appocc.errors import DataError
from cli.common import (
    JsonOption,
    RootArgument,
    VersionOption,
    choose_source,
    emit,
    local_path,
    out_path,
    progress,
    say,
)


def report(
    root: RootArgument,
    out: Annotated[Path, typer.Option("--out", parser=out_path, help="The file (.html).")],
    bev: Annotated[
        str | None,
        typer.Option(
            "--bev", metavar="SOURCE", help="Source of the maps; default: the only predicted one, else the only one."
        ),
    ] = None,
    against: Annotated[
        str | None,
        typer.Option("--against", help="Source of the true maps; default: exact, else groundtruth, else none."),
    ] = None,
    scene: Annotated[str | None, typer.Option("--scene", help="Only this scene.")] = None,
    run: Annotated[
        Path | None, typer.Option("--run", parser=local_path, help="Folder of a training run, to show its curves.")
    ] = None,
    version: VersionOption = None,
    as_json: JsonOption = False,
) -> None:
    """Write a report of maps and tracks as one HTML file: pictures, tables with intervals, curves, worst frames.

    It needs no network to be read. Tracks are those of `appocc track scene`, if it was run on the same maps.

    Example: appocc report ROOT --bev predicted --out report.html
    """
    from appocc.bevmap import map_sources
    from appocc.nuscenes import Dataset
    from cli.report.content import TRUTHS, collect
    from cli.report.page import PICTURES, WORST, write_report

    if out.suffix not in (".html", ".htm"):
        raise DataError(f"{out}: expected a name that ends in .html")
    dataset = Dataset(root, version)
    predicted = [name for name in map_sources(root) if name not in TRUTHS]
    source = predicted[0] if bev is None and len(predicted) == 1 else choose_source(root, bev)
    training = [] if run is None else _read_training(run)
    chosen = None if scene is None else dataset.scene(scene)
    scenes = dataset.scenes if chosen is None else (chosen,)
    with progress("comparing", sum(len(dataset.samples(one)) for one in scenes)) as advance:
        content = collect(dataset, source, against, chosen, advance)
    with progress("pictures", PICTURES + WORST) as advance:
        write_report(content, out, training, advance)
    size = out.stat().st_size
    if as_json:
        counts = {"scenes": len(content.scenes), "samples": len(content.samples), "bytes": size}
        emit({"file": str(out), "bev": source, "against": content.against, **counts})
    truth = "no true maps" if content.against is None else f"against {content.against}"
    say(f"{out}: {source} maps of {len(content.samples)} key frames, {truth}; {size / 1e6:.1f} MB")


def _read_training(folder: Path) -> list[dict[str, object]]:
    """Return the lines of `metrics.jsonl` of a training run.

    Raises:
        DataError: if the folder has none.
    """
    from appocc.training.run_folder import RunFolder

    lines = RunFolder(folder).read_metrics() if (folder / "metrics.jsonl").is_file() else []
    if not lines or not all(_is_metrics(line) for line in lines):
        raise DataError(f"{folder}: expected the folder of a training run with metrics.jsonl, got none")
    return lines


def _is_metrics(line: object) -> bool:
    """Return whether a line has what the chart of a training shows."""
    if not isinstance(line, dict) or not isinstance(line.get("losses"), dict) or "step" not in line:
        return False
    return line.get("kind") == "train" or (line.get("kind") == "val" and isinstance(line.get("best_iou"), dict))
