"""Tracking of people in images, compared with SORT on the same boxes.

    OMP_NUM_THREADS=1 python -m benchmarks.people FOLDER [--made 4]

FOLDER contains recordings in folders of their own, `NAME/gt.txt` and `NAME/test.txt`, MOTChallenge text at 25 frames
a second. The boxes of test.txt are tracked, its ids ignored. With --made N, boxes made from the ground truth are
tracked as well, N draws of each recording: a tenth are missed, half of the misses last for another frame, places and
heights have errors, and one box in twenty is false. IoU of 0.5, all boxes required; figures of `appocc eval tracks`.

SORT (Bewley et al. 2016) is the published method: a filterpy `KalmanFilter` of centre, area and aspect ratio for each
track, the Hungarian method on the IoU, at least 0.3; a track is written from its third match in a row on, in frames
with a match, as the filtered box.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from filterpy.kalman import KalmanFilter
from rich.console import Console
from rich.table import Table
from scipy.optimize import linear_sum_assignment

from appocc.checks import BoolArray, FloatArray
from appocc.errors import AppoccError, DataError
from tracking.evaluation.clear_id_hota import Metrics
from tracking.evaluation.evaluate import EvaluationOptions, evaluate_files
from tracking.image_boxes import intersection_px2
from tracking.io.mot_challenge import MotSequence, read_mot_detections, write_mot_tracks
from tracking.pipeline import track_people

FPS = 25.0
MIN_IOU, MIN_HITS = 0.3, 3
MISSED, LASTS, FALSE, OFF = 0.1, 0.5, 0.05, 0.05
TRACKERS = ("appocc", "SORT")
FIGURES = ("MOTA", "IDF1", "HOTA", "IDS", "FRAG", "FP", "FN")


class _Sorted:
    """One track of SORT."""

    def __init__(self, number: int, box_px: FloatArray) -> None:
        self.id, self.hits, self.unseen = number, 0, 0
        self._filter = KalmanFilter(dim_x=7, dim_z=4)
        self._filter.F = np.eye(7) + np.eye(7, k=4)
        self._filter.H = np.eye(4, 7)
        self._filter.R = np.diag([1.0, 1.0, 10.0, 10.0])
        self._filter.P = np.diag([10.0] * 4 + [1e4] * 3)
        self._filter.Q = np.diag([1.0] * 4 + [0.01, 0.01, 1e-4])
        self._filter.x[:4, 0] = _measured(box_px)

    @property
    def box_px(self) -> FloatArray:
        """(4,) left, top, width, height."""
        x, y, area, aspect = self._filter.x[:4, 0]
        width = np.sqrt(max(area * aspect, 1.0))
        return np.array([x - width / 2, y - area / width / 2, width, area / width])

    def predict(self) -> None:
        """Predict the next frame."""
        if self._filter.x[2, 0] + self._filter.x[6, 0] <= 0:
            self._filter.x[6, 0] = 0.0
        self._filter.predict()
        self.hits, self.unseen = (self.hits if self.unseen == 0 else 0), self.unseen + 1

    def update(self, box_px: FloatArray) -> None:
        """Update with a matched box (4,)."""
        self._filter.update(_measured(box_px))
        self.hits, self.unseen = self.hits + 1, 0


def _measured(box_px: FloatArray) -> FloatArray:
    """Return centre, area and aspect ratio (4,) of a box (4,)."""
    left, top, width, height = box_px
    return np.array([left + width / 2, top + height / 2, width * height, width / height])


def sort_rows(sequence: MotSequence) -> list[str]:
    """Return the MOTChallenge rows of SORT's tracks."""
    alive: list[_Sorted] = []
    rows, born = [], 0
    for count, frame in enumerate(sequence.frames, start=1):
        for one in alive:
            one.predict()
        predicted = np.array([one.box_px for one in alive]).reshape(-1, 4)
        iou = _iou(predicted, frame.boxes_px)
        matched: BoolArray = np.zeros(len(frame.boxes_px), np.bool_)
        for i, j in zip(*linear_sum_assignment(-iou), strict=True):
            if iou[i, j] >= MIN_IOU:
                alive[i].update(frame.boxes_px[j])
                matched[j] = True
        for box_px in frame.boxes_px[~matched]:
            born += 1
            alive.append(_Sorted(born, box_px))
        alive = [one for one in alive if one.unseen <= 1]
        for one in alive:
            if one.unseen == 0 and (one.hits >= MIN_HITS or count <= MIN_HITS):
                box_columns = ",".join(f"{pixels:.2f}" for pixels in one.box_px)
                rows.append(f"{frame.number},{one.id},{box_columns},1,-1,-1,-1\n")
    return rows


