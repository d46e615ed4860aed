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

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from appocc.checks import BoolArray, FloatArray, IntArray, check_finite, check_shape

GATE_M = 2.0
_HOTA_THRESHOLDS = np.arange(1, 20) * 0.05
_NO_PAIR = 1e6


@dataclass(frozen=True)
class MatchingRule:
    """Matching rule for distances of one unit.

    Attributes:
        gate: distance below which a track can match an object.
        zero: distance at which the similarity of HOTA is zero.
    """

    gate: float
    zero: float


# The distance is 1 - IoU; an IoU of 0.5 is inside the gate.
IOU_RULE = MatchingRule(float(np.nextafter(0.5, 1.0)), 1.0)


def centre_distance_rule(gate_m: float = GATE_M) -> MatchingRule:
    """Return the rule for distances between centres in metres."""
    return MatchingRule(gate_m, gate_m)


@dataclass(frozen=True, eq=False)
class DistanceFrame:
    """Objects and tracks of one frame with their distances.

    Attributes:
        truth_ids: (N,) integers, one per object, constant over time.
        required: (N,) whether an object must be tracked; the others are ignored.
        track_ids: (M,) integers.
        penalised: (M,) whether the track is a false positive if unmatched.
        distance: (N, M) distances in the unit of the rule.
    """

    truth_ids: IntArray
    required: BoolArray
    track_ids: IntArray
    penalised: BoolArray
    distance: FloatArray

    def __post_init__(self) -> None:
        """Check shapes.

        Raises:
            ShapeError: if a shape differs or a distance is not finite.
        """
        n, m = len(self.truth_ids), len(self.track_ids)
        check_shape("frame required", self.required, (n,))
        check_shape("frame penalised", self.penalised, (m,))
        check_shape("frame distance", self.distance, (n, m))
        check_finite("frame distance", self.distance)

    def select_tracks(self, tracks: BoolArray) -> DistanceFrame:
        """Return the frame with the tracks of a mask (M,)."""
        chosen = self.track_ids[tracks], self.penalised[tracks], self.distance[:, tracks]
        return DistanceFrame(self.truth_ids, self.required, *chosen)


@dataclass(frozen=True, eq=False)
class EvaluationFrame:
    """Ground truth and tracks of one key frame, on one ground plane.

    Attributes:
        truth_ids: (N,) integers, one per object, constant over time.
        truth_xy_m: (N, 2) box centres.
        required: (N,) whether an object must be tracked; the others are ignored.
        track_ids: (M,) integers.
        track_xy_m: (M, 2) track positions.
        penalised: (M,) whether the track is a false positive if unmatched.
    """

    truth_ids: IntArray
    truth_xy_m: FloatArray
    required: BoolArray
    track_ids: IntArray
    track_xy_m: FloatArray
    penalised: BoolArray

    def __post_init__(self) -> None:
        """Check shapes.

        Raises:
            ShapeError: if a shape differs or a position is not finite.
        """
        check_shape("frame truth_xy_m", self.truth_xy_m, (len(self.truth_ids), 2))
        check_shape("frame required", self.required, (len(self.truth_ids),))
        check_shape("frame track_xy_m", self.track_xy_m, (len(self.track_ids), 2))
        check_shape("frame penalised", self.penalised, (len(self.track_ids),))
        check_finite("frame truth_xy_m", self.truth_xy_m)
        check_finite("frame track_xy_m", self.track_xy_m)

    def with_distances(self) -> DistanceFrame:
        """Return the frame with distances between centres in metres."""
        distance = cdist(self.truth_xy_m, self.track_xy_m)
        return DistanceFrame(self.truth_ids, self.required, self.track_ids, self.penalised, distance)


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


@dataclass(frozen=True, eq=False)
class _IndexedFrame:
    """Required objects and remaining tracks of a frame, numbered from 0, with their distances (N, M)."""

    truth: IntArray
    track: IntArray
    distance: FloatArray


def evaluate(frames: Sequence[EvaluationFrame], gate_m: float = GATE_M) -> Metrics:
    """Score a sequence of key frames in temporal order, or several in a row that share no ids."""
    return evaluate_distances([frame.with_distances() for frame in frames], centre_distance_rule(gate_m))


