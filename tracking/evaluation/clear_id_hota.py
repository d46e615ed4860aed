"""Tracking metrics CLEAR (MOTA, MOTP), identity (IDF1) and HOTA, on the ground plane or in images.

Definitions:

- Gate: a track can match an object if their centres are closer than GATE_M in bird's-eye view, or if their image
  boxes have an IoU of 0.5 or more (`IOU_RULE`, where the distance is 1 - IoU).
- Ignored objects: every frame is first matched against *all* ground truth; tracks matched to an ignored object are
  then removed with it, and so are unmatched tracks that the protocol does not penalise (beyond the range).
- CLEAR: pairs of earlier frames are kept while they are within the gate; the rest is matched with the most pairs,
  then the smallest distance (motmetrics). A switch is counted if an object's track differs from its last one, at any
  distance in time. MOTP is the mean distance of pairs: smaller is better. FRAG counts how often an object goes from
  tracked to missed and is tracked again later.
- HOTA: similarity 1 - distance / gate on the ground, IoU in images; mean over thresholds 0.05 .. 0.95 (TrackEval).

MT and ML count objects matched in at least 80 % and in less than 20 % of their frames.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field, fields
from functools import reduce

import numpy as np
from scipy.optimize import linear_sum_assignment

from appocc.checks import FloatArray
from tracking.evaluation.clear import IndexedFrame, drop_ignored, match_frames
from tracking.evaluation.frames import GATE_M, DistanceFrame, EvaluationFrame, MatchingRule, centre_distance_rule

_HOTA_THRESHOLDS = np.arange(1, 20) * 0.05


@dataclass(frozen=True, kw_only=True)
class Metrics:
    """Scores of a sequence; fractions are 0..1, MOTP is a distance, and undefined values are NaN."""

    MOTA: float
    MOTP: float
    IDF1: float
    IDS: int
    FRAG: int
    HOTA: float
    DetA: float
    AssA: float
    IDP: float
    IDR: float
    recall: float
    precision: float
    GT: int
    FP: int
    FN: int
    MT: int
    ML: int

    def as_json(self) -> dict[str, float | int | None]:
        """Return the scores by name, with None for NaN, which JSON lacks."""
        return {name: None if value != value else value for name, value in asdict(self).items()}


@dataclass(frozen=True, eq=False, kw_only=True)
class MetricCounts:
    """What the metrics are computed from; counts of recordings, which share no ids, can be added.

    Attributes:
        truths: number of required objects over all frames.
        outputs: number of tracks over all frames, without ignored ones.
        matches: number of pairs, including switches.
        distance: sum of the distances of all pairs.
        switches: number of identity switches.
        fragments: number of times that objects are lost and tracked again.
        mostly_tracked: number of objects matched in at least 80 % of their frames.
        mostly_lost: number of objects matched in less than 20 % of their frames.
        identity_matches: matched frames under the best one-to-one assignment of objects and tracks (IDTP).
        found: (19,) number of pairs at the thresholds of HOTA.
        association: (19,) sum of their association scores.
    """

    truths: int = 0
    outputs: int = 0
    matches: int = 0
    distance: float = 0.0
    switches: int = 0
    fragments: int = 0
    mostly_tracked: int = 0
    mostly_lost: int = 0
    identity_matches: int = 0
    found: FloatArray = field(default_factory=lambda: np.zeros(len(_HOTA_THRESHOLDS)))
    association: FloatArray = field(default_factory=lambda: np.zeros(len(_HOTA_THRESHOLDS)))

    def plus(self, other: MetricCounts) -> MetricCounts:
        """Return the sum of both counts."""
        names = [each.name for each in fields(self)]
        return MetricCounts(**{name: getattr(self, name) + getattr(other, name) for name in names})

    def metrics(self) -> Metrics:
        """Return the metrics."""
        missed, false = self.truths - self.matches, self.outputs - self.matches
        deta, assa, hota = self._hota()
        return Metrics(
            MOTA=_share(self.truths - missed - false - self.switches, self.truths),
            MOTP=_share(self.distance, self.matches),
            IDF1=_share(2 * self.identity_matches, self.truths + self.outputs),
            IDS=self.switches,
            FRAG=self.fragments,
            HOTA=hota,
            DetA=deta,
            AssA=assa,
            IDP=_share(self.identity_matches, self.outputs),
            IDR=_share(self.identity_matches, self.truths),
            recall=_share(self.matches, self.truths),
            precision=_share(self.matches, self.outputs),
            GT=self.truths,
            FP=false,
            FN=missed,
            MT=self.mostly_tracked,
            ML=self.mostly_lost,
        )

    def _hota(self) -> tuple[float, float, float]:
        """Return DetA, AssA and HOTA, each the mean over the thresholds (Luiten et al., IJCV 2021)."""
        if not self.truths:
            return float("nan"), float("nan"), float("nan")
        det = self.found / (self.truths + self.outputs - self.found)
        ass = self.association / np.maximum(self.found, 1)
        return float(det.mean()), float(ass.mean()), float(np.sqrt(det * ass).mean())


def evaluate(frames: Sequence[EvaluationFrame], gate_m: float = GATE_M) -> Metrics:
    """Score a sequence of key frames in temporal order, or several in a row that share no ids."""
    return count(frames, gate_m).metrics()


def count(frames: Sequence[EvaluationFrame], gate_m: float = GATE_M) -> MetricCounts:
    """Count what the metrics of key frames are computed from, see `evaluate`."""
    return _count([frame.with_distances() for frame in frames], centre_distance_rule(gate_m))


def evaluate_distances(frames: Sequence[DistanceFrame], rule: MatchingRule) -> Metrics:
    """Score a sequence of frames with distances of any unit, see `evaluate`."""
    return _count(frames, rule).metrics()


def _count(frames: Sequence[DistanceFrame], rule: MatchingRule) -> MetricCounts:
    """Add the counts of parts that share no ids: tables of all objects and tracks would not fit into memory."""
    return reduce(MetricCounts.plus, (_count_part(part, rule) for part in _parts(frames)), MetricCounts())


def _parts(frames: Sequence[DistanceFrame]) -> Iterator[Sequence[DistanceFrame]]:
    """Yield the shortest runs of frames that share no ids with others."""
    last: dict[tuple[bool, int], int] = {}
    ids = [
        {*((True, i) for i in frame.truth_ids.tolist()), *((False, i) for i in frame.track_ids.tolist())}
        for frame in frames
    ]
    for number, own in enumerate(ids):
        last.update(dict.fromkeys(own, number))
    start = end = 0
    for number, own in enumerate(ids):
        end = max([end, *(last[each] for each in own)])
        if end <= number:
            yield frames[start : number + 1]
            start = end = number + 1


def _count_part(frames: Sequence[DistanceFrame], rule: MatchingRule) -> MetricCounts:
    kept, objects, tracks = drop_ignored(frames, rule)
    clear = match_frames(kept, objects, rule)
    numbers = _count_frames(kept, objects, tracks)
    found, association = _hota_sums(kept, numbers, rule)
    return MetricCounts(
        truths=int(numbers.truths.sum()),
        outputs=int(numbers.outputs.sum()),
        matches=clear.matches,
        distance=clear.distance,
        switches=clear.switches,
        fragments=clear.fragments,
        mostly_tracked=clear.mostly_tracked,
        mostly_lost=clear.mostly_lost,
        identity_matches=_identity_matches(kept, numbers, rule),
        found=found,
        association=association,
    )


def _share(part: float, whole: float) -> float:
    return part / whole if whole else float("nan")


@dataclass(frozen=True, eq=False)
class _FrameCounts:
    """Number of frames of each object (N,) and each track (M,)."""

    truths: FloatArray
    outputs: FloatArray


def _count_frames(frames: Sequence[IndexedFrame], objects: int, tracks: int) -> _FrameCounts:
    truths, outputs = np.zeros(objects), np.zeros(tracks)
    for frame in frames:
        truths[frame.truth] += 1
        outputs[frame.track] += 1
    return _FrameCounts(truths, outputs)


def _identity_matches(frames: Sequence[IndexedFrame], counts: _FrameCounts, rule: MatchingRule) -> int:
    """Return the number of matched frames under the best one-to-one assignment of objects and tracks (IDTP)."""
    near = np.zeros((len(counts.truths), len(counts.outputs)))
    for frame in frames:
        near[np.ix_(frame.truth, frame.track)] += frame.distance < rule.gate
    rows, columns = linear_sum_assignment(near, maximize=True)
    return int(near[rows, columns].sum())


def _hota_sums(
    frames: Sequence[IndexedFrame], counts: _FrameCounts, rule: MatchingRule
) -> tuple[FloatArray, FloatArray]:
    """Return the number (19,) of pairs at each threshold of HOTA and the sum (19,) of their association scores."""
    similar = [np.clip(1 - frame.distance / rule.zero, 0, 1) for frame in frames]
    alignment = _alignment(frames, similar, counts)
    matches = np.zeros((len(_HOTA_THRESHOLDS), *alignment.shape))
    for frame, similarity in zip(frames, similar, strict=True):
        place = np.ix_(frame.truth, frame.track)
        rows, columns = linear_sum_assignment(alignment[place] * similarity, maximize=True)
        good = similarity[rows, columns] >= _HOTA_THRESHOLDS[:, None] - np.finfo(np.float64).eps
        matches[:, frame.truth[rows], frame.track[columns]] += good
    share = matches / np.maximum(counts.truths[:, None] + counts.outputs - matches, 1)
    return matches.sum(axis=(1, 2)), (matches * share).sum(axis=(1, 2))


def _alignment(frames: Sequence[IndexedFrame], similar: Sequence[FloatArray], counts: _FrameCounts) -> FloatArray:
    """Return the global alignment score (N, M) of each object and track over the whole sequence."""
    potential = np.zeros((len(counts.truths), len(counts.outputs)))
    for frame, similarity in zip(frames, similar, strict=True):
        either = similarity.sum(axis=0) + similarity.sum(axis=1)[:, None] - similarity
        potential[np.ix_(frame.truth, frame.track)] += similarity / np.maximum(either, np.finfo(np.float64).tiny)
    return np.asarray(potential / (counts.truths[:, None] + counts.outputs - potential))
