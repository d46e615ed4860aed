"""`appocc track`: follow the vehicles of a scene through its colour bird's-eye views."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from appocc.errors import AppoccError
from cli.common import JsonOption, VersionOption, emit, progress, say

if TYPE_CHECKING:
    from tracking.metrics import Metrics


def track(
    root: Annotated[
        Path | None, typer.Argument(metavar="ROOT", help="Dataset root in the nuScenes schema.", show_default=False)
    ] = None,
    scene: Annotated[str | None, typer.Option("--scene", help="Name or token of the scene.")] = None,
    bev: Annotated[
        str | None,
        typer.Option("--bev", help="Source of the maps: ROOT/bev/SOURCE, or a folder with a slash in its name."),
    ] = None,
    kitti: Annotated[
        Path | None, typer.Option("--kitti", help="Instead of a scene: a folder of KITTI sequences with detections.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder to write; by default ROOT/tracks/SCENE, or KITTI/tracks.")
    ] = None,
    video: Annotated[Path | None, typer.Option("--video", help="Also write a video of the tracks (.webm).")] = None,
    version: VersionOption = None,
    as_json: JsonOption = False,
) -> None:
    """Follow the vehicles of a scene through its maps, or of KITTI sequences through a detector's boxes.

    A scene's tracks are written as nuScenes JSON and MOTChallenge text and, with annotations, their scores; those of
    sequences as KITTI's result files, and with labels their scores are told.

    Examples: appocc track DATA --scene 002 --bev groundtruth --video tracks.webm

    appocc track --kitti KITTI --out results
    """
    if kitti is not None and any(value is not None for value in (root, scene, bev, video, version)):
        raise AppoccError("track: --kitti goes only with --out and --json, without ROOT, --scene and --bev")
    if kitti is not None:
        _track_kitti(kitti, out or kitti / "tracks", as_json)
    elif root is None or scene is None or bev is None:
        raise AppoccError("track: expected ROOT, --scene and --bev, or --kitti; see: appocc track --help")
    else:
        _track_scene(root, scene, bev, out, video, version, as_json)


def _track_scene(
    root: Path, scene: str, bev: str, out: Path | None, video: Path | None, version: str | None, as_json: bool
) -> None:
    """Follow the vehicles of a scene through its maps."""
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
    if scores is None:
        say("no annotations: nothing to be scored against")
    else:
        kinds = {"metrics": "all", "metrics_moving": "moving", "metrics_parked": "parked"}
        _show("vehicles", {kinds[name]: metrics for name, metrics in scores.items()})
    for path in files:
        say(f"  {path}")


def _track_kitti(root: Path, folder: Path, as_json: bool) -> None:
    """Follow the vehicles of all sequences of a folder, each on its own; write a file for each."""
    from tracking.kitti import read_sequences, track_sequence
    from tracking.kitti_protocol import trial_of
    from tracking.kitti_results import results_of, write_results
    from tracking.tracker import Tracker

    sequences = read_sequences(root)
    outcomes, count = [], 0
    with progress("tracking", sum(len(sequence.frames) for sequence in sequences)) as advance:
        for sequence in sequences:
            tracks = track_sequence(sequence, Tracker())
            count += len({each.id for moment in tracks for each in moment})
            outcomes.append((sequence, results_of(sequence, tracks)))
            advance(len(sequence.frames))
    files = [folder / f"{sequence.name}.txt" for sequence in sequences]
    for path, (_, results) in zip(files, outcomes, strict=True):
        write_results(path, results)
    answer: dict[str, Any] = {
        "sequences": [sequence.name for sequence in sequences],
        "files": [str(path) for path in files],
        "metrics": None,
        "metrics_at_best_cut": None,
    }
    say(f"{count} vehicles in {len(sequences)} sequences")
    labelled = [outcome for outcome in outcomes if outcome[0].labels is not None]
    if labelled:
        trial = trial_of(labelled)
        cut = trial.best_cut()
        every, best = trial.metrics(), trial.metrics(cut)
        answer |= {"metrics": every.as_json(), "metrics_at_best_cut": {**best.as_json(), "cut": cut}}
        _show("tracks", {"all": every, "cut": best})
        say(f"cut: tracks whose mean score is {cut:.4f} or more, for the best MOTA")
    else:
        say("no labels: nothing to be scored against")
    for path in files:
        say(f"  {path}")
    if as_json:
        emit(answer)


def _show(title: str, scores: dict[str, Metrics]) -> None:
    """Named scores as a table on stderr."""
    from rich.console import Console
    from rich.table import Table

    table = Table(title, "MOTA %", "IDF1 %", "HOTA %", "MOTP m", "IDS", "FRAG", "FP", "FN", "GT")
    for name, m in scores.items():
        shares = [_known(100 * share, 1) for share in (m.MOTA, m.IDF1, m.HOTA)]
        counts = [str(count) for count in (m.IDS, m.FRAG, m.FP, m.FN, m.GT)]
        table.add_row(name, *shares, _known(m.MOTP, 2), *counts)
    console = Console(stderr=True)
    console.width = max(console.width, 80)  # in a narrow window lines break, but no number is left out
    console.print(table)


def _known(value: float, digits: int) -> str:
    """A number, or a dash where there was nothing to be measured."""
    return f"{value:.{digits}f}" if value == value else "-"
