"""`appocc track`: follow the vehicles of a scene through its colour bird's-eye views."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cli.common import JsonOption, RootArgument, VersionOption, emit, progress, say

if TYPE_CHECKING:
    from tracking.metrics import Metrics


def track(
    root: RootArgument,
    scene: Annotated[str, typer.Option("--scene", help="Name or token of the scene.")],
    bev: Annotated[
        str, typer.Option("--bev", help="Source of the maps: ROOT/bev/SOURCE, or a folder with a slash in its name.")
    ],
    out: Annotated[Path | None, typer.Option("--out", help="Folder to write; ROOT/tracks/SCENE by default.")] = None,
    video: Annotated[Path | None, typer.Option("--video", help="Also write a video of the tracks (.webm).")] = None,
    version: VersionOption = None,
    as_json: JsonOption = False,
) -> None:
    """Follow the vehicles of a scene; write tracks (nuScenes JSON, MOTChallenge text) and, with annotations, scores.

    Example: appocc track DATA --scene 002 --bev groundtruth --video tracks.webm
    """
    from appocc.files import plain_name
    from appocc.nuscenes import Dataset
    from tracking.run import score, track_scene, write_metrics, write_tracks
    from tracking.video import check_name, write_video

    if video is not None:
        check_name(video)
    dataset = Dataset(root, version)
    wanted = dataset.scene(scene)
    folder = out or root / "tracks" / plain_name(root, wanted.name)
    frames = len(dataset.samples(wanted))
    with progress("tracking", frames) as advance:
        result = track_scene(dataset, wanted, bev, advance=advance)
    scores = score(dataset, result)
    if video is not None:  # before the tracks are written: it reads every image, and may find a damaged one
        with progress("video", frames) as advance:
            write_video(dataset, result, video, advance)
    files = write_tracks(folder, result)
    if scores is not None:
        files.append(folder / "metrics.json")
        write_metrics(files[-1], result, scores)
    files += [video] if video is not None else []
    if as_json:
        names = ("metrics", "metrics_moving", "metrics_parked")
        emit(
            {
                "scene": result.scene,
                "bev": bev,
                "tracks": result.count,
                "files": [str(path) for path in files],
                **{name: scores[name].as_json() if scores else None for name in names},
            }
        )
    say(f"scene {result.scene}: {result.count} vehicles in {frames} key frames")
    _show(scores)
    for path in files:
        say(f"  {path}")


def _show(scores: dict[str, Metrics] | None) -> None:
    """The scores as a table on stderr."""
    from rich.console import Console
    from rich.table import Table

    if scores is None:
        say("no annotations: nothing to be scored against")
        return
    table = Table("vehicles", "MOTA %", "IDF1 %", "HOTA %", "MOTP m", "IDS", "FRAG", "FP", "FN", "GT")
    for name, m in scores.items():
        kind = {"metrics": "all", "metrics_moving": "moving", "metrics_parked": "parked"}[name]
        shares = [_known(100 * share, 1) for share in (m.MOTA, m.IDF1, m.HOTA)]
        counts = [str(count) for count in (m.IDS, m.FRAG, m.FP, m.FN, m.GT)]
        table.add_row(kind, *shares, _known(m.MOTP, 2), *counts)
    console = Console(stderr=True)
    console.width = max(console.width, 80)  # in a narrow window lines break, but no number is left out
    console.print(table)


def _known(value: float, digits: int) -> str:
    """A number, or a dash where there was nothing to be measured."""
    return f"{value:.{digits}f}" if value == value else "-"
