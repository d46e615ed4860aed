"""KITTI sequences and MOTChallenge files: detections in, tracks and files out."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from tracking.filtering.smoother import smooth
from tracking.io.kitti import KittiSequence
from tracking.io.kitti_results import KittiResult, kitti_results, kitti_score, write_kitti_results
from tracking.io.mot_challenge import MotSequence
from tracking.pipeline.online import OnlineTracker, no_progress, run_tracker, select_scores
from tracking.presets import PEOPLE_IN_IMAGE, PEOPLE_ON_GROUND
from tracking.tracker import Tracker, TrackerConfig
from tracking.tracks import Track


@dataclass(frozen=True, eq=False)
class KittiTracks:
    """Tracks of a KITTI sequence.

    Attributes:
        sequence: T frames.
        tracks: T tuples of tracks.
        results: T tuples of the tracks inside the image, as KITTI results.
    """

    sequence: KittiSequence
    tracks: tuple[tuple[Track, ...], ...]
    results: tuple[tuple[KittiResult, ...], ...]


def track_sequence(
    sequence: KittiSequence, tracker: OnlineTracker, advance: Callable[[int], None] = no_progress
) -> tuple[tuple[Track, ...], ...]:
    """Run a new tracker on a KITTI sequence and return the tracks of each frame; `advance` as in `run_tracker`."""
    return run_tracker(tracker, sequence.frames, advance)


def track_kitti(
    sequences: Iterable[KittiSequence], smoothing: bool = False, advance: Callable[[int], None] = no_progress
) -> list[KittiTracks]:
    """Track KITTI sequences, optionally with offline smoothing; `advance` as in `run_tracker`."""
    outcomes = []
    for sequence in sequences:
        tracks = track_sequence(sequence, Tracker(), advance)
        if smoothing:
            tracks = smooth([frame.timestamp_us for frame in sequence.frames], tracks)
        outcomes.append(KittiTracks(sequence, tracks, kitti_results(sequence, tracks)))
    return outcomes


def write_kitti_tracks(folder: Path, outcomes: Iterable[KittiTracks], min_score: float = 0.0) -> list[Path]:
    """Write the results of each sequence with at least a score, 0..1, to NNNN.txt and return the paths.

    Raises:
        DataError: if a file cannot be written.
    """
    paths = []
    for outcome in outcomes:
        paths.append(folder / f"{outcome.sequence.name}.txt")
        write_kitti_results(paths[-1], select_scores(outcome.results, kitti_score(min_score)))
    return paths


def people_config(sequence: MotSequence) -> TrackerConfig:
    """Return the tracker configuration for people on the ground or in the image."""
    return PEOPLE_ON_GROUND if sequence.px_per_m is None else PEOPLE_IN_IMAGE


def track_people(
    sequence: MotSequence, advance: Callable[[int], None] = no_progress
) -> tuple[tuple[Track, ...], ...]:
    """Track the people of a MOTChallenge file and return the tracks of each frame; `advance` as in `run_tracker`."""
    return run_tracker(Tracker(people_config(sequence)), sequence.frames, advance)
