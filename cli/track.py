"""`appocc track`: follow what a scene's maps show, or what a detector found in anybody's recording."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from appocc.errors import AppoccError, DataError
from cli.common import JsonOption, TrustUnseenOption, VersionOption, emit, out_path, progress, say

if TYPE_CHECKING:
    from appocc.nuscenes import Dataset, Scene
    from tracking.evaluation.clear_id_hota import Metrics
    from tracking.pipeline import SceneTracks

# What can be followed: what each of them needs beside it, and what else it may have.
_SOURCES = {
    "--bev": (("ROOT", "--scene"), ("--version", "--smooth", "--out", "--video", "--trust-unseen")),
    "--detections": (("ROOT", "--scene"), ("--version", "--smooth", "--out")),
    "--kitti": ((), ("--smooth", "--out")),
    "--mot": (("--fps",), ("--out",)),
}


def track(
    root: Annotated[
        Path | None, typer.Argument(metavar="ROOT", help="Dataset root in the nuScenes schema.", show_default=False)
    ] = None,
    scene: Annotated[str | None, typer.Option("--scene", help="Name or token of the scene.")] = None,
    bev: Annotated[
        str | None,
        typer.Option("--bev", help="Source of the maps: ROOT/bev/SOURCE, or a folder with a slash in its name."),
    ] = None,
    detections: Annotated[
        Path | None,
        typer.Option("--detections", help="Instead of maps: detection results for the scene, as nuScenes has them."),
    ] = None,
    kitti: Annotated[
        Path | None, typer.Option("--kitti", help="Instead of a scene: a folder of KITTI sequences with detections.")
    ] = None,
    mot: Annotated[
        Path | None, typer.Option("--mot", help="Instead of a scene: a file of MOTChallenge detections of people.")
    ] = None,
    fps: Annotated[float | None, typer.Option("--fps", help="Frames a second of the --mot file.")] = None,
    smooth: Annotated[
        bool, typer.Option("--smooth", help="In hindsight: smooth the paths, fill gaps, leave out false ends.")
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            parser=out_path,
            help="Folder to write; by default ROOT/tracks/SOURCE/SCENE (SOURCE: that of the maps, or the name of the "
            "--detections file), KITTI/tracks, or tracks beside the --mot file.",
        ),
    ] = None,
    video: Annotated[Path | None, typer.Option("--video", help="Also write a video of the tracks (.webm).")] = None,
    trust_unseen: TrustUnseenOption = False,
    version: VersionOption = None,
    as_json: JsonOption = False,
) -> None:
    """Follow the vehicles of a scene through its maps, or whatever a detector found in a recording.

    A scene's tracks are written as nuScenes JSON and MOTChallenge text and, with annotations, the scores of its
    vehicles; those of KITTI sequences as KITTI's result files, and with labels their scores are told; those of people
    as MOTChallenge text.

    Examples: appocc track DATA --scene 002 --bev groundtruth --video tracks.webm

    appocc track DATA --scene scene-0103 --detections results_nusc.json

    appocc track --kitti KITTI --out results

    appocc track --mot det.txt --fps 25 --out results
    """
    everything = {
        **{"ROOT": root, "--scene": scene, "--bev": bev, "--detections": detections, "--kitti": kitti, "--mot": mot},
        **{"--fps": fps, "--smooth": smooth or None, "--out": out, "--video": video, "--version": version},
        "--trust-unseen": trust_unseen or None,
    }
    _check_together({name for name, value in everything.items() if value is not None})
    if kitti is not None:
        _track_kitti(kitti, smooth, out or kitti / "tracks", as_json)
    elif mot is not None and fps is not None:
        _track_mot(mot, fps, out or mot.parent / "tracks", as_json)
    elif root is not None and scene is not None:
        _track_scene(root, scene, bev, detections, smooth, out, video, trust_unseen, version, as_json)


def _check_together(given: set[str]) -> None:
    """Check that one source was given, with all that it needs and nothing that it cannot use.

    Raises:
        AppoccError: if not.
    """
    sources = [name for name in _SOURCES if name in given]
    if len(sources) != 1:
        got = " and ".join(sources) or "none"
        raise AppoccError(f"track: expected one of {_listed(_SOURCES)}, got {got}; see: appocc track --help")
    needed, possible = _SOURCES[sources[0]]
    lacking = [name for name in needed if name not in given]
    if lacking:
        raise AppoccError(f"track: {sources[0]} needs {_listed(needed)}, got no {_listed(lacking)}")
    extra = sorted(given - {*sources, *needed, *possible})
    if extra:
        allowed = _listed([*needed, *possible, "--json"])
        raise AppoccError(f"track: {sources[0]} goes only with {allowed}, got {_listed(extra)}")


def _listed(names: Iterable[str]) -> str:
    *most, last = names
    return f"{', '.join(most)} and {last}" if most else last


def _track_scene(
    root: Path,
    scene: str,
    bev: str | None,
    detections: Path | None,
    smooth: bool,
    out: Path | None,
    video: Path | None,
    trust_unseen: bool,
    version: str | None,
    as_json: bool,
) -> None:
    """Follow the vehicles of a scene through its maps, or a detector's objects through it."""
    from appocc.nuscenes import Dataset
    from tracking.pipeline import score, tracks_folder, write_metrics, write_tracks
    from tracking.visualization.video import check_name, write_video

    if video is not None:
        check_name(video)
    dataset = Dataset(root, version)
    wanted = dataset.scene(scene)
    folder = out or tracks_folder(root, str(bev) if detections is None else detections.stem, wanted.name)
    frames = len(dataset.samples(wanted))
    result, left_out = _followed(dataset, wanted, frames, bev, detections, smooth, trust_unseen)
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
        source = {"bev": bev} if detections is None else {"detections": str(detections), "left_out": left_out}
        emit(
            {
                "scene": result.scene,
                **source,
                "tracks": result.count,
                "files": [str(path) for path in files],
                **{name: scores[name].as_json() if scores else None for name in names},
            }
        )
    what = "vehicles" if detections is None else "objects"
    say(f"scene {result.scene}: {result.count} {what} in {frames} key frames")
    if left_out:
        told = ", ".join(f"{name} ({count})" for name, count in left_out.items())
        say(f"left out, as they are no classes of the tracking benchmark: boxes of {told}")
    if scores is None:
        say("no annotations: nothing to be scored against")
    else:
        kinds = {"metrics": "all", "metrics_moving": "moving", "metrics_parked": "parked"}
        _show("vehicles", {kinds[name]: metrics for name, metrics in scores.items()})
    for path in files:
        say(f"  {path}")


