"""KITTI's evaluation rules for tracks of cars, with distances between centres on the ground plane.

- Cars and vans are objects; required are cars that are completely inside the image (truncation 0) and not largely
  occluded (occlusion up to 2). Tracks matched to other objects are ignored.
- Unmatched tracks are not penalised if their image box is up to 25 px high, or if more than half of it is in one
  DontCare region.
- All sequences are scored as one.
- A cut removes whole tracks: those whose mean score is below it. The best cut has the maximum MOTA.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from appocc.checks import FloatArray, IntArray
from appocc.errors import DataError
from tracking.evaluation.clear_id_hota import (
    DistanceFrame,
    EvaluationFrame,
    Metrics,
    centre_distance_rule,
    evaluate_distances,
)
from tracking.image_boxes import kitti_penalised
from tracking.io.kitti import KittiLabels, KittiSequence
from tracking.io.kitti_results import KittiResult

OBJECTS, REQUIRED, KIND = ("Car", "Van"), "Car", "car"
MAX_OCCLUSION = 2
COARSE_CUTS, REFINEMENTS = 10, 3

Results = Sequence[Sequence[KittiResult]]


@dataclass(frozen=True, eq=False)
class KittiEvaluation:
    """Tracks and ground truth of all sequences.

    Attributes:
        frames: all frames, one sequence after another; tracks and objects are numbered from 0.
        mean_scores: (M,) mean score of each track over its frames.
    """

    frames: tuple[DistanceFrame, ...]
    mean_scores: FloatArray

    def metrics(self, cut: float = -np.inf) -> Metrics:
        """Return the metrics of tracks whose mean score is at least `cut`."""
        keep = self.mean_scores >= cut
        return evaluate_distances(
            [frame.select_tracks(keep[frame.track_ids]) for frame in self.frames], centre_distance_rule()
        )

    def best_cut(self) -> float:
        """Search the cut with the maximum MOTA; minus infinity without tracks or required cars.

        Ten mean scores, evenly spaced by rank, are tried first, then three times those around the best one, with a
        quarter of the step.
        """
        if not self.mean_scores.size or not any(frame.required.any() for frame in self.frames):
            return -np.inf
        scores = np.unique(self.mean_scores).tolist()
        mota: dict[int, float] = {}
        step = max(len(scores) // COARSE_CUTS, 1)
        ranks = range(0, len(scores), step)
        for _ in range(1 + REFINEMENTS):
            mota |= {rank: self.metrics(scores[rank]).MOTA for rank in ranks if rank not in mota}
            best = max(mota, key=lambda rank: mota[rank])
            step = max(step // 4, 1)
            ranks = range(max(best - 3 * step, best % step), min(best + 3 * step + 1, len(scores)), step)
        return float(scores[best])


@dataclass(frozen=True)
class KittiScores:
    """Scores of KITTI sequences.

    Attributes:
        metrics: metrics of all tracks.
        at_best_cut: metrics at the best cut.
        best_cut: minimum mean score of the tracks with the best MOTA.
    """

    metrics: Metrics
    at_best_cut: Metrics
    best_cut: float


def score_sequences(outcomes: Sequence[tuple[KittiSequence, Results]]) -> KittiScores | None:
    """Score the results of the sequences with labels; None if no sequence has labels."""
    labelled = [(sequence, results) for sequence, results in outcomes if sequence.labels is not None]
    if not labelled:
        return None
    evaluation = prepare_evaluation(labelled)
    cut = evaluation.best_cut()
    return KittiScores(evaluation.metrics(), evaluation.metrics(cut), cut)


def prepare_evaluation(outcomes: Sequence[tuple[KittiSequence, Results]]) -> KittiEvaluation:
    """Combine the results of sequences with their labels; only cars are evaluated.

    Raises:
        DataError: if a sequence has no labels.
    """
    objects: dict[tuple[int, int], int] = {}
    tracks: dict[tuple[int, int], int] = {}
    scores: dict[int, list[float]] = {}
    frames = []
    for number, (sequence, results) in enumerate(outcomes):
        if sequence.labels is None:
            raise DataError(f"sequence {sequence.name}: expected labels to judge tracks by, got none")
        for labels, all_kinds in zip(sequence.labels, results, strict=True):
            cars = [result for result in all_kinds if result.kind == KIND]
            track_ids = [tracks.setdefault((number, car.id), len(tracks)) for car in cars]
            for track_id, car in zip(track_ids, cars, strict=True):
                scores.setdefault(track_id, []).append(car.score)
            chosen = np.flatnonzero(np.isin(labels.types, OBJECTS))
            truth_ids = [objects.setdefault((number, id_), len(objects)) for id_ in labels.ids[chosen].tolist()]
            frames.append(_distance_frame(labels, chosen, truth_ids, cars, track_ids))
    return KittiEvaluation(tuple(frames), np.array([np.mean(scores[i]) for i in range(len(scores))]))


def _distance_frame(
    labels: KittiLabels,
    chosen: IntArray,
    truth_ids: Sequence[int],
    cars: Sequence[KittiResult],
    track_ids: Sequence[int],
) -> DistanceFrame:
    """Return a frame with the chosen labels and the tracks, under their new ids."""
    visible = (labels.occluded <= MAX_OCCLUSION) & (labels.truncated == 0)
    required = visible & np.array([name == REQUIRED for name in labels.types], dtype=np.bool_)
    image_boxes_px = np.array([car.image_box_px for car in cars]).reshape(-1, 4)
    frame = EvaluationFrame(
        truth_ids=np.array(truth_ids, dtype=np.int64),
        truth_xy_m=labels.ground_m[chosen, :2],
        required=required[chosen],
        track_ids=np.array(track_ids, dtype=np.int64),
        track_xy_m=np.array([car.ground_m[:2] for car in cars]).reshape(-1, 2),
        penalised=kitti_penalised(image_boxes_px, labels.dont_care_px),
    )
    return frame.with_distances()
