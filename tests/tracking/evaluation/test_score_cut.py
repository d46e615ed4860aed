from __future__ import annotations

import numpy as np

from tracking.evaluation.clear_id_hota import evaluate_distances
from tracking.evaluation.frames import DistanceFrame, centre_distance_rule
from tracking.evaluation.score_cut import ScoredSequence, best_cut, mean_scores

RULE = centre_distance_rule()


def made(seed: int) -> ScoredSequence:
    """Twenty frames of four objects and seven tracks with random scores, most of them near objects."""
    random = np.random.default_rng(seed)
    frames, scores = [], []
    for _ in range(20):
        distance = random.uniform(0, 5, (4, 7))
        yes = np.ones(7, np.bool_)
        frames.append(DistanceFrame(np.arange(4), yes[:4], np.arange(7), yes, distance))
        scores.append(random.normal(0, 1, 7))
    return ScoredSequence(tuple(frames), tuple(scores))


def test_the_best_of_all_cuts_is_found() -> None:
    for seed in range(3):
        rows = made(seed)
        tracks = ScoredSequence(rows.frames, mean_scores(rows.frames, rows.scores))
        for each in (rows, tracks):
            every = np.unique(np.concatenate(each.scores))
            mota = [evaluate_distances(each.cut(cut), RULE).MOTA for cut in every]
            assert max(mota) == evaluate_distances(each.cut(best_cut([each], RULE)), RULE).MOTA


def test_the_mean_score_is_that_of_the_track() -> None:
    one = DistanceFrame(
        np.zeros(0, np.int64), np.zeros(0, np.bool_), np.array([3, 5]), np.ones(2, np.bool_), np.zeros((0, 2))
    )
    both = mean_scores((one, one), (np.array([1.0, 2.0]), np.array([3.0, 6.0])))
    assert [each.tolist() for each in both] == [[2, 4], [2, 4]]
