"""`appocc convert images`: pictures or videos of own cameras."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cli.common import JsonOption, emit, local_path, progress, say
from cli.convert.importing import OutArgument
from cli.engine import LOCAL, ClusterOption, engine, shared

if TYPE_CHECKING:
    from appocc.own_cameras.convert import Drive, Summary
    from appocc.own_cameras.pictures import Clock
    from appocc.rigs import SourceRig


def images(
    src: Annotated[
        Path,
        typer.Argument(
            metavar="SRC",
            parser=local_path,
            help="Folder with, for each camera of the rig, CAMERA/TIME.jpg, TIME/CAMERA.jpg, CAMERA_TIME.jpg or "
            "CAMERA.mp4; a folder of such folders, one a drive; or, with --mosaic, one video.",
        ),
    ],
    out: OutArgument,
    rig: Annotated[str, typer.Option("--rig", help="Name or YAML file of the camera rig.")],
    poses: Annotated[
        Path | None,
        typer.Option(
            parser=local_path,
            help="Ego poses: TUM, KITTI, CSV with a header, NMEA or GPX; of several drives, the name of the file in "
            "each one's folder. Default: see --speed.",
        ),
    ] = None,
    poses_of: Annotated[
        str | None, typer.Option(help="Camera whose poses they are. Default: the ego frame.", metavar="CAMERA")
    ] = None,
    speed: Annotated[
        float | None, typer.Option(help="Without poses: straight ahead at this speed, m/s. Default: standing.")
    ] = None,
    fps: Annotated[
        float | None,
        typer.Option(min=0.01, max=1000, help="Rate, for names that count frames, and videos of a known rate."),
    ] = None,
    start: Annotated[
        str | None,
        typer.Option(
            help="Time of frame 0 of these names and videos, in seconds or as a date and time (UTC). Default: 0."
        ),
    ] = None,
    hz: Annotated[float, typer.Option(min=0.05, max=100, help="Key frames per second.")] = 2.0,
    tolerance_ms: Annotated[
        float, typer.Option("--tolerance", min=0, max=1000, help="Most ms between the pictures of a key frame.")
    ] = 50.0,
    mosaic: Annotated[
        str | None,
        typer.Option(
            metavar="RxC", help="SRC is a video of all cameras in R rows and C columns, in the rig's order."
        ),
    ] = None,
    scene: Annotated[str | None, typer.Option(help="Name of the scene. Default: that of SRC.")] = None,
    workers: Annotated[int, typer.Option(min=1, max=1024, help="Drives converted at once, one process each.")] = 1,
    cluster: ClusterOption = LOCAL,
    as_json: JsonOption = False,
) -> None:
    """Convert pictures or videos of your own cameras, a scene for each drive. The same command resumes.

    Times are those in the file names (seconds, or ns, us or ms since 1970), in CAMERA.txt (one a line), of the
    videos, or from --fps.

    Example: appocc convert images DRIVE OUT --rig rig.yaml --poses poses.txt
    """
    from appocc.errors import DataError
    from appocc.nuscenes.assembly import unfinished_folder
    from appocc.own_cameras.convert import convert_drives
    from appocc.own_cameras.pictures import Clock, drive_folders
    from appocc.own_cameras.times import seconds_to_us
    from appocc.rigs import read_source_rig

    if poses is not None and speed is not None:
        raise DataError("expected either --poses or --speed, got both")
    if poses is None and poses_of is not None:
        raise DataError("--poses-of: expected --poses with it, got none")
    try:
        start_us = 0 if start is None else seconds_to_us(start)
    except ValueError as error:
        raise DataError(f"--start: {error}") from error
    src = shared(cluster, src)
    cameras = read_source_rig(rig)
    layout = None if mosaic is None else _layout(mosaic)
    folders = [src] if layout else drive_folders(src, cameras.names)
    if folders == [src]:
        named = {scene or src.resolve().stem: (src, poses)}
    elif scene is None:
        named = {folder.name: (folder, None if poses is None else folder / poses) for folder in folders}
    else:
        raise DataError(f"--scene: {src} has {len(folders)} drives, which are named by their folders; leave it out")
    clock = Clock(fps, start_us)
    drives = [_drive(name, at, cameras, clock, layout, path, poses_of) for name, (at, path) in named.items()]
    settings = {"src": str(src.resolve()), "fps": fps, "start": start, "mosaic": mosaic}
    with (
        engine(cluster, min(workers, len(drives)), unfinished_folder(out)) as pool,
        progress("converting", None) as bar,
    ):
        summaries = convert_drives(
            drives,
            cameras,
            shared(cluster, out),
            settings | {"poses": poses and str(poses), "poses_of": poses_of},
            speed_mps=speed or 0.0,
            hz=hz,
            tolerance_us=round(tolerance_ms * 1e3),
            advance=bar,
            pool=pool,
        )
    if poses is None:
        moving = f"straight ahead at {speed:g} m/s" if speed else "standing (--speed, --poses)"
        summaries[0].notes.append(f"no poses: the ego vehicle is taken for {moving}")
    if as_json:
        several = {"scenes": [summary.as_json() for summary in summaries]}
        emit((summaries[0].as_json() if folders == [src] else several) | {"folder": str(out)})
    for summary in summaries:
        _say_summary(out, summary)


def _drive(
    name: str,
    folder: Path,
    rig: SourceRig,
    clock: Clock,
    layout: tuple[int, int] | None,
    poses: Path | None,
    poses_of: str | None,
) -> Drive:
    """Find the pictures of a drive and read its poses.

    Raises:
        DataError: if a camera has no pictures, or the poses are damaged.
    """
    from appocc.files import plain_name
    from appocc.own_cameras.convert import Drive, ego_trajectory
    from appocc.own_cameras.pictures import find_streams

    streams = find_streams(folder, rig.names, clock, layout)
    trajectory = None if poses is None else ego_trajectory(poses, streams, rig, poses_of)
    return Drive(plain_name(folder, name), streams, trajectory)


def _layout(text: str) -> tuple[int, int]:
    """Return the rows and columns of `--mosaic`.

    Raises:
        DataError: if it is not two numbers with an x between them.
    """
    from appocc.errors import DataError

    found = re.fullmatch(r"([1-9]\d?)x([1-9]\d?)", text)
    if found is None:
        raise DataError(f"--mosaic: expected ROWSxCOLUMNS, such as 2x3, got '{text}'")
    return int(found[1]), int(found[2])


def _say_summary(out: Path, summary: Summary) -> None:
    for camera, (count, reason) in summary.missing.items():
        say(f"{camera}: missing in {count} of {summary.samples} key frames ({reason})")
    for reason, count in summary.left_out.items():
        say(f"left out: {count} key frames ({reason})")
    for note in summary.notes:
        say(note)
    say(f"{out}: {summary.samples} key frames, {summary.images} images of scene {summary.scene}")
