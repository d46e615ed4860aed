"""How good tracks are: CLEAR (MOTA, MOTP), identity (IDF1) and HOTA, on the ground plane or in images.

Definitions, since names alone do not settle them:

- Pairs: a track can answer for an object within the gate: GATE_M between the centres in bird's-eye view, strictly;
  in images, boxes that overlap by half or more (`BY_OVERLAP`, where the distance is 1 - IoU).
- Ignored objects: every frame is matched against *all* ground truth first; tracks that fall to an ignored object are
  then dropped with it, and so are unmatched tracks that the protocol does not judge (beyond the range).
- CLEAR: a pair of an earlier frame is kept while it is possible; the rest is matched with the most pairs, then the
  least distance (motmetrics). A switch is counted when an object's track differs from the last one it had, at any
  distance in time. MOTP is the mean distance of pairs: smaller is better. FRAG counts how often an object passes from
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
class Rule:
    """How distances are judged, in whatever unit they are.

    Attributes:
        gate: a track can answer for an object that is nearer than this.
        zero: the distance from which on the two have nothing in common, for HOTA.
    """

    gate: float
    zero: float


# The distance is 1 - IoU; half of it is just within the gate.
BY_OVERLAP = Rule(float(np.nextafter(0.5, 1.0)), 1.0)


def by_centre(gate_m: float = GATE_M) -> Rule:
    """The rule for distances between centres in metres."""
    return Rule(gate_m, gate_m)


@dataclass(frozen=True)
class Compared:
    """Objects and tracks of one frame, by how far they are from each other.

    Attributes:
        truth_ids: (N,) whole numbers, one per object, the same over time.
        demanded: (N,) whether an object must be found; the others are ignored.
        track_ids: (M,) whole numbers.
        judged: (M,) whether a track that matches nothing is a false positive.
        distance: (N, M) in the unit of the rule.
    """

    truth_ids: IntArray
    demanded: BoolArray
    track_ids: IntArray
    judged: BoolArray
    distance: FloatArray

    def __post_init__(self) -> None:
        """Check shapes.

        Raises:
            ShapeError: if one does not fit or a distance is not finite.
        """
        n, m = len(self.truth_ids), len(self.track_ids)
        check_shape("compared demanded", self.demanded, (n,))
        check_shape("compared judged", self.judged, (m,))
        check_shape("compared distance", self.distance, (n, m))
        check_finite("compared distance", self.distance)

    def only(self, tracks: BoolArray) -> Compared:
        """The same with only the tracks of a mask (M,)."""
        chosen = self.track_ids[tracks], self.judged[tracks], self.distance[:, tracks]
        return Compared(self.truth_ids, self.demanded, *chosen)


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

    def compared(self) -> Compared:
        """The same by distances between centres in metres."""
        distance = cdist(self.truth_xy_m, self.track_xy_m)
        return Compared(self.truth_ids, self.demanded, self.track_ids, self.judged, distance)


@dataclass(frozen=True)
class Metrics:
    """Scores of a sequence; shares in 0..1, MOTP a distance, NaN where nothing was there to be measured."""

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
    distance: FloatArray


def evaluate(moments: Sequence[Moment], gate_m: float = GATE_M) -> Metrics:
    """Score one sequence of key frames in order of time, or several one after another that share no ids."""
    return evaluate_compared([moment.compared() for moment in moments], by_centre(gate_m))


def evaluate_compared(compared: Sequence[Compared], rule: Rule) -> Metrics:
    """The same for distances of any unit."""
    frames, objects, tracks = _judged_only(compared, rule)
    clear = _clear(frames, objects, rule)
    both = _together(frames, objects, tracks)
    idtp = _identity_matches(frames, both, rule)
    truths, outputs = int(both.truths.sum()), int(both.outputs.sum())
    deta, assa, hota = _hota(frames, both, rule)
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


# Who is judged ----------------------------------------------------------------------------------------------------


def _pairs(distance: FloatArray, rule: Rule) -> tuple[IntArray, IntArray]:
    """Rows and columns of the assignment with the most pairs within the gate, then the least distance."""
    possible = distance < rule.gate
    rows, columns = linear_sum_assignment(np.where(possible, distance, _NO_PAIR))
    keep = possible[rows, columns]
    return rows[keep], columns[keep]


def _judged_only(compared: Sequence[Compared], rule: Rule) -> tuple[list[_Frame], int, int]:
    """The frames without what the protocol ignores, and the number of objects and of tracks in them."""
    kept = []
    for one in compared:
        rows, columns = _pairs(one.distance, rule)
        stays = one.judged.copy()
        stays[columns] = one.demanded[rows]
        kept.append((one.truth_ids[one.demanded], one.track_ids[stays], one.distance[one.demanded][:, stays]))
    return _numbered(kept)


def _numbered(kept: Sequence[tuple[IntArray, IntArray, FloatArray]]) -> tuple[list[_Frame], int, int]:
    """Frames of truth ids, track ids and distances, with the ids numbered from 0; how many there are of either."""
    objects = np.unique(np.concatenate([truth for truth, _, _ in kept] or [np.zeros(0, np.int64)]))
    tracks = np.unique(np.concatenate([track for _, track, _ in kept] or [np.zeros(0, np.int64)]))
    frames = [
        _Frame(np.searchsorted(objects, truth), np.searchsorted(tracks, track), distance)
        for truth, track, distance in kept
    ]
    return frames, len(objects), len(tracks)


# CLEAR ------------------------------------------------------------------------------------------------------------


@dataclass
class Clear:
    """Counts of the CLEAR matching.

    Attributes:
        matches: pairs of an object and a track, switches among them.
        switches: pairs in which the object had another track before.
        distance: sum over the pairs.
        hits: for each object (by its row among all ids) whether it was matched, frame by frame.
        steady: for each frame the columns of the tracks whose pairs are no switches.
    """

    matches: int = 0
    switches: int = 0
    distance: float = 0.0
    hits: defaultdict[int, list[bool]] = field(default_factory=lambda: defaultdict(list))
    steady: list[list[int]] = field(default_factory=list)

    @property
    def fragments(self) -> int:
        """How often objects are lost and tracked again."""
        return sum(_fragments(hits) for hits in self.hits.values())

    @property
    def mostly_tracked(self) -> int:
        """Objects matched in at least 80 % of their frames."""
        return sum(10 * sum(hits) >= 8 * len(hits) for hits in self.hits.values())

    @property
    def mostly_lost(self) -> int:
        """Objects matched in less than 20 % of their frames."""
        return sum(10 * sum(hits) < 2 * len(hits) for hits in self.hits.values())


def clear_counts(compared: Sequence[Compared], rule: Rule) -> Clear:
    """The CLEAR matching alone, of frames in which everything is demanded and judged."""
    frames, objects, _ = _numbered([(one.truth_ids, one.track_ids, one.distance) for one in compared])
    return _clear(frames, objects, rule)


def _clear(frames: Sequence[_Frame], objects: int, rule: Rule) -> Clear:
    """Match frame by frame, holding on to earlier pairs, and count."""
    counts = Clear()
    last = np.full(objects, -1)
    for frame in frames:
        distance = frame.distance.copy()
        pairs = _kept_pairs(frame, last, rule)
        counts.steady.append([j for _, j in pairs])
        distance[[i for i, _ in pairs]] = np.inf
        distance[:, [j for _, j in pairs]] = np.inf
        for i, j in zip(*(side.tolist() for side in _pairs(distance, rule)), strict=True):
            truth, track = frame.truth[i], frame.track[j]
            switched = last[truth] not in (-1, track)
            counts.switches += int(switched)
            counts.steady[-1] += [] if switched else [j]
            last[truth] = track
            pairs.append((i, j))
        counts.distance += sum(float(frame.distance[i, j]) for i, j in pairs)
        counts.matches += len(pairs)
        found = {i for i, _ in pairs}
        for i, truth in enumerate(frame.truth):
            counts.hits[int(truth)].append(i in found)
    return counts


def _kept_pairs(frame: _Frame, last: IntArray, rule: Rule) -> list[tuple[int, int]]:
    """Rows and columns of objects that are still within the gate of the track they had last."""
    pairs: list[tuple[int, int]] = []
    taken: set[int] = set()
    for i, truth in enumerate(frame.truth):
        for j in np.flatnonzero(frame.track == last[truth]).tolist():
            if j not in taken and frame.distance[i, j] < rule.gate:
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


def _identity_matches(frames: Sequence[_Frame], both: _Together, rule: Rule) -> int:
    """Frames in which an object is near the one track that is given to it for the whole sequence."""
    near = np.zeros((len(both.truths), len(both.outputs)))
    for frame in frames:
        near[np.ix_(frame.truth, frame.track)] += frame.distance < rule.gate
    rows, columns = linear_sum_assignment(near, maximize=True)
    return int(near[rows, columns].sum())


def _hota(frames: Sequence[_Frame], both: _Together, rule: Rule) -> tuple[float, float, float]:
    """DetA, AssA and HOTA, each the mean over the thresholds (Luiten et al., IJCV 2021)."""
    if not both.truths.size:
        return float("nan"), float("nan"), float("nan")
    similar = [np.clip(1 - frame.distance / rule.zero, 0, 1) for frame in frames]
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
