"""AMOTA and AMOTP: nuScenes' tracking protocol (configuration `tracking_nips_2019`), one class on the ground plane.

Definitions follow the devkit's code, where it differs from its documentation:

- Objects that are not required (beyond the range of the class, without LiDAR and RADAR points) and tracks that are
  not penalised (beyond the range) are removed before matching. `clear_id_hota.evaluate` ignores them instead.
- A track's score is the mean of the scores of its boxes.
- Gaps of objects and of tracks are interpolated at the key frames between. The devkit swaps the weights of the two
  neighbours, so that positions run backwards in gaps of several frames; published results include this, and so does
  this module.
- Matching is that of CLEAR, with centres closer than 2 m, keeping earlier pairs.
- There are 40 recalls from 0.1 to 1. All tracks are matched once; the sorted scores of pairs that are not switches
  give the score threshold of each recall. Recalls that are not reached have no threshold.
- At each threshold, boxes of at least that score are matched again, and
  MOTAR = max(0, 1 - (IDS + FP + FN - (1 - r) P) / (r P)), with P objects and r the fraction of them in pairs that are
  not switches; this equals 1 - FP / (r P).
- AMOTA is the mean of MOTAR over the recalls, 0 for those not reached; AMOTP is the mean of the mean distance of
  pairs, 2 m for recalls not reached.
- All other metrics are those at the threshold with the best MOTA (at least 0); of equal ones, the highest recall.
  FRAG as in `clear_id_hota`; FAF is the number of false positives per hundred key frames with boxes; TID and LGD are
  the time until an object is first tracked and its longest gap, averaged over tracked objects, at 2 key frames per
  second.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import groupby, pairwise

import numpy as np

from appocc.checks import BoolArray, FloatArray, IntArray, check_finite, check_shape
from tracking.evaluation.clear import ClearCounts, clear_counts
from tracking.evaluation.frames import GATE_M, DistanceFrame, EvaluationFrame, centre_distance_rule

RECALLS = np.linspace(0.1, 1.0, 40).round(12)
_WORST_MOTP_M, _WORST_FAF, _WORST_S = 2.0, 500.0, 20.0
_KEY_FRAME_S = 0.5


@dataclass(frozen=True, eq=False)
class ScoredFrame:
    """A key frame with scored tracks.

    Attributes:
        timestamp_us: time of the key frame.
        frame: objects and tracks.
        scores: (M,) scores of the tracks, in any unit; higher is more confident.
    """

    timestamp_us: int
    frame: EvaluationFrame
    scores: FloatArray

    def __post_init__(self) -> None:
        """Check shapes.

        Raises:
            ShapeError: if a shape differs or a score is not finite.
        """
        check_shape("frame scores", self.scores, (len(self.frame.track_ids),))
        check_finite("frame scores", self.scores)


@dataclass(frozen=True, kw_only=True)
class ThresholdMetrics:
    """nuScenes' metrics at one threshold, under their names there; TP are pairs that are not switches.

    Counts are NaN if no recall is reached.
    """

    MOTAR: float
    MOTA: float
    MOTP: float
    recall: float
    GT: float
    TP: float
    FP: float
    FN: float
    IDS: float
    FRAG: float
    MT: float
    ML: float
    FAF: float
    TID_s: float
    LGD_s: float

    def as_json(self) -> dict[str, float | None]:
        """Return the metrics by name, with None for NaN, which JSON lacks."""
        return {name: None if value != value else value for name, value in asdict(self).items()}


@dataclass(frozen=True)
class AmotaResult:
    """Result of nuScenes' protocol.

    Attributes:
        AMOTA: mean MOTAR, 0..1; NaN without objects.
        AMOTP: mean MOTP in metres.
        threshold: score threshold with the best MOTA; NaN if no recall is reached.
        best: metrics at that threshold; None without objects.
        by_recall: metrics for each of `RECALLS`, from the highest; None if it is not reached.
    """

    AMOTA: float
    AMOTP: float
    threshold: float
    best: ThresholdMetrics | None
    by_recall: tuple[ThresholdMetrics | None, ...]


def evaluate_amota(frames: Sequence[ScoredFrame], gate_m: float = GATE_M) -> AmotaResult:
    """Evaluate the key frames of one class in temporal order; several scenes in a row share no ids."""
    prepared = prepare_frames(frames)
    distances = [one.frame.with_distances() for one in prepared]
    objects = [len(one.truth_ids) for one in distances]
    if not sum(objects):
        return AmotaResult(float("nan"), float("nan"), float("nan"), None, (None,) * len(RECALLS))
    thresholds = _thresholds(prepared, distances, gate_m)
    reached = np.unique(thresholds[~np.isnan(thresholds)]).tolist()
    if not reached:
        names = {name for one in prepared for name in one.frame.truth_ids.tolist()}
        return AmotaResult(0.0, _WORST_MOTP_M, float("nan"), _worst(sum(objects), len(names)), (None,) * len(RECALLS))
    metrics = {value: _threshold_metrics(prepared, distances, value, gate_m) for value in reached}
    by_recall = tuple(metrics.get(value) for value in thresholds.tolist())
    motar = np.array([one.MOTAR if one else 0.0 for one in by_recall])
    motp = np.array([one.MOTP if one else _WORST_MOTP_M for one in by_recall])
    # `reached` ascends in score and so descends in recall: the first of equal ones has the highest recall.
    best = max(reached, key=lambda value: metrics[value].MOTA)
    return AmotaResult(float(motar.mean()), float(motp.mean()), best, metrics[best], by_recall)


def filter_by_score(frames: Sequence[ScoredFrame], threshold: float) -> list[EvaluationFrame]:
    """Return the key frames with the tracks whose score is at least a threshold."""
    return [_select(one, np.ones(len(one.frame.truth_ids), np.bool_), one.scores >= threshold) for one in frames]


def _select(one: ScoredFrame, truths: BoolArray, tracks: BoolArray) -> EvaluationFrame:
    """Return the objects and tracks of masks (N,) and (M,)."""
    frame = one.frame
    chosen = (frame.truth_ids[truths], frame.truth_xy_m[truths], frame.required[truths])
    return EvaluationFrame(*chosen, frame.track_ids[tracks], frame.track_xy_m[tracks], frame.penalised[tracks])


# Removal, track scores and interpolation --------------------------------------------------------------------------


def prepare_frames(frames: Sequence[ScoredFrame]) -> list[ScoredFrame]:
    """Return the key frames as evaluated: without ignored boxes, with mean scores and interpolated gaps."""
    kept = [
        ScoredFrame(
            one.timestamp_us, _select(one, one.frame.required, one.frame.penalised), one.scores[one.frame.penalised]
        )
        for one in frames
    ]
    times = [one.timestamp_us for one in kept]
    truths = _interpolate(
        times,
        [one.frame.truth_ids for one in kept],
        [np.column_stack([one.frame.truth_xy_m, np.zeros(len(one.frame.truth_ids))]) for one in kept],
    )
    means = _mean_scores(kept)
    tracks = _interpolate(
        times,
        [one.frame.track_ids for one in kept],
        [
            np.column_stack([one.frame.track_xy_m, [means[name] for name in one.frame.track_ids.tolist()]])
            for one in kept
        ],
    )
    result = []
    for time_us, (truth_ids, truth_rows), (track_ids, track_rows) in zip(times, truths, tracks, strict=True):
        all_true = [np.ones(len(ids), dtype=np.bool_) for ids in (truth_ids, track_ids)]
        frame = EvaluationFrame(truth_ids, truth_rows[:, :2], all_true[0], track_ids, track_rows[:, :2], all_true[1])
        result.append(ScoredFrame(time_us, frame, track_rows[:, 2]))
    return result


def _mean_scores(frames: Sequence[ScoredFrame]) -> dict[int, float]:
    """Return the mean score of each track."""
    scores: dict[int, list[float]] = {}
    for one in frames:
        for name, score in zip(one.frame.track_ids.tolist(), one.scores.tolist(), strict=True):
            scores.setdefault(name, []).append(score)
    return {name: float(np.mean(values)) for name, values in scores.items()}


def _interpolate(
    times_us: Sequence[int], ids: Sequence[IntArray], rows: Sequence[FloatArray]
) -> list[tuple[IntArray, FloatArray]]:
    """Interpolate the ids (N,) and rows (N, 3) of each key frame in the gaps of each id."""
    seen: dict[int, list[tuple[int, FloatArray]]] = {}
    for frame, (names, values) in enumerate(zip(ids, rows, strict=True)):
        for name, row in zip(names.tolist(), values, strict=True):
            seen.setdefault(name, []).append((frame, row))
    added: list[list[tuple[int, FloatArray]]] = [[] for _ in times_us]
    for name, places in seen.items():
        for (left, before), (right, after) in pairwise(places):
            for frame in range(left + 1, right):
                # The devkit's swapped weights, which it also applies to the scores.
                share = float(times_us[right] - times_us[frame]) / (times_us[right] - times_us[left])
                added[frame].append((name, (1.0 - share) * before + share * after))
    return [
        (
            np.concatenate([names, np.array([name for name, _ in more], dtype=np.int64)]),
            np.concatenate([values, np.array([row for _, row in more]).reshape(-1, 3)]),
        )
        for names, values, more in zip(ids, rows, added, strict=True)
    ]


# Metrics at the thresholds ----------------------------------------------------------------------------------------


def _thresholds(frames: Sequence[ScoredFrame], distances: Sequence[DistanceFrame], gate_m: float) -> FloatArray:
    """Return the thresholds (40,) of the recalls from the highest, ascending; NaN if a recall is not reached."""
    non_switches = clear_counts(distances, centre_distance_rule(gate_m)).non_switches
    paired = [one.scores[columns] for one, columns in zip(frames, non_switches, strict=True)]
    scores = np.sort(np.concatenate(paired))[::-1]
    if not len(scores):
        return np.full(len(RECALLS), np.nan)
    reached = np.arange(1, len(scores) + 1) / sum(len(one.truth_ids) for one in distances)
    thresholds = np.where(reached[-1] >= RECALLS, np.interp(RECALLS, reached, scores), np.nan)
    return np.asarray(thresholds[::-1])


def _threshold_metrics(
    frames: Sequence[ScoredFrame], distances: Sequence[DistanceFrame], threshold: float, gate_m: float
) -> ThresholdMetrics:
    """Return the metrics of the boxes whose score is at least a threshold."""
    kept = [one.select_tracks(scored.scores >= threshold) for one, scored in zip(distances, frames, strict=True)]
    clear = clear_counts(kept, centre_distance_rule(gate_m))
    objects, boxes = (
        sum(map(len, ids)) for ids in zip(*((one.truth_ids, one.track_ids) for one in kept), strict=True)
    )
    non_empty = sum(bool(len(one.truth_ids) or len(one.track_ids)) for one in kept)
    false, missed, true = boxes - clear.matches, objects - clear.matches, clear.matches - clear.switches
    first, gap = _durations_s(clear)
    return ThresholdMetrics(
        MOTAR=max(0.0, 1 - false / true) if true else 0.0,
        MOTA=max(0.0, 1 - (missed + clear.switches + false) / objects),
        MOTP=clear.distance / clear.matches if clear.matches else _WORST_MOTP_M,
        recall=clear.matches / objects,
        GT=objects,
        TP=true,
        FP=false,
        FN=missed,
        IDS=clear.switches,
        FRAG=clear.fragments,
        MT=clear.mostly_tracked,
        ML=clear.mostly_lost,
        FAF=100 * false / non_empty,
        TID_s=first,
        LGD_s=gap,
    )


def _durations_s(clear: ClearCounts) -> tuple[float, float]:
    """Return the time until first tracked and the longest gap, averaged over all tracked objects."""
    found = [hits for hits in clear.hits.values() if any(hits)]
    if not found:
        return _WORST_S, _WORST_S
    first = sum(hits.index(True) for hits in found)
    longest = sum(max((len(list(run)) for hit, run in groupby(hits) if not hit), default=0) for hits in found)
    return _KEY_FRAME_S * first / len(found), _KEY_FRAME_S * longest / len(found)


def _worst(boxes: int, objects: int) -> ThresholdMetrics:
    """Return the protocol's values if no recall is reached."""
    unknown = float("nan")
    none = dict.fromkeys(("MOTAR", "MOTA", "recall", "TP", "MT"), 0.0)
    counts = dict.fromkeys(("FP", "IDS", "FRAG"), unknown)
    rest = {"MOTP": _WORST_MOTP_M, "GT": boxes, "FN": boxes, "ML": objects, "FAF": _WORST_FAF}
    return ThresholdMetrics(**none, **counts, **rest, TID_s=_WORST_S, LGD_s=_WORST_S)
