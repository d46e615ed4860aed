"""`appocc track`: track vehicles through maps, or objects through the detections of a recording."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from appocc.errors import AppoccError
from cli.common import (
    JsonOption,
    RootArgument,
    SceneOption,
    SourceOption,
    TrustUnseenOption,
    VersionOption,
    choose_scene,
    choose_source,
    emit,
    in_path,
    local_path,
    out_path,
    progress,
    say,
    wide_console,
)

if TYPE_CHECKING:
    from appocc.nuscenes import Dataset
    from tracking.evaluation.clear_id_hota import Metrics
    from tracking.evaluation.kitti import KittiScores
    from tracking.pipeline import SceneTracks

# Hidden sub-command for the form without sub-commands.
_OLDER_FORM = "older-form"


class _TrackGroup(TyperGroup):
    """Sub-commands; other arguments are those of the older form."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Insert the hidden sub-command if the first argument is neither a sub-command nor `--help`."""
        if not args or args[0] not in {*self.commands, "--help"}:
            args = [_OLDER_FORM, *args]
        return super().parse_args(ctx, args)


app = typer.Typer(
    name="track",
    cls=_TrackGroup,
    help="""Track the vehicles of a scene, or objects in the detections of a recording.

    Examples: appocc track scene DATA --scene 002 --bev groundtruth --video tracks.webm

    appocc track detections DATA results_nusc.json --scene scene-0103

    appocc track kitti KITTI --out results

    appocc track mot det.txt --fps 25 --out results

    The older form works too: appocc track DATA --scene 002 --bev groundtruth, or with --detections, --kitti or --mot.
    """,
)

SmoothOption = Annotated[
    bool,
    typer.Option("--smooth", help="Offline smoothing: smooth paths, fill gaps, drop predictions after the last hit."),
]
MinScoreOption = Annotated[
    float,
    typer.Option(
        "--min-score",
        min=0.0,
        max=1.0,
        help="Write a track only in frames in which its score, a probability, is at least this.",
    ),
]
VideoOption = Annotated[
    Path | None, typer.Option("--video", parser=out_path, help="Also write a video of the tracks (.webm).")
]
# Detectors for KITTI report many boxes of low scores; nuScenes' benchmark wants all of them.
_KITTI_MIN_SCORE, _ALL = 0.5, 0.0
_BEV_HELP = "Source of the maps: ROOT/bev/SOURCE, or a folder with a slash in its name."


@app.command("scene")
def track_scene_command(
    root: RootArgument,
    scene: SceneOption = None,
    bev: SourceOption = None,
    smooth: SmoothOption = False,
    min_score: MinScoreOption = _ALL,
    out: Annotated[
        Path | None,
        typer.Option("--out", parser=out_path, help="Output folder; by default ROOT/tracks/SOURCE/SCENE."),
    ] = None,
    video: VideoOption = None,
    trust_unseen: TrustUnseenOption = False,
    version: VersionOption = None,
    as_json: JsonOption = False,
) -> None:
    """Track a scene through its bird's-eye-view maps: their objects, or vehicle blobs of maps without objects.

    Writes nuScenes JSON, MOTChallenge text, CSV tables and, with annotations, the scores.

    Example: appocc track scene DATA --scene 002 --bev groundtruth --video tracks.webm
    """
    from appocc.nuscenes import Dataset
    from tracking.pipeline import track_scene, tracks_folder
    from tracking.visualization.video import check_video_path

    if video is not None:
        check_video_path(video)
    dataset = Dataset(root, version)
    wanted, source = choose_scene(dataset, scene), choose_source(root, bev)
    folder = out or tracks_folder(root, source, wanted.name)
    with progress("tracking", len(dataset.samples(wanted))) as advance:
        result = track_scene(dataset, wanted, source, trust_unseen=trust_unseen, smoothing=smooth, advance=advance)
    _report_scene(dataset, result.with_scores(min_score), {"bev": source}, folder, video, as_json)


