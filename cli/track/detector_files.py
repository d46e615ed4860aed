"""`appocc track kitti` and `appocc track mot`: track the detections of recordings without a dataset."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cli.common import JsonOption, emit, local_path, out_path, progress, say
from cli.track.options import ALL_SCORES, KITTI_MIN_SCORE, MinScoreOption, SmoothOption
from cli.track.output import say_below, say_files, show_metrics

if TYPE_CHECKING:
    from tracking.evaluation.kitti import KittiScores
    from tracking.io.kitti import KittiSequence


def track_kitti_command(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", parser=local_path, help="Folder of KITTI sequences with detections.")
    ],
    smooth: SmoothOption = False,
    min_score: MinScoreOption = KITTI_MIN_SCORE,
    out: Annotated[
        Path | None, typer.Option("--out", parser=out_path, help="Output folder; by default DIR/tracks.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Track the objects of KITTI sequences in a detector's boxes.

    Writes a KITTI result file per sequence; with labels, prints the scores.

    Example: appocc track kitti KITTI --out results
    """
    from tracking.detections import probability_from_log_odds
    from tracking.evaluation.kitti import score_sequences
    from tracking.io.kitti import read_sequences
    from tracking.io.kitti_results import kitti_score
    from tracking.pipeline import best_scores, kitti_folder, track_kitti, write_kitti_tracks

    destination = kitti_folder(folder, out)
    sequences = read_sequences(folder)
    with progress("tracking", sum(len(sequence.frames) for sequence in sequences)) as advance:
        outcomes = track_kitti(sequences, smooth, advance)
    files = write_kitti_tracks(destination, outcomes, min_score)
    least = kitti_score(min_score)
    best = [score for one in outcomes for score in best_scores(one.results).values()]
    below = [float(probability_from_log_odds(score)) for score in best if score < least]
    say(f"{len(best) - len(below)} objects in {len(sequences)} sequences")
    say_below(below, min_score)
    scores = score_sequences([(one.sequence, one.results) for one in outcomes], least)
    for kind, own in scores.items():
        show_metrics(kind, {"written": own.metrics, "track cut": own.at_best_cut, "causal cut": own.at_causal_cut})
        if math.isfinite(own.best_cut):
            say(f"track cut: mean score from {own.best_cut:.4f}; causal cut: score so far from {own.causal_cut:.4f}")
    if not scores:
        say(f"{_unscored(sequences)}: nothing to be scored against")
    say_files(files)
    if as_json:
        classes = {kind: _kitti_json(own) for kind, own in scores.items()}
        cars = classes.get("car") or dict.fromkeys(_KITTI_KEYS)
        names = [sequence.name for sequence in sequences]
        emit({"sequences": names, "files": [str(path) for path in files], **cars, "classes": classes})


def _unscored(sequences: Sequence[KittiSequence]) -> str:
    """Return why there are no scores."""
    from tracking.evaluation.kitti import detected_kinds

    labelled = [sequence for sequence in sequences if sequence.labels is not None]
    kinds = ", ".join(sorted(detected_kinds(labelled)))
    return f"no labels of the detected classes ({kinds})" if kinds else "no labels"


_KITTI_KEYS = ("metrics", "metrics_at_best_cut", "metrics_at_causal_cut")


def _kitti_json(scores: KittiScores) -> dict[str, Any]:
    """Return the scores of a class of KITTI sequences."""
    return {
        "metrics": scores.metrics.as_json(),
        "metrics_at_best_cut": {**scores.at_best_cut.as_json(), "cut": scores.best_cut},
        "metrics_at_causal_cut": {**scores.at_causal_cut.as_json(), "cut": scores.causal_cut},
    }


def track_mot_command(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", parser=local_path, help="MOTChallenge detections of people.")
    ],
    fps: Annotated[float, typer.Option("--fps", help="Frame rate of the recording.")],
    min_score: MinScoreOption = ALL_SCORES,
    out: Annotated[
        Path | None, typer.Option("--out", parser=out_path, help="Output folder; by default tracks next to FILE.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Track people in MOTChallenge detections; writes MOTChallenge text.

    Example: appocc track mot det.txt --fps 25 --out results
    """
    from tracking.io.mot_challenge import read_mot_detections, write_mot_tracks
    from tracking.pipeline import best_scores, count_tracks, people_path, select_scores, track_people

    path = people_path(file, out or file.parent / "tracks")
    sequence = read_mot_detections(file, fps)
    frames = len(sequence.frames)
    with progress("tracking", frames) as advance:
        every = track_people(sequence, advance)
    tracks = select_scores(every, min_score)
    write_mot_tracks(path, sequence, tracks)
    count = count_tracks(tracks)
    where = "on the ground" if sequence.px_per_m is None else "in the picture"
    if as_json:
        emit({"detections": str(file), "frames": frames, "followed": where, "tracks": count, "files": [str(path)]})
    say(f"{count} people in {frames} frames, followed {where}")
    say_below([score for score in best_scores(every).values() if score < min_score], min_score)
    say_files([path])
