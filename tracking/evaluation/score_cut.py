"""Score cuts: the minimum score of written tracks or rows that gives the best MOTA.

Two cuts are in use:

- of tracks: a track is kept or dropped as a whole, by its mean score. Published figures use it, but it is not causal:
  whether the first row is written depends on the last one.
- of rows: each row is kept or dropped by its own score, by what was known at that time. It is what an online system
  can do.

The search is exact: MOTA at every candidate is computed, or bounded from above by less than the best one found.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, dataclass
from functools import cache

import numpy as np

from appocc.checks import FloatArray
from tracking.evaluation.clear import ErrorCounts, count_errors
from tracking.evaluation.frames import DistanceFrame, MatchingRule


@dataclass(frozen=True, eq=False)
class ScoredSequence:
    """Frames of one sequence in temporal order, with the score of each row.

    Attributes:
        frames: T frames.
        scores: T arrays (M,), the score that decides whether a row is kept.
    """

    frames: tuple[DistanceFrame, ...]
    scores: tuple[FloatArray, ...]

    def cut(self, minimum: float) -> list[DistanceFrame]:
        """Return the frames with the rows whose score is at least `minimum`."""
        return [frame.select_tracks(own >= minimum) for frame, own in zip(self.frames, self.scores, strict=True)]


def mean_scores(frames: Sequence[DistanceFrame], scores: Sequence[FloatArray]) -> tuple[FloatArray, ...]:
    """Return for each row the mean score of its track over all frames."""
    ids = np.concatenate([frame.track_ids for frame in frames] or [np.zeros(0, np.int64)])
    values = np.concatenate([*scores, np.zeros(0)])
    names, index = np.unique(ids, return_inverse=True)
    mean = np.bincount(index, values, len(names)) / np.maximum(np.bincount(index, minlength=len(names)), 1)
    ends = np.cumsum([len(frame.track_ids) for frame in frames])
    return tuple(np.split(mean[index], ends[:-1]))


def best_cut(sequences: Sequence[ScoredSequence], rule: MatchingRule, candidates: int | None = None) -> float:
    """Return the cut with the best MOTA; of equal ones, the lowest; minus infinity without scores or objects.

    Branch and bound over the sorted scores: between two cuts there are at most as many matches as at the lower one
    and at least as many unmatched rows as at the higher one.

    Args:
        sequences: sequences that share no ids.
        rule: rule of the matching.
        candidates: number of scores, evenly spaced by rank, that are tried; None for all.
    """
    own = [np.unique(np.concatenate([*each.scores, np.zeros(0)])) for each in sequences]
    cuts = np.unique(np.concatenate([*own, np.zeros(0)]))
    objects = sum(int(frame.required.sum()) for each in sequences for frame in each.frames)
    if not len(cuts) or not objects:
        return -np.inf
    if candidates is not None:
        cuts = cuts[np.unique(np.linspace(0, len(cuts) - 1, candidates).round().astype(np.int64))]

    @cache
    def of_sequence(number: int, rank: int) -> ErrorCounts:
        values = own[number]
        minimum = float(values[rank]) if rank < len(values) else np.inf
        return count_errors(sequences[number].cut(minimum), rule)

    @cache
    def at(rank: int) -> ErrorCounts:
        parts = [of_sequence(i, int(np.searchsorted(values, cuts[rank]))) for i, values in enumerate(own)]
        return ErrorCounts(*np.sum([astuple(part) for part in parts], axis=0).tolist())

    best = min((0, len(cuts) - 1), key=lambda rank: at(rank).errors)
    spans = [(0, len(cuts) - 1)]
    while spans:
        low, high = spans.pop()
        bound = objects - at(low).matches + at(high).outputs - at(high).matches
        if high - low < 2 or bound >= at(best).errors:
            continue
        middle = (low + high) // 2
        best = min((best, middle), key=lambda rank: (at(rank).errors, rank))
        # The more promising half is searched first.
        spans += sorted([(low, middle), (middle, high)], key=lambda span: -at(span[0]).errors - at(span[1]).errors)[
            ::-1
        ]
    return float(cuts[best])
