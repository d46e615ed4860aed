"""How good tracks are: CLEAR (MOTA, MOTP), identity (IDF1) and HOTA on the ground plane.

Definitions, since names alone do not settle them:

- Pairs: a track can answer for an object within GATE_M of its centre in bird's-eye view, strictly.
- Ignored objects: every frame is matched against *all* ground truth first; tracks that fall to an ignored object are
  then dropped with it, and so are unmatched tracks that the protocol does not judge (beyond the range).
- CLEAR: a pair of an earlier frame is kept while it is possible; the rest is matched with the most pairs, then the
  least distance (motmetrics). A switch is counted when an object's track differs from the last one it had, at any
  distance in time. MOTP is the mean distance of pairs in metres: smaller is better. FRAG counts how often an object
  passes from tracked to missed and is tracked again later.
- HOTA: similarity 1 - distance / GATE_M, mean over the thresholds 0.05 .. 0.95 (TrackEval).

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
class Moment:
    """Ground truth and tracks of one key frame, on one ground plane.

    Attributes:
        truth_ids: (N,) whole numbers, one per object, the same over time.
        truth_xy_m: (N, 2) box centres.
        demanded: (N,) whether an object must be found; the others are ignored.
        track_ids: (M,) whole numbers.
        track_xy_m: (M, 2) track positions.
        judged: (M,) whether a track that matches nothing is a false positive.
    """

    truth_ids: IntArray
    truth_xy_m: FloatArray
    demanded: BoolArray
    track_ids: IntArray
    track_xy_m: FloatArray
    judged: BoolArray

    def __post_init__(self) -> None:
        """Check shapes.

        Raises:
            ShapeError: if one does not fit.
        """
        check_shape("moment truth_xy_m", self.truth_xy_m, (len(self.truth_ids), 2))
        check_shape("moment demanded", self.demanded, (len(self.truth_ids),))
        check_shape("moment track_xy_m", self.track_xy_m, (len(self.track_ids), 2))
        check_shape("moment judged", self.judged, (len(self.track_ids),))
        check_finite("moment truth_xy_m", self.truth_xy_m)
        check_finite("moment track_xy_m", self.track_xy_m)


@dataclass(frozen=True)
class Metrics:
    """Scores of a sequence; shares in 0..1, MOTP in metres, NaN where nothing was there to be measured."""

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
        """The scores by name; None instead of NaN, which JSON does not know."""
        return {name: None if value != value else value for name, value in asdict(self).items()}


@dataclass(frozen=True)
class _Frame:
    """What is left of a moment to be judged: objects and tracks numbered from 0, and their distances (N, M)."""

    truth: IntArray
    track: IntArray
    distance_m: FloatArray


def evaluate(moments: Sequence[Moment]) -> Metrics:
    """Score one sequence of key frames in order of time."""
    frames, objects, tracks = _judged_only(moments)
    clear = _clear(frames, objects)
    both = _together(frames, objects, tracks)
    idtp = _identity_matches(frames, both)
    truths, outputs = int(both.truths.sum()), int(both.outputs.sum())
    deta, assa, hota = _hota(frames, both)
    missed, false = truths - clear.matches, outputs - clear.matches
    return Metrics(
        MOTA=_share(truths - missed - false - clear.switches, truths),
        MOTP=_share(clear.distance_m, clear.matches),
        IDF1=_share(2 * idtp, truths + outputs),
        IDS=clear.switches,
        FRAG=sum(_fragments(hits) for hits in clear.hits.values()),
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
        MT=sum(10 * sum(hits) >= 8 * len(hits) for hits in clear.hits.values()),
        ML=sum(10 * sum(hits) < 2 * len(hits) for hits in clear.hits.values()),
    )


def _share(part: float, whole: float) -> float:
    return part / whole if whole else float("nan")


# Who is judged ----------------------------------------------------------------------------------------------------


def _pairs(distance_m: FloatArray) -> tuple[IntArray, IntArray]:
    """Rows and columns of the assignment with the most pairs within the gate, then the least distance."""
    possible = distance_m < GATE_M
    rows, columns = linear_sum_assignment(np.where(possible, distance_m, _NO_PAIR))
    keep = possible[rows, columns]
    return rows[keep], columns[keep]


def _judged_only(moments: Sequence[Moment]) -> tuple[list[_Frame], int, int]:
    """The frames without what the protocol ignores, and the number of objects and of tracks in them."""
    kept = []
    for moment in moments:
        distance = cdist(moment.truth_xy_m, moment.track_xy_m)
        rows, columns = _pairs(distance)
        stays = moment.judged.copy()
        stays[columns] = moment.demanded[rows]
        kept.append((moment.truth_ids[moment.demanded], moment.track_ids[stays], distance[moment.demanded][:, stays]))
    objects = np.unique(np.concatenate([truth for truth, _, _ in kept] or [np.zeros(0, np.int64)]))
    tracks = np.unique(np.concatenate([track for _, track, _ in kept] or [np.zeros(0, np.int64)]))
    frames = [
        _Frame(np.searchsorted(objects, truth), np.searchsorted(tracks, track), distance)
        for truth, track, distance in kept
    ]
    return frames, len(objects), len(tracks)


# CLEAR ------------------------------------------------------------------------------------------------------------


@dataclass
class _Clear:
    """Counts of the CLEAR matching; `hits` says for each object, frame by frame, whether it was matched."""

    matches: int = 0
    switches: int = 0
    distance_m: float = 0.0
    hits: defaultdict[int, list[bool]] = field(default_factory=lambda: defaultdict(list))


def _clear(frames: Sequence[_Frame], objects: int) -> _Clear:
    """Match frame by frame, holding on to earlier pairs, and count."""
    counts = _Clear()
    last = np.full(objects, -1)
    for frame in frames:
        distance = frame.distance_m.copy()
        pairs = _kept_pairs(frame, last)
        distance[[i for i, _ in pairs]] = np.inf
        distance[:, [j for _, j in pairs]] = np.inf
        pairs += zip(*(side.tolist() for side in _pairs(distance)), strict=True)
        for i, j in pairs:
            truth, track = frame.truth[i], frame.track[j]
            counts.switches += int(last[truth] not in (-1, track))
            counts.distance_m += float(frame.distance_m[i, j])
            last[truth] = track
        counts.matches += len(pairs)
        found = {i for i, _ in pairs}
        for i, truth in enumerate(frame.truth):
            counts.hits[int(truth)].append(i in found)
    return counts


def _kept_pairs(frame: _Frame, last: IntArray) -> list[tuple[int, int]]:
    """Rows and columns of objects that are still within the gate of the track they had last."""
    pairs: list[tuple[int, int]] = []
    taken: set[int] = set()
    for i, truth in enumerate(frame.truth):
        for j in np.flatnonzero(frame.track == last[truth]).tolist():
            if j not in taken and frame.distance_m[i, j] < GATE_M:
                pairs.append((i, j))
                taken.add(j)
    return pairs


def _fragments(hits: Sequence[bool]) -> int:
    """How often a run of matches ends and another one follows."""
    starts = sum(hit and not before for before, hit in zip([False, *hits], hits, strict=False))
    return max(starts - 1, 0)


# Identity and HOTA ------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Together:
    """How often each object (N,) and each track (M,) is there at all."""

    truths: FloatArray
    outputs: FloatArray


def _together(frames: Sequence[_Frame], objects: int, tracks: int) -> _Together:
    truths, outputs = np.zeros(objects), np.zeros(tracks)
    for frame in frames:
        truths[frame.truth] += 1
        outputs[frame.track] += 1
    return _Together(truths, outputs)


def _identity_matches(frames: Sequence[_Frame], both: _Together) -> int:
    """Frames in which an object is near the one track that is given to it for the whole sequence."""
    near = np.zeros((len(both.truths), len(both.outputs)))
    for frame in frames:
        near[np.ix_(frame.truth, frame.track)] += frame.distance_m < GATE_M
    rows, columns = linear_sum_assignment(near, maximize=True)
    return int(near[rows, columns].sum())


def _hota(frames: Sequence[_Frame], both: _Together) -> tuple[float, float, float]:
    """DetA, AssA and HOTA, each the mean over the thresholds (Luiten et al., IJCV 2021)."""
    if not both.truths.size:
        return float("nan"), float("nan"), float("nan")
    similar = [np.clip(1 - frame.distance_m / GATE_M, 0, 1) for frame in frames]
    alignment = _alignment(frames, similar, both)
    matches = np.zeros((len(_HOTA_THRESHOLDS), *alignment.shape))
    for frame, similarity in zip(frames, similar, strict=True):
        place = np.ix_(frame.truth, frame.track)
        rows, columns = linear_sum_assignment(alignment[place] * similarity, maximize=True)
        good = similarity[rows, columns] >= _HOTA_THRESHOLDS[:, None] - np.finfo(np.float64).eps
        matches[:, frame.truth[rows], frame.track[columns]] += good
    found = matches.sum(axis=(1, 2))
    det = found / (both.truths.sum() + both.outputs.sum() - found)
    share = matches / np.maximum(both.truths[:, None] + both.outputs - matches, 1)
    ass = (matches * share).sum(axis=(1, 2)) / np.maximum(found, 1)
    return float(det.mean()), float(ass.mean()), float(np.sqrt(det * ass).mean())


def _alignment(frames: Sequence[_Frame], similar: Sequence[FloatArray], both: _Together) -> FloatArray:
    """(N, M) how well each object and track go together over the whole sequence, before any matching."""
    potential = np.zeros((len(both.truths), len(both.outputs)))
    for frame, similarity in zip(frames, similar, strict=True):
        either = similarity.sum(axis=0) + similarity.sum(axis=1)[:, None] - similarity
        potential[np.ix_(frame.truth, frame.track)] += similarity / np.maximum(either, np.finfo(np.float64).tiny)
    return np.asarray(potential / (both.truths[:, None] + both.outputs - potential))
