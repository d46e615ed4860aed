"""Tracking of cars in KITTI sequences by KITTI's rules: online, smoothed, and a plain Kalman filter as baseline.

    OMP_NUM_THREADS=1 python -m benchmarks.kitti ROOT [--cut X]

ROOT is a folder with labels, in the layout of `tracking.io.kitti`. Both trackers get the same detections and poses.
Tracks whose mean score is below a cut are dropped; each tracker has its own cut, the one with the highest MOTA over
all sequences, or for ours the given one. Rows of single sequences use the same cut. Parameters are chosen on
one half of the sequences, every second one from the first, and judged on the other; both have been seen. At the
causal cut, single rows are dropped by their own score, by what is known at that frame. "smoothed" is the offline
smoothing of the tracker's tracks (`tracking.filtering.smoother`); the other rows are online.

The baseline filters positions on the ground with constant velocity and isotropic noise, assigns by the least sum of
distances, and reports a track only in frames with a matched detection.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import track as progress
from rich.table import Table
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from appocc.checks import FloatArray
from appocc.errors import AppoccError
from appocc.geometry import apply, wrap_angle, yaw_of
from tracking.detections import Detections, probability_from_log_odds
from tracking.evaluation.clear_id_hota import Metrics
from tracking.evaluation.kitti import CAUSAL_CANDIDATES, KittiEvaluation, Results, prepare_evaluation
from tracking.filtering.smoother import smooth
from tracking.io.kitti import KittiSequence, read_sequences
from tracking.io.kitti_results import kitti_results
from tracking.pipeline import OnlineTracker, track_sequence
from tracking.tracker import Tracker
from tracking.tracks import Track

Tracked = tuple[tuple[Track, ...], ...]
GATE_M, MOST_UNSEEN = 2.0, 12
NOISE_M, FIRST_SPEED_MPS, ACCELERATION = 0.3, 8.0, 4.0  # the last in m2/s3, a random walk of the velocity


@dataclass
class _Point:
    """A moving point; variances and covariance of position and velocity are the same along both axes."""

    id: int
    place_m: FloatArray
    velocity_mps: FloatArray = field(default_factory=lambda: np.zeros(2))
    variances: FloatArray = field(default_factory=lambda: np.diag([NOISE_M**2, FIRST_SPEED_MPS**2]))
    unseen: int = 0

    def predict(self, seconds: float) -> None:
        """Predict the state after a time."""
        step = np.array([[1.0, seconds], [0.0, 1.0]])
        walk = np.array([[seconds**3 / 3, seconds**2 / 2], [seconds**2 / 2, seconds]])
        self.place_m = self.place_m + seconds * self.velocity_mps
        self.variances = step @ self.variances @ step.T + ACCELERATION * walk
        self.unseen += 1

    def see(self, place_m: FloatArray) -> None:
        """Update the state with the position (2,) of a detection."""
        gain = self.variances[:, 0] / (self.variances[0, 0] + NOISE_M**2)
        off = place_m - self.place_m
        self.place_m, self.velocity_mps = self.place_m + gain[0] * off, self.velocity_mps + gain[1] * off
        self.variances = self.variances - np.outer(gain, self.variances[0])
        self.unseen = 0


class PlainFilter:
    """The baseline tracker."""

    def __init__(self) -> None:
        """Start with no tracks."""
        self._alive: list[_Point] = []
        self._born = 0
        self._time_us: int | None = None

    def update(self, detections: Detections, timestamp_us: int, world_from_ego: FloatArray) -> tuple[Track, ...]:
        """Return the tracks with a matched detection; their scores are those of the detections."""
        seconds = (timestamp_us - (self._time_us or 0)) * 1e-6
        self._time_us = timestamp_us
        for point in self._alive:
            point.predict(seconds)
        ground = apply(world_from_ego, detections.ground_m)
        places = np.array([point.place_m for point in self._alive]).reshape(-1, 2)
        distance = cdist(places, ground[:, :2])
        rows, columns = linear_sum_assignment(np.where(distance < GATE_M, distance, 1e6))
        taken = {}
        for row, column in zip(rows.tolist(), columns.tolist(), strict=True):
            if distance[row, column] < GATE_M:
                self._alive[row].see(ground[column, :2])
                taken[column] = self._alive[row]
        for column in range(len(detections)):
            if column not in taken:
                self._born += 1
                taken[column] = _Point(self._born, ground[column, :2].copy())
                self._alive.append(taken[column])
        self._alive = [point for point in self._alive if point.unseen <= MOST_UNSEEN]
        turn = float(yaw_of(world_from_ego))
        return tuple(_track(taken[i], detections, i, ground[i, 2], turn) for i in range(len(detections)))


def _track(point: _Point, detections: Detections, i: int, ground_z_m: float, turn_rad: float) -> Track:
    width, length, height = detections.size_m[i].tolist()
    return Track(
        id=point.id,
        position_world_m=np.array([*point.place_m, ground_z_m]),
        velocity_world_mps=point.velocity_mps.copy(),
        yaw_world_rad=float(wrap_angle(detections.yaw_rad[i] + turn_rad)),
        heading_known=True,
        length_m=length,
        width_m=width,
        rgb=np.full(3, np.nan),
        score=float(probability_from_log_odds(detections.log_odds[i])),
        seen=True,
        height_m=height,
        kind=detections.kind[i],
        detection=i,
    )


def follow(sequences: Sequence[KittiSequence], make: Callable[[], OnlineTracker]) -> list[Tracked]:
    """Track each sequence with a new tracker."""
    bar = Console(stderr=True)
    return [track_sequence(one, make()) for one in progress(sequences, "tracking", console=bar, transient=True)]


@dataclass(frozen=True)
class Row:
    """Scores of a tracker: name of the sequence, all or a half; at the track cut and at the causal cut."""

    sequence: str
    tracks: Metrics
    rows: Metrics


def measure(
    sequences: Sequence[KittiSequence], tracks: Sequence[Tracked], cut: float | None
) -> tuple[tuple[float, float], list[Row]]:
    """Return the track cut and the causal cut, and the scores of all sequences together and of each."""
    outcomes: list[tuple[KittiSequence, Results]] = [
        (one, kitti_results(one, track)) for one, track in zip(sequences, tracks, strict=True)
    ]
    rows = prepare_evaluation(outcomes)
    cut = rows.by_track().best_cut() if cut is None else cut
    causal = rows.best_cut(CAUSAL_CANDIDATES)
    halves = (("half to choose", rows.sequences[::2]), ("half to judge", rows.sequences[1::2]))
    parts = [("all", rows), *((name, KittiEvaluation(half)) for name, half in halves)] + [
        (one.name, KittiEvaluation((own,))) for one, own in zip(sequences, rows.sequences, strict=True)
    ]
    return (cut, causal), [Row(name, part.by_track().metrics(cut), part.metrics(causal)) for name, part in parts]


def _shares(tracks: Metrics, rows: Metrics) -> tuple[float, ...]:
    return tracks.MOTA, tracks.IDF1, tracks.HOTA, rows.MOTA, rows.IDF1


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("root", type=Path)
    parser.add_argument("--cut", type=float, help="score cut of our tracks; default: the best")
    asked = parser.parse_args(arguments)
    try:
        sequences = read_sequences(asked.root)
        online = follow(sequences, Tracker)
        times = [[frame.timestamp_us for frame in sequence.frames] for sequence in sequences]
        rows = {
            "appocc": measure(sequences, online, asked.cut),
            "appocc, smoothed": measure(sequences, [*map(smooth, times, online)], asked.cut),
            "plain filter": measure(sequences, follow(sequences, PlainFilter), None),
        }
    except AppoccError as error:
        sys.exit(f"error: {error}")
    table = Table(
        *("tracker", "sequence", "cut", "MOTA", "IDF1", "IDS", "FRAG", "HOTA", "FP", "FN", "GT"),
        *("causal cut", "MOTA", "IDF1"),
    )
    for number in range(len(rows["appocc"][1])):
        for tracker, ((cut, causal), scores) in rows.items():
            m, now = scores[number].tracks, scores[number].rows
            shares = [f"{100 * share:.1f}" if share == share else "-" for share in _shares(m, now)]
            counts = [str(count) for count in (m.FP, m.FN, m.GT)]
            name, counts = scores[number].sequence, [str(m.IDS), str(m.FRAG), shares[2], *counts]
            table.add_row(tracker, name, f"{cut:.4f}", *shares[:2], *counts, f"{causal:.4f}", *shares[3:])
    console = Console()
    console.width = max(console.width, 130)
    console.print(table)


if __name__ == "__main__":
    main()