@app.command("detections")
def track_detections_command(
    root: RootArgument,
    file: Annotated[
        Path, typer.Argument(metavar="FILE", parser=in_path, help="nuScenes detection results for the scene.")
    ],
    scene: SceneOption = None,
    smooth: SmoothOption = False,
    min_score: MinScoreOption = _ALL,
    out: Annotated[
        Path | None,
        typer.Option("--out", parser=out_path, help="Output folder; by default ROOT/tracks/FILE/SCENE."),
    ] = None,
    version: VersionOption = None,
    as_json: JsonOption = False,
) -> None:
    """Track the objects of a scene in a detector's nuScenes results.

    Writes the same files as `track scene`; classes, heights and used sensors are those of the detector.

    Example: appocc track detections DATA results_nusc.json --scene scene-0103
    """
    from appocc.nuscenes import Dataset
    from tracking.pipeline import track_detections, tracks_folder

    dataset = Dataset(root, version)
    wanted = choose_scene(dataset, scene)
    folder = out or tracks_folder(root, file.stem, wanted.name)
    with progress("tracking", len(dataset.samples(wanted))) as advance:
        result, skipped = track_detections(dataset, wanted, file, smoothing=smooth, advance=advance)
    source = {"detections": str(file), "left_out": skipped}
    _report_scene(dataset, result.with_scores(min_score), source, folder, None, as_json)


