"""`appocc pack`: a dataset and its maps in formats that other programs read."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from cli.common import (
    JsonOption,
    RootArgument,
    SourceOption,
    VersionOption,
    choose_source,
    emit,
    local_out_path,
    progress,
    say,
    say_empty,
)
from cli.engine import LOCAL, ClusterOption, ProcessesOption, engine, shared, shared_source


class PackFormat(StrEnum):
    """Format of the files."""

    webdataset = "webdataset"
    coco_panoptic = "coco-panoptic"


def pack(
    root: RootArgument,
    format_: Annotated[
        PackFormat,
        typer.Option(
            "--format", help="webdataset: tar shards of pictures, rig, map, objects; coco-panoptic: the maps."
        ),
    ],
    out: Annotated[Path, typer.Option("--out", parser=local_out_path, help="New folder.")],
    bev: SourceOption = None,
    scene: Annotated[list[str] | None, typer.Option(help="Only this scene; may be repeated. Default: all.")] = None,
    shard_mb: Annotated[
        float, typer.Option(min=0.001, help="Pictures and maps in a shard of webdataset, megabytes.")
    ] = 1000,
    workers: ProcessesOption = None,
    cluster: ClusterOption = LOCAL,
    version: VersionOption = None,
    as_json: JsonOption = False,
) -> None:
    """Write key frames and maps as WebDataset shards, or maps as COCO panoptic segmentation; resumable.

    Example: appocc pack ROOT --format webdataset --bev groundtruth --out SHARDS
    """
    from appocc.environment import cores
    from appocc.nuscenes import Dataset
    from appocc.nuscenes.assembly import resolved
    from appocc.packing.coco_panoptic import pack_panoptic
    from appocc.packing.frames import PackSource
    from appocc.packing.webdataset_shards import pack_webdataset

    root, out = shared(cluster, root), shared(cluster, resolved(out))
    dataset = Dataset(root, version)
    scenes = [dataset.scene(name) for name in scene] if scene else list(dataset.scenes)
    source = PackSource(dataset, scenes, shared_source(cluster, choose_source(root, bev)))
    key_frames = source.key_frames()
    total = len(key_frames)
    with engine(cluster, workers or cores(), out.parent) as pool, progress("packing", total) as advance:
        if format_ is PackFormat.webdataset:
            written = pack_webdataset(source, key_frames, out, round(shard_mb * 1e6), pool, advance)
        else:
            written = [pack_panoptic(source, key_frames, out, pool, advance)]
    say_empty(dataset, scenes)
    if as_json:
        emit({"folder": str(out), "samples": total, "files": [path.name for path in written]})
    say(f"{out}: {total} key frames in {', '.join(path.name for path in written[:3])}{' ...' if written[3:] else ''}")
