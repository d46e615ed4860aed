"""How far the tracker's covariances and places can be believed: NIS, and the errors of told places.

    OMP_NUM_THREADS=1 python -m benchmarks.tracking_consistency KITTI [--made FOLDER]

KITTI is a folder as for `benchmarks.kitti`, FOLDER one as for `benchmarks.made_boxes`.

- NIS: squared innovations in units of their covariance, from the tracks that the tracker learns the noise from. Both
  coordinates together, a consistent filter has a mean of 2 and a median of 1.4; the mean is of values up to 9,
  because larger ones are wrong matches.
- places: mean and root mean square distance to the nearest required car, of detections within 1.5 m of one, and of
  the tracks with these detections.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from appocc.checks import BoolArray, FloatArray, IntArray
from appocc.errors import AppoccError, DataError
from appocc.geometry import apply, inverse
from benchmarks.made_boxes import make_scene
from tracking.class_models import ClassModel, ClassTable
from tracking.evaluation.kitti import MAX_OCCLUSION
from tracking.io.kitti import KittiSequence, read_sequences
from tracking.records import Records
from tracking.tracker import Tracker

NEAR_M, LARGEST_NIS = 1.5, 9.0


class _Recorder(ClassTable):
    """Class models that remember the NIS of what they learn from."""

    def __init__(self, tracker: Tracker) -> None:
        """Take the place of the class models of a new tracker."""
        super().__init__(tracker.config.classes, ClassModel(motion=tracker.config.lifecycle.motion))
        self.nis: list[float] = []
        tracker._classes = tracker._table._classes = self

    def learn_noise(
        self, found: Records, columns: IntArray, innovation_m: FloatArray, cov: FloatArray, use: BoolArray
    ) -> None:
        """Remember the NIS, then learn."""
        noise_m2 = (found["noise_m2"] - found["surplus_noise_m2"])[columns]
        weighted = np.linalg.solve(cov[:, :2, :2] + noise_m2, innovation_m[..., None])[..., 0]
        self.nis += (weighted * innovation_m).sum(axis=1)[use].tolist()
        super().learn_noise(found, columns, innovation_m, cov, use)


def measure_kitti(sequences: Sequence[KittiSequence]) -> tuple[FloatArray, FloatArray]:
    """Return the NIS (N,), and the errors (M, 2) of detections and of tracks in metres.

    Raises:
        DataError: if a sequence has no labels.
    """
    nis, errors = [], [np.zeros((0, 2))]
    for sequence in sequences:
        if sequence.labels is None:
            raise DataError(f"sequence {sequence.name}: expected labels to judge tracks by, got none")
        tracker = Tracker()
        recorder = _Recorder(tracker)
        for frame, labels in zip(sequence.frames, sequence.labels, strict=True):
            tracks = tracker.update(frame.detections, frame.timestamp_us, frame.world_from_ego)
            visible = (labels.occluded <= MAX_OCCLUSION) & (labels.truncated == 0)
            cars = labels.ground_m[visible & np.array([each == "Car" for each in labels.types], np.bool_), :2]
            seen = tracks.detection >= 0
            if not (len(cars) and seen.any()):
                continue
            given = frame.detections.ground_m[tracks.detection[seen], :2]
            told = apply(inverse(frame.world_from_ego), tracks.position_world_m[seen])[:, :2]
            offset = np.hypot(*(given[:, None] - cars).transpose(2, 0, 1))
            nearest = cars[offset.argmin(axis=1)]
            both = np.stack([np.hypot(*(places - nearest).T) for places in (given, told)], axis=1)
            errors.append(both[offset.min(axis=1) < NEAR_M])
        nis += recorder.nis
    return np.array(nis), np.concatenate(errors)


def measure_made(paths: Sequence[Path]) -> FloatArray:
    """Return the NIS (N,) of made detections."""
    nis = []
    for path in paths:
        scene, tracker = make_scene(path, hz=2.0, seed=0), Tracker()
        recorder = _Recorder(tracker)
        for each in zip(scene.detections, scene.timestamps_us.tolist(), scene.world_from_ego, strict=True):
            tracker.update(*each)
        nis += recorder.nis
    return np.array(nis)


def _cells(nis: FloatArray, errors: FloatArray | None = None) -> list[str]:
    """Format the mean and the median of the NIS, then mean and root mean square errors of detections and tracks."""
    cells = [f"{np.minimum(nis, LARGEST_NIS).mean():.2f}", f"{np.median(nis):.2f}"]
    if errors is not None:
        both = np.concatenate([errors.mean(axis=0), np.sqrt((errors**2).mean(axis=0))])
        cells += [f"{value:.3f}" for value in both]
    return cells


def main(arguments: Sequence[str] | None = None) -> None:
    """Parse arguments, measure, print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("root", type=Path)
    parser.add_argument("--made", type=Path, help="folder with trajectories")
    options = parser.parse_args(arguments)
    table = Table("data", "half", "NIS", "median", "detections m", "tracks m", "rms detections m", "rms tracks m")
    try:
        sequences = read_sequences(options.root)
        made = sorted(options.made.glob("scene-*.npz")) if options.made else []
        for half, name in enumerate(("to choose", "to judge")):
            if sequences[half::2]:
                table.add_row("KITTI", name, *_cells(*measure_kitti(sequences[half::2])))
            if made[half::2]:
                table.add_row("made boxes", name, *_cells(measure_made(made[half::2])))
    except AppoccError as error:
        sys.exit(f"error: {error}")
    Console(width=120).print(table)


if __name__ == "__main__":
    main()
