"""`appocc infer`: camera images to predicted maps."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cli.common import (
    JsonOption,
    VersionOption,
    WeightsOption,
    emit,
    in_path,
    out_path,
    progress,
    say,
    say_empty,
    say_stale,
)
from cli.engine import LOCAL, ClusterOption

if TYPE_CHECKING:
    import torch

    from appocc.bevmap import BEVMap
    from appocc.inference.inputs import InferenceInput
    from appocc.inference.run import InferenceRun, InferenceSummary
    from appocc.visualization.vehicle_marks import VehicleMarks

SourceArgument = Annotated[
    Path,
    typer.Argument(
        parser=in_path,
        metavar="ROOT|IMAGES",
        help="Dataset root; or, with --rig, a folder of images named by camera, or of such folders, one per frame.",
    ),
]
RigOption = Annotated[str | None, typer.Option("--rig", help="Name or YAML file of the camera rig of IMAGES.")]


def infer(
    source: SourceArgument,
    out: Annotated[
        Path,
        typer.Option("--out", parser=out_path, help="Folder for the maps; ROOT/bev/NAME makes them the source NAME."),
    ],
    scene: Annotated[str | None, typer.Option("--scene", help="Only this scene of ROOT.")] = None,
    weights: WeightsOption = None,
    rig: RigOption = None,
    level: Annotated[
        bool,
        typer.Option(help="Level the cameras with the ground in the LiDAR sweeps of ROOT, where it has any."),
    ] = True,
    pictures: Annotated[bool, typer.Option(help="Also write a picture of each map.")] = True,
    device: Annotated[
        str | None, typer.Option("--device", help="cpu, cuda or cuda:N; default: the first GPU, else the CPU.")
    ] = None,
    detections: Annotated[
        Path | None,
        typer.Option(
            "--detections",
            parser=out_path,
            help="Also write the objects of all key frames as nuScenes detection results.",
        ),
    ] = None,
    workers: Annotated[int, typer.Option(min=1, max=1024, help="Scenes of ROOT at once, one process each.")] = 1,
    cluster: ClusterOption = LOCAL,
    version: VersionOption = None,
    as_json: JsonOption = False,
) -> None:
    """Predict BEV maps (occupancy and colour) from camera images, with a picture of each; resumable.

    A camera without a readable image is left out of the rig. A LiDAR, if there is one, only tells how the ground is
    tilted; the network sees images.

    Example: appocc infer ROOT --scene S --weights F --out ROOT/bev/mine
    """
    import time

    from appocc.bevmap import PICTURES
    from appocc.errors import DataError
    from appocc.inference.loading import load_predictor
    from appocc.inference.run import InferenceRun
    from cli.infer_scenes import SceneInference, execute_by_scene
    from tracking.pipeline.tracked_objects import TrackedObjects

    if out.resolve() == source.resolve():
        raise DataError(f"{out}: expected another folder than that of the images")
    predictor = load_predictor(weights, device_of(device))
    inputs = inputs_of(source, rig, scene, version, level)
    run = InferenceRun(inputs, predictor, out, detections, pictures, tracking=TrackedObjects())
    start = time.monotonic()
    if cluster == LOCAL and workers == 1:
        summary = execute(run)
    elif rig is None:
        job = SceneInference(source, version, level, weights, device, out, pictures)
        summary = execute_by_scene(run, job, list(dict.fromkeys(each.drive for each in inputs)), workers, cluster)
    else:
        raise DataError("expected --workers and --cluster with a dataset, got a folder of images (--rig)")
    seconds = time.monotonic() - start
    if as_json:
        dead = {channel: {"frames": times, "reason": why} for channel, (times, why) in summary.missing.items()}
        counts = {"made": summary.made, "kept": summary.kept, "seconds": seconds, "left_out": dead}
        files = {} if detections is None else {"detections": str(detections)}
        drawn = str(out / PICTURES) if pictures else None
        emit({"folder": str(out), "pictures": drawn, **files, **counts, "stale": summary.stale})
    say_stale(summary.stale)
    if summary.missing:
        cameras = (f"{channel} in {times} frames ({why})" for channel, (times, why) in summary.missing.items())
        say(f"left out: {'; '.join(cameras)}")
    rate = f", {summary.made / seconds * 60:.0f} a minute" if summary.made else ""
    shown = f"; pictures in {out / PICTURES}" if pictures else ""
    say(f"{out}: {summary.made} maps made{rate}, {summary.kept} kept{shown}")
    if detections is not None:
        say(f"{detections}: detections of {summary.made + summary.kept} key frames")


def device_of(name: str | None) -> torch.device | None:
    """Return a device by its name; None for the default one.

    Raises:
        DataError: if there is no such device.
    """
    if name is None:
        return None
    import torch

    from appocc.errors import DataError

    try:
        device = torch.device(name)
        torch.zeros(1, device=device)
    except (RuntimeError, AssertionError) as error:
        reason = str(error).splitlines()[0]
        why = f" ({reason})" if name.startswith("cuda") else ""  # else torch lists devices that it has not got
        raise DataError(f"--device: expected cpu, or a GPU that torch can use, got '{name}'{why}") from error
    return device


def inputs_of(
    source: Path, rig: str | None, scene: str | None, version: str | None, level: bool = True
) -> list[InferenceInput]:
    """Return the inference inputs of a dataset, or of a folder of images if a rig is named.

    Raises:
        DataError: if there are none.
        NotFoundError: if there is no such scene or rig.
    """
    from appocc.errors import DataError
    from appocc.inference.inputs import dataset_inputs, folder_inputs, holds_images
    from appocc.nuscenes import Dataset
    from appocc.rigs import read_source_rig

    if rig is not None:
        for option, value in (("--scene", scene), ("--version", version)):
            if value is not None:
                raise DataError(f"expected either {option} of a dataset or --rig of a folder of images, got both")
        return folder_inputs(source, read_source_rig(rig), say)
    try:
        dataset = Dataset(source, version)
    except DataError as error:
        if holds_images(source):
            raise DataError(f"{source}: images without the tables of a dataset; name their rig: --rig") from error
        raise
    scenes = [dataset.scene(scene)] if scene else dataset.scenes
    inputs = dataset_inputs(dataset, scenes, level)
    say_empty(dataset, scenes)
    return inputs


def execute(run: InferenceRun) -> InferenceSummary:
    """Execute a run with a progress bar; write a picture of each map, with the distances of its vehicles.

    Raises:
        DataError: as the run.
    """
    with progress("prediction", len(run)) as advance:
        write_maps(run, advance)
    return run.summary


def write_maps(run: InferenceRun, advance: Callable[[float], None]) -> None:
    """Execute a run and write a picture of each map; `advance` is called with 1 after each input."""
    from appocc.files import write_image
    from appocc.visualization.predictions import prediction_figure

    for result in run:
        if result is not None and result.picture is not None:
            write_image(result.picture, prediction_figure(result.frame, result.bev, vehicle_marks(result.bev)))
        advance(1)


def vehicle_marks(bev: BEVMap) -> VehicleMarks:
    """Return the vehicles of a map to draw: its objects, else its vehicle instances as tracking extracts them."""
    import numpy as np

    from appocc.visualization.vehicle_marks import VehicleMarks
    from tracking.instances.instances import find_instances

    if bev.detected_objects is not None:
        return VehicleMarks.of_objects(bev.detected_objects)
    found = find_instances(bev)
    size = np.stack([found.length_m, found.width_m], axis=1)
    return VehicleMarks(found.centroid_m, found.yaw_rad, size, np.zeros(len(found), np.bool_), found.rgb)
