"""`appocc simulate`: generate annotated surround-view datasets."""

from __future__ import annotations

import os
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from cli.common import Interrupted, JsonOption, emit, out_path, progress, say
from cli.engine import LOCAL, ClusterOption, engine, shared


class Split(StrEnum):
    """Split of the built-in towns: six for training, two for tests."""

    train = "train"
    test = "test"
    all = "all"


def simulate(
    out: Annotated[Path, typer.Argument(parser=out_path, metavar="OUT", help="New folder for the dataset.")],
    scenes: Annotated[int, typer.Option(min=1, max=9999, help="Number of scenes.")] = 10,
    seconds: Annotated[float, typer.Option(min=0.1, max=600, help="Length of each scene.")] = 10.0,
    hz: Annotated[float, typer.Option(min=0.1, max=50, help="Samples per second.")] = 2.0,
    split: Annotated[Split, typer.Option(help="Built-in towns to use in turn.")] = Split.train,
    seed: Annotated[int, typer.Option(min=0, max=2**31 - 1, help="Random seed.")] = 0,
    workers: Annotated[int | None, typer.Option(min=1, max=1024, help="Processes (default: one per core).")] = None,
    cluster: ClusterOption = LOCAL,
    town: Annotated[
        list[str] | None,
        typer.Option(help="Built-in town, map file (.xodr, .net.xml) or random:SEED; can be repeated."),
    ] = None,
    rig: Annotated[str, typer.Option(help="Camera rig: paper, paper_full, fisheye or a YAML file.")] = "paper",
    weather: Annotated[
        list[str] | None, typer.Option(help="clear, overcast, low_sun, wet, dusk or night; can be repeated.")
    ] = None,
    lidar: Annotated[bool, typer.Option(help="Record LiDAR sweeps.")] = True,
    full_maps: Annotated[bool, typer.Option(help="Store depth and class of every pixel, not only per 8x8.")] = False,
    vary: Annotated[bool, typer.Option(help="Vary cameras, traffic, paints and look, for training sets.")] = False,
    sheet: Annotated[Path | None, typer.Option(parser=out_path, help="Also write a contact sheet (.png).")] = None,
    as_json: JsonOption = False,
) -> None:
    """Simulate drives through towns: six cameras, LiDAR, boxes and exact colour BEV maps, in the nuScenes schema.

    An interrupted run is resumed by the same command.

    Example: appocc simulate OUT --scenes 8 --seconds 10 --split all --sheet sheet.png
    """
    from appocc.temporary import check_locks

    check_locks()
    # Processes with several threads each are slower than with one; set before numpy is imported.
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    import time

    from appocc.environment import cores
    from appocc.errors import NotFoundError
    from appocc.nuscenes.assembly import count_finished_scenes, unfinished_folder
    from appocc.rigs import read_source_rig
    from appocc.simulation.generate import DatasetSettings
    from appocc.simulation.generate import simulate as run
    from appocc.simulation.recording import RecordingSettings
    from appocc.simulation.scenario import WEATHER_SHARES
    from appocc.simulation.sources import town_sources

    unknown = [name for name in weather or () if name not in WEATHER_SHARES]
    if unknown:
        raise NotFoundError(f"weather: expected {', '.join(WEATHER_SHARES)}, got '{unknown[0]}'")
    source = read_source_rig(rig)
    lenses = None if source.is_pinhole else source
    frames = max(1, round(seconds * hz))
    recording = RecordingSettings(frames, hz, source.rig, lidar, full_maps, vary, lenses)
    towns = town_sources(split.value, town or ())
    settings = DatasetSettings(scenes, towns, tuple(dict.fromkeys(weather or WEATHER_SHARES)), seed, recording)
    if sheet is not None:
        check_sheet(sheet, out)
    start = time.monotonic()
    try:
        count = min(workers or cores(), scenes)
        work = unfinished_folder(out)
        with engine(cluster, count, work) as pool, progress("simulation", scenes * recording.frames) as advance:
            summary = run(shared(cluster, out), settings, pool, advance, say)
    except Interrupted:
        if kept := count_finished_scenes(out):
            say(f"{kept} of {scenes} scenes are kept in {unfinished_folder(out)}")
        raise
    taken_s = time.monotonic() - start
    if sheet is not None:
        write_sheet(out, sheet)
    if as_json:
        counts = {"scenes": scenes, "frames": summary.frames, "made": summary.made}
        emit({"folder": str(out), **counts, "seconds": taken_s})
    rate = f"{summary.made} made, {summary.made / taken_s * 60:.0f} a minute" if summary.made else "all there already"
    say(f"{out}: {scenes} scenes, {summary.frames} frames ({rate})")


def check_sheet(path: Path, out: Path) -> None:
    """Check the path of the contact sheet before the simulation starts.

    Raises:
        DataError: if it is not a .png, equals the dataset's path, or cannot be a file.
    """
    from appocc.errors import DataError
    from appocc.files import RemotePath

    if path.suffix.lower() != ".png":
        raise DataError(f"{path}: expected a name that ends in .png")
    if isinstance(path, RemotePath):
        return
    folder = next(parent for parent in path.absolute().parents if parent.exists())
    if path.absolute() == out.absolute() or (path.exists() and not path.is_file()) or not folder.is_dir():
        raise DataError(f"{path}: expected a file name for the sheet, got a folder or a path below a file")
    if not os.access(folder, os.W_OK):
        raise DataError(f"{path}: cannot be written (no permission in {folder})")


def write_sheet(root: Path, path: Path) -> None:
    """Write the contact sheet of a dataset."""
    from appocc.files import write_image
    from appocc.nuscenes import Dataset
    from appocc.visualization.contact_sheet import contact_sheet

    write_image(path, contact_sheet(Dataset(root), "exact"))
    say(f"{path}: contact sheet")
