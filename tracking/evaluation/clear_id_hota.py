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

from collections.abc import Sequence
from dataclasses import asdict, dataclass

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


def evaluate(frames: Sequence[EvaluationFrame], gate_m: float = GATE_M) -> Metrics:
    """Score a sequence of key frames in temporal order, or several in a row that share no ids."""
    return evaluate_distances([frame.with_distances() for frame in frames], centre_distance_rule(gate_m))


def evaluate_distances(frames: Sequence[DistanceFrame], rule: MatchingRule) -> Metrics:
    """Score a sequence of frames with distances of any unit, see `evaluate`."""
    kept, objects, tracks = drop_ignored(frames, rule)
    clear = match_frames(kept, objects, rule)
    counts = _count_frames(kept, objects, tracks)
    idtp = _identity_matches(kept, counts, rule)
    truths, outputs = int(counts.truths.sum()), int(counts.outputs.sum())
    deta, assa, hota = _hota(kept, counts, rule)
    missed, false = truths - clear.matches, outputs - clear.matches
    return Metrics(
        MOTA=_share(truths - missed - false - clear.switches, truths),
        MOTP=_share(clear.distance, clear.matches),
        IDF1=_share(2 * idtp, truths + outputs),
        IDS=clear.switches,
        FRAG=clear.fragments,
        HOTA=hota,
        DetA=deta,
        AssA=assa,
        IDP=_share(idtp, outputs),
        IDR=_share(idtp, truths),
        recall=_share(clear.matches, truths),
        precision=_share(clear.matches, outputs),
        GT=truths,
        FP=false,
        FN=missed,
        MT=clear.mostly_tracked,
        ML=clear.mostly_lost,
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


def _hota(frames: Sequence[IndexedFrame], counts: _FrameCounts, rule: MatchingRule) -> tuple[float, float, float]:
    """Return DetA, AssA and HOTA, each the mean over the thresholds (Luiten et al., IJCV 2021)."""
    if not counts.truths.size:
        return float("nan"), float("nan"), float("nan")
    similar = [np.clip(1 - frame.distance / rule.zero, 0, 1) for frame in frames]
    alignment = _alignment(frames, similar, counts)
    matches = np.zeros((len(_HOTA_THRESHOLDS), *alignment.shape))
    for frame, similarity in zip(frames, similar, strict=True):
        place = np.ix_(frame.truth, frame.track)
        rows, columns = linear_sum_assignment(alignment[place] * similarity, maximize=True)
        good = similarity[rows, columns] >= _HOTA_THRESHOLDS[:, None] - np.finfo(np.float64).eps
        matches[:, frame.truth[rows], frame.track[columns]] += good
    found = matches.sum(axis=(1, 2))
    det = found / (counts.truths.sum() + counts.outputs.sum() - found)
    share = matches / np.maximum(counts.truths[:, None] + counts.outputs - matches, 1)
    ass = (matches * share).sum(axis=(1, 2)) / np.maximum(found, 1)
    return float(det.mean()), float(ass.mean()), float(np.sqrt(det * ass).mean())


def _alignment(frames: Sequence[IndexedFrame], similar: Sequence[FloatArray], counts: _FrameCounts) -> FloatArray:
    """Return the global alignment score (N, M) of each object and track over the whole sequence."""
    potential = np.zeros((len(counts.truths), len(counts.outputs)))
    for frame, similarity in zip(frames, similar, strict=True):
        either = similarity.sum(axis=0) + similarity.sum(axis=1)[:, None] - similarity
        potential[np.ix_(frame.truth, frame.track)] += similarity / np.maximum(either, np.finfo(np.float64).tiny)
    return np.asarray(potential / (counts.truths[:, None] + counts.outputs - potential))