def _iou(boxes_px: FloatArray, others_px: FloatArray) -> FloatArray:
    """Return the IoU (N, M) of boxes (N, 4) and (M, 4)."""
    one, other = (np.concatenate([each[:, :2], each[:, :2] + each[:, 2:]], axis=1) for each in (boxes_px, others_px))
    common = intersection_px2(one, other)
    areas = [each[:, 2:].prod(axis=1) for each in (boxes_px, others_px)]
    return np.asarray(common / (areas[0][:, None] + areas[1] - common))


def made_rows(truth: FloatArray, seed: int) -> list[str]:
    """Return rows of made boxes from rows of the ground truth (R, 10)."""
    dice = np.random.default_rng(seed)
    rows, missed = [], set[int]()
    for number in np.unique(truth[:, 0]):
        here = truth[truth[:, 0] == number]
        chance = np.array([LASTS if int(one) in missed else MISSED for one in here[:, 1]])
        gone = dice.random(len(here)) < chance
        missed = {int(one) for one in here[gone, 1]}
        seen, near = here[~gone, 2:6], here[dice.random(len(here)) < FALSE, 2:6]
        near[:, :2] += dice.normal(0, near[:, 2:])
        boxes = np.concatenate([seen, near])
        size = boxes[:, 2:] * np.exp(dice.normal(0, OFF, (len(boxes), 2)))
        centre = boxes[:, :2] + boxes[:, 2:] / 2 + dice.normal(0, OFF, (len(boxes), 2)) * boxes[:, 2:]
        for box in np.concatenate([centre - size / 2, size], axis=1):
            rows.append(f"{int(number)},-1,{','.join(f'{pixels:.2f}' for pixels in box)},-1,-1,-1,-1\n")
    return rows


def measure(truth: Path, boxes: Path, scratch: Path) -> tuple[Metrics, Metrics]:
    """Return the figures of the tracker and of SORT on a file of boxes.

    Raises:
        DataError: if a file is missing or damaged.
    """
    sequence = read_mot_detections(boxes, FPS)
    files = scratch / "own.txt", scratch / "sort.txt"
    write_mot_tracks(files[0], sequence, track_people(sequence))
    files[1].write_text("".join(sort_rows(sequence)))
    own, theirs = (evaluate_files(truth, each, EvaluationOptions()).metrics for each in files)
    return own, theirs


def _inputs(truth: Path, draws: int, scratch: Path) -> Iterator[tuple[str, Path]]:
    """Yield the given boxes of a recording, then made ones, with their names."""
    yield "given", truth.with_name("test.txt")
    for seed in range(draws):
        made = scratch / "made.txt"
        made.write_text("".join(made_rows(np.loadtxt(truth, delimiter=","), seed)))
        yield f"made {seed}", made


def main(arguments: Sequence[str] | None = None) -> None:
    """Parse arguments, measure, print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--made", type=int, default=0, help="number of draws of made boxes of each recording (0)")
    options = parser.parse_args(arguments)
    table = Table("recording", "boxes", "tracker", *FIGURES)
    try:
        truths = sorted(options.folder.glob("*/gt.txt"))
        if not truths:
            raise DataError(f"{options.folder}: expected recordings NAME/gt.txt, found none")
        with tempfile.TemporaryDirectory() as scratch:
            for truth in truths:
                for name, boxes in _inputs(truth, options.made, Path(scratch)):
                    for tracker, figures in zip(TRACKERS, measure(truth, boxes, Path(scratch)), strict=True):
                        cells = [getattr(figures, figure) for figure in FIGURES]
                        shares = [f"{100 * share:.1f}" for share in cells[:3]]
                        table.add_row(truth.parent.name, name, tracker, *shares, *map(str, cells[3:]))
    except AppoccError as error:
        sys.exit(f"error: {error}")
    Console(width=110).print(table)


if __name__ == "__main__":
    main()
