"""How good tracks of cars are by the rules of KITTI, judged by the distance of centres on the ground plane.

- Cars and vans are objects; demanded are cars that are wholly in the picture (truncation 0) and not hidden
  (occlusion 2 at most). A track on one that is not demanded is neither right nor wrong.
- An unmatched track is not judged if its rectangle is 25 px high or less, or more than half of it lies in one region
  whose objects were not marked.
- All sequences are scored as one: their counts add up.
- A cut drops whole tracks: those whose mean score is below it. The best cut is the one with the largest MOTA.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from appocc.checks import FloatArray, IntArray
from appocc.errors import DataError
from tracking.evaluation.clear_id_hota import Compared, Metrics, Moment, by_centre, evaluate_compared
from tracking.image_boxes import judged
from tracking.io.kitti import KittiLabels, KittiSequence
from tracking.io.kitti_results import KittiResult

OBJECTS, DEMANDED, KIND = ("Car", "Van"), "Car", "car"
MOST_OCCLUSION = 2
COARSE_CUTS, REFINEMENTS = 10, 3

Results = Sequence[Sequence[KittiResult]]


@dataclass(frozen=True)
class Trial:
    """Tracks of sequences beside the truth.

    Attributes:
        compared: all frames, one sequence after another; tracks are numbered from 0, objects too.
        mean_scores: (M,) of each track, over its frames.
    """

    compared: tuple[Compared, ...]
    mean_scores: FloatArray

    def metrics(self, cut: float = -np.inf) -> Metrics:
        """Scores of the tracks whose mean score is `cut` or more."""
        keep = self.mean_scores >= cut
        return evaluate_compared([frame.only(keep[frame.track_ids]) for frame in self.compared], by_centre())

    def best_cut(self) -> float:
        """The cut with the largest MOTA that is found; minus infinity without tracks or demanded cars.

        Ten of the tracks' mean scores are tried, evenly by rank, then thrice those around the best in steps of a
        fourth.
        """
        if not self.mean_scores.size or not any(frame.demanded.any() for frame in self.compared):
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


def trial_of(outcomes: Sequence[tuple[KittiSequence, Results]]) -> Trial:
    """What the results of sequences are judged by; only cars among them.

    Raises:
        DataError: if a sequence has no labels.
    """
    objects: dict[tuple[int, int], int] = {}
    tracks: dict[tuple[int, int], int] = {}
    scores: dict[int, list[float]] = {}
    compared = []
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
            compared.append(_compared(labels, chosen, truth_ids, cars, track_ids))
    return Trial(tuple(compared), np.array([np.mean(scores[i]) for i in range(len(scores))]))


def _compared(
    labels: KittiLabels,
    chosen: IntArray,
    truth_ids: Sequence[int],
    cars: Sequence[KittiResult],
    track_ids: Sequence[int],
) -> Compared:
    """One frame: the chosen labels, numbered anew, and the tracks."""
    whole = (labels.occluded <= MOST_OCCLUSION) & (labels.truncated == 0)
    demanded = whole & np.array([name == DEMANDED for name in labels.types], dtype=np.bool_)
    rectangles = np.array([car.image_box_px for car in cars]).reshape(-1, 4)
    moment = Moment(
        np.array(truth_ids, dtype=np.int64),
        labels.ground_m[chosen, :2],
        demanded[chosen],
        np.array(track_ids, dtype=np.int64),
        np.array([car.ground_m[:2] for car in cars]).reshape(-1, 2),
        judged(rectangles, labels.dont_care_px),
    )
    return moment.compared()
