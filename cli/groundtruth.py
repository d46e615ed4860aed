"""`appocc groundtruth`: ground-truth BEV maps from recorded sensors and boxes."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from cli.common import (
    JsonOption,
    RootArgument,
    VersionOption,
    emit,
    out_path,
    progress,
    say,
    say_empty,
    say_stale,
)
from cli.engine import LOCAL, ClusterOption, ProcessesOption, engine, shared

# Layers of a map, by their names in its meta.
_LAYERS = {
    "road": "road",
    "vehicle": "vehicle",
    "lane": "lane",
    "appearance_static": "colour of the ground",
    "appearance_vehicle": "paint",
}


class VehicleColour(StrEnum):
    """How the colour of a vehicle is estimated."""

    mode = "mode"
    robust = "robust"


def groundtruth(
    root: RootArgument,
    out: Annotated[
        Path | None,
        typer.Option(parser=out_path, help="Folder for bev/groundtruth; default: ROOT."),
    ] = None,
    scene: Annotated[str | None, typer.Option(help="Only this scene.")] = None,
    paint: Annotated[
        VehicleColour, typer.Option(help="Vehicle colour: robust (bodywork only) or the paper's histogram mode.")
    ] = VehicleColour.robust,
    workers: ProcessesOption = None,
    cluster: ClusterOption = LOCAL,
    version: VersionOption = None,
    as_json: JsonOption = False,
) -> None:
    """Make a BEV map of every sample from LiDAR, images, boxes and road maps; resumable.

    Example: appocc groundtruth ROOT --out OUT
    """
    import time

    from appocc.bevmap import load_map
    from appocc.environment import cores
    from appocc.grid import BEVGrid
    from appocc.groundtruth.compose import GroundTruthSettings
    from appocc.groundtruth.pipeline import SOURCE, generate
    from appocc.nuscenes import Dataset

    root, out = shared(cluster, root), shared(cluster, out or root)
    dataset = Dataset(root, version)
    scenes = [dataset.scene(scene)] if scene else list(dataset.scenes)
    total = sum(len(dataset.samples(one)) for one in scenes)
    start = time.monotonic()
    with engine(cluster, workers or cores(), out) as pool, progress("ground truth", total) as advance:
        settings = GroundTruthSettings(BEVGrid.surround(), paint.value)
        summary = generate(dataset, scenes, out, settings, pool, advance)
    seconds = time.monotonic() - start
    say_empty(dataset, scenes)
    if as_json:
        counts = {"made": summary.made, "kept": summary.kept, "stale": summary.stale}
        emit({**counts, "folder": str(summary.folder), "seconds": seconds})
    say_stale(summary.stale)
    rate = f", {summary.made / seconds * 60:.0f} a minute" if summary.made else ""
    say(f"{summary.folder}: {summary.made} maps made{rate}, {summary.kept} kept")
    if total:
        first = next(sample for one in scenes for sample in dataset.samples(one))
        sources = load_map(out, SOURCE, first.token).meta["sources"]
        if unknown := [_LAYERS[layer] for layer, source in sources.items() if source == "none"]:
            say(f"unknown for want of a LiDAR, a road map or boxes: {', '.join(unknown)}")