def evaluate_distances(frames: Sequence[DistanceFrame], rule: MatchingRule) -> Metrics:
    """Score a sequence of frames with distances of any unit, see `evaluate`."""
    kept, objects, tracks = _drop_ignored(frames, rule)
    clear = _clear(kept, objects, rule)
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


# Ignored objects --------------------------------------------------------------------------------------------------


def _pairs(distance: FloatArray, rule: MatchingRule) -> tuple[IntArray, IntArray]:
    """Return rows and columns of the assignment with the most pairs within the gate, then the smallest distance."""
    possible = distance < rule.gate
    rows, columns = possible.nonzero()
    if len(set(rows.tolist())) == len(set(columns.tolist())) == len(rows):  # no conflicts
        return rows, columns
    rows, columns = np.unique(rows), np.unique(columns)
    near = np.ix_(rows, columns)
    i, j = linear_sum_assignment(np.where(possible[near], distance[near], _NO_PAIR))
    keep = possible[near][i, j]
    return rows[i[keep]], columns[j[keep]]


@dataclass(frozen=True)
class ErrorCounts:
    """What MOTA counts.

    Attributes:
        objects: number of required objects over all frames.
        outputs: number of tracks over all frames, without ignored ones.
        matches: number of pairs, including switches.
        switches: number of identity switches.
    """

    objects: int
    outputs: int
    matches: int
    switches: int

    @property
    def errors(self) -> int:
        """Number of misses, false positives and switches."""
        return self.objects + self.outputs - 2 * self.matches + self.switches


def count_errors(frames: Sequence[DistanceFrame], rule: MatchingRule) -> ErrorCounts:
    """Count the errors of a sequence of frames, see `evaluate`; faster than all metrics."""
    kept, objects, _ = _drop_ignored(frames, rule)
    clear = _clear(kept, objects, rule)
    truths, outputs = sum(len(one.truth) for one in kept), sum(len(one.track) for one in kept)
    return ErrorCounts(truths, outputs, clear.matches, clear.switches)


def _drop_ignored(frames: Sequence[DistanceFrame], rule: MatchingRule) -> tuple[list[_IndexedFrame], int, int]:
    """Return the frames without what the protocol ignores, and their numbers of objects and tracks."""
    kept = []
    for one in frames:
        rows, columns = _pairs(one.distance, rule)
        keep = one.penalised.copy()
        keep[columns] = one.required[rows]
        kept.append((one.truth_ids[one.required], one.track_ids[keep], one.distance[one.required][:, keep]))
    return _numbered(kept)


def _numbered(kept: Sequence[tuple[IntArray, IntArray, FloatArray]]) -> tuple[list[_IndexedFrame], int, int]:
    """Number the ids of frames (truth ids, track ids, distances) from 0; return the frames and the numbers of ids."""
    objects = np.unique(np.concatenate([truth for truth, _, _ in kept] or [np.zeros(0, np.int64)]))
    tracks = np.unique(np.concatenate([track for _, track, _ in kept] or [np.zeros(0, np.int64)]))
    frames = [
        _IndexedFrame(np.searchsorted(objects, truth), np.searchsorted(tracks, track), distance)
        for truth, track, distance in kept
    ]
    return frames, len(objects), len(tracks)


# CLEAR ------------------------------------------------------------------------------------------------------------


@dataclass
class ClearCounts:
    """Counts of the CLEAR matching.

    Attributes:
        matches: number of pairs, including switches.
        switches: number of pairs whose object had another track before.
        distance: sum of the distances of all pairs.
        hits: for each object (by its index among all ids), whether it is matched in each of its frames.
        non_switches: for each frame, the columns of the tracks in pairs that are not switches.
    """

    matches: int = 0
    switches: int = 0
    distance: float = 0.0
    hits: defaultdict[int, list[bool]] = field(default_factory=lambda: defaultdict(list))
    non_switches: list[list[int]] = field(default_factory=list)

    @property
    def fragments(self) -> int:
        """Number of times that objects are lost and tracked again."""
        return sum(_fragments(hits) for hits in self.hits.values())

    @property
    def mostly_tracked(self) -> int:
        """Number of objects matched in at least 80 % of their frames."""
        return sum(10 * sum(hits) >= 8 * len(hits) for hits in self.hits.values())

    @property
    def mostly_lost(self) -> int:
        """Number of objects matched in less than 20 % of their frames."""
        return sum(10 * sum(hits) < 2 * len(hits) for hits in self.hits.values())