@app.command("kitti")
def track_kitti_command(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", parser=local_path, help="Folder of KITTI sequences with detections.")
    ],
    smooth: SmoothOption = False,
    min_score: MinScoreOption = _KITTI_MIN_SCORE,
    out: Annotated[
        Path | None, typer.Option("--out", parser=out_path, help="Output folder; by default DIR/tracks.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Track the objects of KITTI sequences in a detector's boxes.

    Writes a KITTI result file per sequence; with labels, prints the scores.

    Example: appocc track kitti KITTI --out results
    """
    from tracking.evaluation.kitti import score_sequences
    from tracking.io.kitti import read_sequences
    from tracking.io.kitti_results import kitti_score
    from tracking.pipeline import count_tracks, track_kitti, write_kitti_tracks

    sequences = read_sequences(folder)
    with progress("tracking", sum(len(sequence.frames) for sequence in sequences)) as advance:
        outcomes = track_kitti(sequences, smooth, advance)
    files = write_kitti_tracks(out or folder / "tracks", outcomes, min_score)
    say(f"{sum(count_tracks(one.tracks) for one in outcomes)} objects in {len(sequences)} sequences")
    scores = score_sequences([(one.sequence, one.results) for one in outcomes], kitti_score(min_score))
    for kind, own in scores.items():
        _show(kind, {"written": own.metrics, "track cut": own.at_best_cut, "causal cut": own.at_causal_cut})
        say(f"track cut: mean score from {own.best_cut:.4f}; causal cut: score so far from {own.causal_cut:.4f}")
    if not scores:
        say("no labels: nothing to be scored against")
    _say_files(files)
    if as_json:
        classes = {kind: _kitti_json(own) for kind, own in scores.items()}
        cars = classes.get("car") or dict.fromkeys(_KITTI_KEYS)
        names = [sequence.name for sequence in sequences]
        emit({"sequences": names, "files": [str(path) for path in files], **cars, "classes": classes})


_KITTI_KEYS = ("metrics", "metrics_at_best_cut", "metrics_at_causal_cut")


def _kitti_json(scores: KittiScores) -> dict[str, Any]:
    """Return the scores of a class of KITTI sequences."""
    return {
        "metrics": scores.metrics.as_json(),
        "metrics_at_best_cut": {**scores.at_best_cut.as_json(), "cut": scores.best_cut},
        "metrics_at_causal_cut": {**scores.at_causal_cut.as_json(), "cut": scores.causal_cut},
    }


@app.command("mot")
def track_mot_command(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", parser=local_path, help="MOTChallenge detections of people.")
    ],
    fps: Annotated[float, typer.Option("--fps", help="Frame rate of the recording.")],
    min_score: MinScoreOption = _ALL,
    out: Annotated[
        Path | None, typer.Option("--out", parser=out_path, help="Output folder; by default tracks next to FILE.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Track people in MOTChallenge detections; writes MOTChallenge text.

    Example: appocc track mot det.txt --fps 25 --out results
    """
    from tracking.io.mot_challenge import read_mot_detections, write_mot_tracks
    from tracking.pipeline import count_tracks, people_path, select_scores, track_people

    path = people_path(file, out or file.parent / "tracks")
    sequence = read_mot_detections(file, fps)
    frames = len(sequence.frames)
    with progress("tracking", frames) as advance:
        tracks = select_scores(track_people(sequence, advance), min_score)
    write_mot_tracks(path, sequence, tracks)
    count = count_tracks(tracks)
    where = "on the ground" if sequence.px_per_m is None else "in the picture"
    if as_json:
        emit({"detections": str(file), "frames": frames, "followed": where, "tracks": count, "files": [str(path)]})
    say(f"{count} people in {frames} frames, followed {where}")
    _say_files([path])


# Older form -------------------------------------------------------------------------------------------------------

# The inputs of the older form, the options that each requires, and those that it allows.
_INPUTS = {
    "--bev": (("ROOT", "--scene"), ("--version", "--smooth", "--min-score", "--out", "--video", "--trust-unseen")),
    "--detections": (("ROOT", "--scene"), ("--version", "--smooth", "--min-score", "--out")),
    "--kitti": ((), ("--smooth", "--min-score", "--out")),
    "--mot": (("--fps",), ("--min-score", "--out")),
}


@app.command(_OLDER_FORM, hidden=True)
def track_older_form(
    root: Annotated[
        Path | None,
        typer.Argument(
            metavar="ROOT", parser=in_path, help="Dataset root in the nuScenes schema.", show_default=False
        ),
    ] = None,
    scene: Annotated[str | None, typer.Option("--scene", help="Name or token of the scene.")] = None,
    bev: Annotated[str | None, typer.Option("--bev", help=_BEV_HELP)] = None,
    detections: Annotated[
        Path | None, typer.Option("--detections", parser=in_path, help="nuScenes detection results for the scene.")
    ] = None,
    kitti: Annotated[
        Path | None, typer.Option("--kitti", parser=local_path, help="Folder of KITTI sequences with detections.")
    ] = None,
    mot: Annotated[
        Path | None, typer.Option("--mot", parser=local_path, help="MOTChallenge detections of people.")
    ] = None,
    fps: Annotated[float | None, typer.Option("--fps", help="Frame rate of the --mot file.")] = None,
    smooth: SmoothOption = False,
    min_score: Annotated[
        float | None, typer.Option("--min-score", min=0.0, max=1.0, help="As in the sub-commands.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", parser=out_path, help="Output folder; defaults as in the sub-commands.")
    ] = None,
    video: VideoOption = None,
    trust_unseen: TrustUnseenOption = False,
    version: VersionOption = None,
    as_json: JsonOption = False,
) -> None:
    """Track with one of --bev, --detections, --kitti and --mot: the older form of the sub-commands."""
    values = {
        **{"ROOT": root, "--scene": scene, "--bev": bev, "--detections": detections, "--kitti": kitti, "--mot": mot},
        **{
            "--fps": fps,
            "--smooth": smooth or None,
            "--min-score": min_score,
            "--out": out,
            "--video": video,
            "--version": version,
        },
        "--trust-unseen": trust_unseen or None,
    }
    _check_combination({name for name, value in values.items() if value is not None})
    score = _ALL if min_score is None else min_score
    if kitti is not None:
        track_kitti_command(kitti, smooth, _KITTI_MIN_SCORE if min_score is None else min_score, out, as_json)
    elif mot is not None and fps is not None:
        track_mot_command(mot, fps, score, out, as_json)
    elif root is not None and scene is not None and detections is not None:
        track_detections_command(root, detections, scene, smooth, score, out, version, as_json)
    elif root is not None and scene is not None and bev is not None:
        track_scene_command(
            root,
            scene,
            bev,
            smooth=smooth,
            min_score=score,
            out=out,
            video=video,
            trust_unseen=trust_unseen,
            version=version,
            as_json=as_json,
        )


def _check_combination(given: set[str]) -> None:
    """Check that there is one input with all required and only allowed options.

    Raises:
        AppoccError: if not.
    """
    inputs = [name for name in _INPUTS if name in given]
    if len(inputs) != 1:
        got = " and ".join(inputs) or "none"
        raise AppoccError(f"track: expected one of {_listed(_INPUTS)}, got {got}; see: appocc track --help")
    required, optional = _INPUTS[inputs[0]]
    missing = [name for name in required if name not in given]
    if missing:
        raise AppoccError(f"track: {inputs[0]} needs {_listed(required)}, got no {_listed(missing)}")
    extra = sorted(given - {*inputs, *required, *optional})
    if extra:
        allowed = _listed([*required, *optional, "--json"])
        raise AppoccError(f"track: {inputs[0]} goes only with {allowed}, got {_listed(extra)}")


def _listed(names: Iterable[str]) -> str:
    *most, last = names
    return f"{', '.join(most)} and {last}" if most else last


# Output -----------------------------------------------------------------------------------------------------------


def _report_scene(
    dataset: Dataset,
    result: SceneTracks,
    source: Mapping[str, Any],
    folder: Path,
    video: Path | None,
    as_json: bool,
) -> None:
    """Score and write the tracks of a scene, and print what was done; `source` are the keys of the input."""
    from appocc.boxes import is_person_or_bicycle
    from tracking.evaluation.scene import score_scene, write_scored_tracks
    from tracking.visualization.video import write_video

    scores = score_scene(dataset, result)
    if video is not None:  # before the tracks are written, because it reads all images and may find a damaged one
        with progress("video", len(result.samples)) as advance:
            write_video(dataset, result, video, advance)
    files = write_scored_tracks(folder, result, scores)
    files += [video] if video is not None else []
    titles = {"metrics": "all", "metrics_moving": "moving", "metrics_parked": "parked"}
    if as_json:
        metrics = {name: scores[name].as_json() if scores else None for name in titles}
        paths = [str(path) for path in files]
        emit({"scene": result.scene, **source, "tracks": result.count, "files": paths, **metrics})
    people = any(is_person_or_bicycle(track.kind) for states in result.tracks for track in states)
    kind = "vehicles" if "bev" in source and not people else "objects"
    say(f"scene {result.scene}: {result.count} {kind} in {len(result.samples)} key frames")
    if source.get("left_out"):
        counts = ", ".join(f"{name} ({count})" for name, count in source["left_out"].items())
        say(f"left out, as they are no classes of the tracking benchmark: boxes of {counts}")
    if scores is None:
        say("no annotations: nothing to be scored against")
    else:
        _show("vehicles", {titles[name]: metrics for name, metrics in scores.items()})
    _say_files(files)


# Printing ---------------------------------------------------------------------------------------------------------


def _say_files(paths: Iterable[Path]) -> None:
    for path in paths:
        say(f"  {path}")


def _show(title: str, scores: Mapping[str, Metrics]) -> None:
    """Print named scores as a table on stderr."""
    from rich.table import Table

    table = Table(title, "MOTA %", "IDF1 %", "HOTA %", "MOTP m", "IDS", "FRAG", "FP", "FN", "GT")
    for name, m in scores.items():
        shares = [_format_number(100 * share, 1) for share in (m.MOTA, m.IDF1, m.HOTA)]
        counts = [str(count) for count in (m.IDS, m.FRAG, m.FP, m.FN, m.GT)]
        table.add_row(name, *shares, _format_number(m.MOTP, 2), *counts)
    console = wide_console(80)
    console.print(table)


def _format_number(value: float, digits: int) -> str:
    """Format a number; a dash for NaN."""
    return f"{value:.{digits}f}" if value == value else "-"
