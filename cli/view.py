"""`appocc view`: a scene as a recording for a viewer."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from appocc.errors import DataError
from cli.common import (
    JsonOption,
    RootArgument,
    SceneOption,
    VersionOption,
    choose_scene,
    choose_source,
    emit,
    out_path,
    progress,
    say,
)

if TYPE_CHECKING:
    from appocc.nuscenes import Dataset, Scene
    from appocc.viewer.timeline import ShownGoal
    from tracking.pipeline import SceneTracks


def view(
    root: RootArgument,
    rrd: Annotated[
        Path | None,
        typer.Option("--rrd", parser=out_path, help="Write a Rerun recording (.rrd); needs the extra `viewer`."),
    ] = None,
    mcap: Annotated[
        Path | None,
        typer.Option(
            "--mcap",
            parser=out_path,
            help="Write an MCAP file (.mcap) with Foxglove's schemas; needs the extra `mcap`.",
        ),
    ] = None,
    scene: SceneOption = None,
    bev: Annotated[
        str | None,
        typer.Option(
            "--bev",
            metavar="SOURCE",
            help="Source of the maps; default: the only one, else groundtruth; none: no maps.",
        ),
    ] = None,
    command: Annotated[
        str | None, typer.Option("--command", help="Also show the goal of a command, as in `appocc ground`.")
    ] = None,
    frame: Annotated[int, typer.Option("--frame", help="Key frame of the command, from 0.")] = 0,
    version: VersionOption = None,
    as_json: JsonOption = False,
) -> None:
    """Write a scene as a timeline for a viewer: cameras, boxes, the map on the ground, tracks, the goal of a command.

    Open the file with `rerun FILE.rrd` (Rerun), or with Foxglove. The tracks are those of `appocc track`, if it was
    run on the same maps, else they are made. A command is grounded on them too; on true maps without such a file, on
    the annotated boxes.

    Exit 0: written; 2 or 3: as `appocc ground`, if the command has no goal.

    Example: appocc view DATA --scene 002 --bev groundtruth --rrd scene.rrd
    """
    from appocc.bevmap import map_sources
    from appocc.extras import import_extra
    from appocc.nuscenes import Dataset
    from appocc.viewer.mcap_file import FOXGLOVE, write_mcap
    from appocc.viewer.rerun_file import RERUN, write_rerun
    from appocc.viewer.timeline import Timeline
    from tracking.visualization.shown import shown_tracks

    wanted = ((rrd, write_rerun, RERUN), (mcap, write_mcap, FOXGLOVE))
    writers = [(path, write, package) for path, write, package in wanted if path is not None]
    if not writers:
        raise DataError("expected --rrd FILE, --mcap FILE or both, got none")
    _check_endings(rrd, mcap)
    for _, _, package in writers:
        import_extra(*package)
    dataset = Dataset(root, version)
    chosen = choose_scene(dataset, scene)
    samples = dataset.samples(chosen)
    if not samples:
        raise DataError(f"{root}: scene '{chosen.name}' has no key frames")
    source = choose_source(root, bev) if bev is not None or command is not None or map_sources(root) else None
    tracked, origin = _tracks(dataset, chosen, source)
    goal = _goal(dataset, chosen, tracked, origin, command, frame)
    tracks = None if tracked is None else shown_tracks(tracked)
    for path, write, _ in writers:
        with progress(path.name, len(samples)) as advance:
            write(Timeline(dataset, chosen, source, tracks, goal, advance), path)
    files = [str(path) for path, *_ in writers]
    if as_json:
        emit({"scene": chosen.name, "frames": len(samples), "bev": source, "tracks": origin, "files": files})
    maps = "no maps" if source is None else f"maps of {source}; tracks: {origin}"
    say(f"scene {chosen.name}: {len(samples)} key frames, {maps}")
    for path, *_ in writers:
        say(f"  {path}" + (f"; open it with: rerun {path}" if path == rrd else ""))


def _check_endings(rrd: Path | None, mcap: Path | None) -> None:
    """Check the names of the files: viewers go by them.

    Raises:
        DataError: if one has another ending.
    """
    for path, ending in ((rrd, ".rrd"), (mcap, ".mcap")):
        if path is not None and path.suffix != ending:
            raise DataError(f"{path}: expected a name that ends in {ending}")


def _tracks(dataset: Dataset, scene: Scene, source: str | None) -> tuple[SceneTracks | None, str | None]:
    """Return the tracks to show and where they are from; None without maps."""
    if source is None:
        return None, None
    from cli.view_scene import scene_tracks

    with progress("tracking", len(dataset.samples(scene))) as advance:
        return scene_tracks(dataset, scene, source, advance)


def _goal(
    dataset: Dataset,
    scene: Scene,
    tracked: SceneTracks | None,
    origin: str | None,
    command: str | None,
    frame: int,
) -> ShownGoal | None:
    """Return the goal to show; None without a command.

    Raises:
        typer.Exit: with the exit code of `appocc ground`, if the command has no goal.
    """
    if command is None or tracked is None or origin is None:
        return None
    from cli.view_scene import command_goal

    answer, goal = command_goal(dataset, scene, tracked, origin, command, frame)
    say(answer.text())
    if goal is None:
        raise typer.Exit(answer.exit_code or 3)
    return goal