def clear_counts(frames: Sequence[DistanceFrame], rule: MatchingRule) -> ClearCounts:
    """Return the CLEAR counts of frames in which all objects are required and all tracks penalised."""
    indexed, objects, _ = _numbered([(one.truth_ids, one.track_ids, one.distance) for one in frames])
    return _clear(indexed, objects, rule)


def _clear(frames: Sequence[_IndexedFrame], objects: int, rule: MatchingRule) -> ClearCounts:
    """Match frame by frame, keeping earlier pairs, and count."""
    counts = ClearCounts()
    last = np.full(objects, -1)
    for frame in frames:
        distance = frame.distance.copy()
        pairs = _kept_pairs(frame, last, rule)
        counts.non_switches.append([j for _, j in pairs])
        distance[[i for i, _ in pairs]] = np.inf
        distance[:, [j for _, j in pairs]] = np.inf
        for i, j in zip(*(side.tolist() for side in _pairs(distance, rule)), strict=True):
            truth, track = frame.truth[i], frame.track[j]
            switched = last[truth] not in (-1, track)
            counts.switches += int(switched)
            counts.non_switches[-1] += [] if switched else [j]
            last[truth] = track
            pairs.append((i, j))
        counts.distance += sum(float(frame.distance[i, j]) for i, j in pairs)
        counts.matches += len(pairs)
        found = {i for i, _ in pairs}
        for i, truth in enumerate(frame.truth):
            counts.hits[int(truth)].append(i in found)
    return counts


def _kept_pairs(frame: _IndexedFrame, last: IntArray, rule: MatchingRule) -> list[tuple[int, int]]:
    """Return rows and columns of objects that are still within the gate of their last track."""
    pairs: list[tuple[int, int]] = []
    column = {track: j for j, track in enumerate(frame.track.tolist())}
    for i, track in enumerate(last[frame.truth].tolist()):
        # An object that comes later finds the column of a track taken, if both had it.
        j = column.get(track)
        if j is not None and frame.distance[i, j] < rule.gate:
            pairs.append((i, j))
            del column[track]
    return pairs


def _fragments(hits: Sequence[bool]) -> int:
    """Return how often a run of matches ends and another one follows."""
    starts = sum(hit and not before for before, hit in zip([False, *hits], hits, strict=False))
    return max(starts - 1, 0)


# Identity and HOTA ------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _FrameCounts:
    """Number of frames of each object (N,) and each track (M,)."""

    truths: FloatArray
    outputs: FloatArray


def _count_frames(frames: Sequence[_IndexedFrame], objects: int, tracks: int) -> _FrameCounts:
    truths, outputs = np.zeros(objects), np.zeros(tracks)
    for frame in frames:
        truths[frame.truth] += 1
        outputs[frame.track] += 1
    return _FrameCounts(truths, outputs)


def _identity_matches(frames: Sequence[_IndexedFrame], counts: _FrameCounts, rule: MatchingRule) -> int:
    """Return the number of matched frames under the best one-to-one assignment of objects and tracks (IDTP)."""
    near = np.zeros((len(counts.truths), len(counts.outputs)))
    for frame in frames:
        near[np.ix_(frame.truth, frame.track)] += frame.distance < rule.gate
    rows, columns = linear_sum_assignment(near, maximize=True)
    return int(near[rows, columns].sum())


def _hota(frames: Sequence[_IndexedFrame], counts: _FrameCounts, rule: MatchingRule) -> tuple[float, float, float]:
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


def _alignment(frames: Sequence[_IndexedFrame], similar: Sequence[FloatArray], counts: _FrameCounts) -> FloatArray:
    """Return the global alignment score (N, M) of each object and track over the whole sequence."""
    potential = np.zeros((len(counts.truths), len(counts.outputs)))
    for frame, similarity in zip(frames, similar, strict=True):
        either = similarity.sum(axis=0) + similarity.sum(axis=1)[:, None] - similarity
        potential[np.ix_(frame.truth, frame.track)] += similarity / np.maximum(either, np.finfo(np.float64).tiny)
    return np.asarray(potential / (counts.truths[:, None] + counts.outputs - potential))
