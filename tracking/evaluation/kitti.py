"""KITTI's evaluation rules for tracks of cars, pedestrians and cyclists, by distances between centres on the ground.

- Objects are those of the class and of its neighbouring class (Van, Person); required are those of the class that are
  completely inside the image (truncation 0) and not largely occluded (occlusion up to 2). Tracks matched to other
  objects are ignored.
- Unmatched tracks are not penalised if their image box is up to 25 px high, or if more than half of it is in one
  DontCare region.
- All sequences are scored as one, each class on its own.
- Two cuts by score are reported, see `tracking.evaluation.score_cut`: of whole tracks by their mean score, as in
  published figures, and the causal one of single rows by their own score. Both have the maximum MOTA.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from appocc.checks import IntArray
from appocc.errors import DataError
from tracking.evaluation.clear_id_hota import Metrics, evaluate_distances
from tracking.evaluation.frames import DistanceFrame, EvaluationFrame, centre_distance_rule
from tracking.evaluation.score_cut import ScoredSequence, best_cut, mean_scores
from tracking.image_boxes import kitti_penalised
from tracking.io.kitti import KittiLabels, KittiSequence
from tracking.io.kitti_results import KittiResult

# Names in labels by category: required, and ignored because similar.
LABELS: dict[str, tuple[str, tuple[str, ...]]] = {
    "car": ("Car", ("Van",)),
    "pedestrian": ("Pedestrian", ("Person", "Person_sitting")),
    "bicycle": ("Cyclist", ()),
}
MAX_OCCLUSION = 2
# Number of cuts of rows that are tried: there are as many as rows.
CAUSAL_CANDIDATES = 400

Results = Sequence[Sequence[KittiResult]]


@dataclass(frozen=True, eq=False)
class KittiEvaluation:
    """Tracks and ground truth of one class in all sequences; tracks and objects are numbered from 0.

    Attributes:
        sequences: sequences with the score of each row.
    """

    sequences: tuple[ScoredSequence, ...]

    def by_track(self) -> KittiEvaluation:
        """Return the same with the mean score of its track as the score of each row."""
        return KittiEvaluation(
            tuple(replace(each, scores=mean_scores(each.frames, each.scores)) for each in self.sequences)
        )

    def metrics(self, cut: float = -np.inf) -> Metrics:
        """Return the metrics of the rows whose score is at least `cut`."""
        return evaluate_distances(
            [frame for each in self.sequences for frame in each.cut(cut)], centre_distance_rule()
        )

    def best_cut(self, candidates: int | None = None) -> float:
        """Return the cut of the rows' scores with the maximum MOTA, see `score_cut.best_cut`."""
        return best_cut(self.sequences, centre_distance_rule(), candidates)


@dataclass(frozen=True)
class KittiScores:
    """Scores of a class in KITTI sequences.

    Attributes:
        metrics: metrics of all rows.
        at_best_cut: metrics of the tracks with a mean score of at least `best_cut`.
        best_cut: minimum mean score of the tracks with the best MOTA; minus infinity without tracks.
        at_causal_cut: metrics of the rows with a score of at least `causal_cut`.
        causal_cut: minimum score of the rows with the best MOTA; minus infinity without rows.
    """

    metrics: Metrics
    at_best_cut: Metrics
    best_cut: float
    at_causal_cut: Metrics
    causal_cut: float


def score_sequences(
    outcomes: Sequence[tuple[KittiSequence, Results]], min_score: float = -np.inf
) -> dict[str, KittiScores]:
    """Score the results of the sequences with labels, by category.

    Categories are those that are detected, or all if nothing is; of these, the ones with required objects.

    Args:
        outcomes: sequences with all results.
        min_score: minimum score of the rows in `KittiScores.metrics`; the cuts are chosen from all rows.
    """
    labelled = [(sequence, results) for sequence, results in outcomes if sequence.labels is not None]
    found = detected_kinds(sequence for sequence, _ in labelled) or set(LABELS)
    scores = {}
    for kind in LABELS:
        rows = prepare_evaluation(labelled, kind)
        required = any(frame.required.any() for each in rows.sequences for frame in each.frames)
        if kind not in found or not required:
            continue
        tracks = rows.by_track()
        cut, causal = tracks.best_cut(), rows.best_cut(CAUSAL_CANDIDATES)
        scores[kind] = KittiScores(rows.metrics(min_score), tracks.metrics(cut), cut, rows.metrics(causal), causal)
    return scores


def detected_kinds(sequences: Iterable[KittiSequence]) -> set[str]:
    """Return the categories of the detections."""
    return {kind for sequence in sequences for frame in sequence.frames for kind in frame.detections.kind}


def prepare_evaluation(outcomes: Sequence[tuple[KittiSequence, Results]], kind: str = "car") -> KittiEvaluation:
    """Combine the results of sequences with their labels, for one category.

    Raises:
        DataError: if a sequence has no labels.
    """
    objects: dict[tuple[int, int], int] = {}
    tracks: dict[tuple[int, int], int] = {}
    required, ignored = LABELS[kind]
    sequences = []
    for number, (sequence, results) in enumerate(outcomes):
        if sequence.labels is None:
            raise DataError(f"sequence {sequence.name}: expected labels to judge tracks by, got none")
        frames, scores = [], []
        for labels, all_kinds in zip(sequence.labels, results, strict=True):
            own = [result for result in all_kinds if result.kind == kind]
            track_ids = [tracks.setdefault((number, result.id), len(tracks)) for result in own]
            chosen = np.flatnonzero(np.isin(labels.types, (required, *ignored)))
            truth_ids = [objects.setdefault((number, id_), len(objects)) for id_ in labels.ids[chosen].tolist()]
            frames.append(_distance_frame(labels, required, chosen, truth_ids, own, track_ids))
            scores.append(np.array([result.score for result in own]))
        sequences.append(ScoredSequence(tuple(frames), tuple(scores)))
    return KittiEvaluation(tuple(sequences))


def _distance_frame(
    labels: KittiLabels,
    name: str,
    chosen: IntArray,
    truth_ids: Sequence[int],
    results: Sequence[KittiResult],
    track_ids: Sequence[int],
) -> DistanceFrame:
    """Return a frame with the chosen labels, required if of a name, and the tracks, under their new ids."""
    visible = (labels.occluded <= MAX_OCCLUSION) & (labels.truncated == 0)
    required = visible & np.array([own == name for own in labels.types], dtype=np.bool_)
    image_boxes_px = np.array([result.image_box_px for result in results]).reshape(-1, 4)
    frame = EvaluationFrame(
        truth_ids=np.array(truth_ids, dtype=np.int64),
        truth_xy_m=labels.ground_m[chosen, :2],
        required=required[chosen],
        track_ids=np.array(track_ids, dtype=np.int64),
        track_xy_m=np.array([result.ground_m[:2] for result in results]).reshape(-1, 2),
        penalised=kitti_penalised(image_boxes_px, labels.dont_care_px),
    )
    return frame.with_distances()