def _followed(
    dataset: Dataset,
    scene: Scene,
    frames: int,
    bev: str | None,
    detections: Path | None,
    smooth: bool,
    trust_unseen: bool,
) -> tuple[SceneTracks, Mapping[str, int]]:
    """The tracks of a scene, and of how many boxes of which classes were left out."""
    from tracking.io.nuscenes_detections import track_detections
    from tracking.pipeline import track_scene
    from tracking.tracker import MAPS, Tracker

    tracker = Tracker(MAPS) if detections is None else Tracker()
    with progress("tracking", frames) as advance:
        if detections is not None:
            result, left_out = track_detections(dataset, scene, detections, tracker, advance)
        else:
            result, left_out = track_scene(dataset, scene, str(bev), tracker, None, advance, trust_unseen), {}
    return (result.smoothed(tracker.config.life.motion) if smooth else result), left_out


def _track_kitti(root: Path, smooth: bool, folder: Path, as_json: bool) -> None:
    """Follow the vehicles of all sequences of a folder, each on its own; write a file for each."""
    from tracking.evaluation.kitti import trial_of
    from tracking.filtering.smoother import smooth as smoothed
    from tracking.io.kitti import read_sequences, track_sequence
    from tracking.io.kitti_results import results_of, write_results
    from tracking.tracker import Tracker

    sequences = read_sequences(root)
    outcomes, count = [], 0
    with progress("tracking", sum(len(sequence.frames) for sequence in sequences)) as advance:
        for sequence in sequences:
            tracks = track_sequence(sequence, Tracker(), advance)
            if smooth:
                tracks = smoothed([frame.timestamp_us for frame in sequence.frames], tracks)
            count += len({each.id for moment in tracks for each in moment})
            outcomes.append((sequence, results_of(sequence, tracks)))
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


def _track_mot(path: Path, fps: float, folder: Path, as_json: bool) -> None:
    """Follow the people of a file of detections; write a file of its name."""
    from tracking.detections import lead
    from tracking.io.mot_challenge import read_boxes, write_boxes
    from tracking.tracker import Tracker

    written = folder / f"{path.stem}.txt"
    if written.resolve() == path.resolve():
        raise DataError(f"{path}: the tracks would be written over the detections; name another folder with --out")
    sequence = read_boxes(path, fps)
    with progress("tracking", len(sequence.frames)) as advance:
        tracks = lead(Tracker(sequence.config), sequence.frames, advance)
    write_boxes(written, sequence, tracks)
    count = len({each.id for moment in tracks for each in moment})
    where = "on the ground" if sequence.px_per_m is None else "in the picture"
    if as_json:
        files = {"files": [str(written)]}
        emit({"detections": str(path), "frames": len(sequence.frames), "followed": where, "tracks": count, **files})
    say(f"{count} people in {len(sequence.frames)} frames, followed {where}")
    say(f"  {written}")


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
