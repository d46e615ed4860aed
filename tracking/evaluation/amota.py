"""AMOTA and AMOTP: nuScenes' tracking protocol (configuration `tracking_nips_2019`), one class on the ground plane.

Definitions, as the devkit computes them; where its text says otherwise, its code is followed:

- What is not demanded (beyond the range of the class, without LiDAR or RADAR points) and what is not judged (tracks
  beyond the range) is removed before anything is matched. `clear_id_hota.evaluate` ignores it instead.
- A track's score is the mean of the scores of its boxes.
- Gaps of objects and of tracks are filled at the key frames between. The devkit gives each neighbour the weight of
  the other, so that in a gap of several frames the places run backwards; published figures all have it, and so has
  this.
- Matching is that of CLEAR, within 2 m between centres, strictly, holding on to earlier pairs.
- 40 recalls from 0.1 to 1, evenly. All tracks are matched once; the scores of the pairs that are no switches, sorted,
  give the threshold for each recall. A recall that they do not reach has no threshold.
- At each threshold only boxes that score as much are matched, anew, and
  MOTAR = max(0, 1 - (IDS + FP + FN - (1 - r) P) / (r P)), with P objects and r the share of them in pairs that are
  no switches; that comes to 1 - FP / (r P).
- AMOTA is the mean of MOTAR over the recalls, 0 where one is not reached; AMOTP the mean of the mean distance of
  pairs, 2 m where one is not reached.
- All other figures are those at the threshold with the best MOTA (at least 0), the one of highest recall if several
  are as good. FRAG as in `clear_id_hota`; FAF is false positives in a hundred key frames with boxes; TID and LGD
  are the time until an object is first found and its longest gap, mean over the objects found, at 2 key frames a
  second.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import groupby, pairwise

import numpy as np

from appocc.checks import BoolArray, FloatArray, IntArray, check_finite, check_shape
from tracking.evaluation.clear_id_hota import GATE_M, Clear, Compared, Moment, by_centre, clear_counts

RECALLS = np.linspace(0.1, 1.0, 40).round(12)
_WORST_MOTP_M, _WORST_FAF, _WORST_S = 2.0, 500.0, 20.0
_KEY_FRAME_S = 0.5


@dataclass(frozen=True)
class ScoredMoment:
    """A key frame whose tracks have scores.

    Attributes:
        timestamp_us: its time.
        moment: objects and tracks.
        scores: (M,) of the tracks, in any unit: higher is surer.
    """

    timestamp_us: int
    moment: Moment
    scores: FloatArray

    def __post_init__(self) -> None:
        """Check shapes.

        Raises:
            ShapeError: if one does not fit.
        """
        check_shape("moment scores", self.scores, (len(self.moment.track_ids),))
        check_finite("moment scores", self.scores)


@dataclass(frozen=True)
class AtThreshold:
    """nuScenes' figures at one threshold, by their names there; TP are pairs that are no switches.

    Counts are not numbers (NaN) if no recall was reached.
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
        """The figures by name; None instead of NaN, which JSON does not know."""
        return {name: None if value != value else value for name, value in asdict(self).items()}


@dataclass(frozen=True)
class Amota:
    """What nuScenes' protocol says of tracks.

    Attributes:
        AMOTA: mean MOTAR, 0..1; NaN without objects.
        AMOTP: mean MOTP in metres.
        threshold: score of the tracks' boxes from which MOTA is best; NaN if no recall was reached.
        best: figures at that threshold; None without objects.
        at_recalls: the same for each of `RECALLS`, from the highest; None where one was not reached.
    """

    AMOTA: float
    AMOTP: float
    threshold: float
    best: AtThreshold | None
    at_recalls: tuple[AtThreshold | None, ...]


def amota(moments: Sequence[ScoredMoment], gate_m: float = GATE_M) -> Amota:
    """Score the key frames of one class, in order of time; several scenes follow each other and share no ids."""
    filled = fill(moments)
    compared = [one.moment.compared() for one in filled]
    objects = [len(one.truth_ids) for one in compared]
    if not sum(objects):
        return Amota(float("nan"), float("nan"), float("nan"), None, (None,) * len(RECALLS))
    thresholds = _thresholds(filled, compared, gate_m)
    reached = np.unique(thresholds[~np.isnan(thresholds)]).tolist()
    if not reached:
        names = {name for one in filled for name in one.moment.truth_ids.tolist()}
        return Amota(0.0, _WORST_MOTP_M, float("nan"), _worst(sum(objects), len(names)), (None,) * len(RECALLS))
    figures = {value: _figures(filled, compared, value, gate_m) for value in reached}
    at = tuple(figures.get(value) for value in thresholds.tolist())
    motar = np.array([one.MOTAR if one else 0.0 for one in at])
    motp = np.array([one.MOTP if one else _WORST_MOTP_M for one in at])
    # `reached` rises in score and so falls in recall: of equals the first has the highest.
    best = max(reached, key=lambda value: figures[value].MOTA)
    return Amota(float(motar.mean()), float(motp.mean()), best, figures[best], at)


def cut(moments: Sequence[ScoredMoment], threshold: float) -> list[Moment]:
    """The key frames with only the tracks' boxes that score at least so much."""
    return [_chosen(one, np.ones(len(one.moment.truth_ids), np.bool_), one.scores >= threshold) for one in moments]


def _chosen(one: ScoredMoment, truths: BoolArray, tracks: BoolArray) -> Moment:
    """The objects and tracks of two masks (N,) and (M,)."""
    m = one.moment
    chosen = (m.truth_ids[truths], m.truth_xy_m[truths], m.demanded[truths])
    return Moment(*chosen, m.track_ids[tracks], m.track_xy_m[tracks], m.judged[tracks])


# Whose boxes, and with which scores --------------------------------------------------------------------------------


def fill(moments: Sequence[ScoredMoment]) -> list[ScoredMoment]:
    """The key frames as the protocol judges them: what it removes is gone, scores are means, gaps are filled."""
    kept = [
        ScoredMoment(
            one.timestamp_us, _chosen(one, one.moment.demanded, one.moment.judged), one.scores[one.moment.judged]
        )
        for one in moments
    ]
    times = [one.timestamp_us for one in kept]
    truths = _filled(
        times,
        [one.moment.truth_ids for one in kept],
        [np.column_stack([one.moment.truth_xy_m, np.zeros(len(one.moment.truth_ids))]) for one in kept],
    )
    means = _means(kept)
    tracks = _filled(
        times,
        [one.moment.track_ids for one in kept],
        [
            np.column_stack([one.moment.track_xy_m, [means[name] for name in one.moment.track_ids.tolist()]])
            for one in kept
        ],
    )
    result = []
    for time_us, (truth_ids, truth_rows), (track_ids, track_rows) in zip(times, truths, tracks, strict=True):
        all_of = [np.ones(len(ids), dtype=np.bool_) for ids in (truth_ids, track_ids)]
        moment = Moment(truth_ids, truth_rows[:, :2], all_of[0], track_ids, track_rows[:, :2], all_of[1])
        result.append(ScoredMoment(time_us, moment, track_rows[:, 2]))
    return result


def _means(moments: Sequence[ScoredMoment]) -> dict[int, float]:
    """The mean score of each track."""
    scores: dict[int, list[float]] = {}
    for one in moments:
        for name, score in zip(one.moment.track_ids.tolist(), one.scores.tolist(), strict=True):
            scores.setdefault(name, []).append(score)
    return {name: float(np.mean(values)) for name, values in scores.items()}


def _filled(
    times_us: Sequence[int], ids: Sequence[IntArray], rows: Sequence[FloatArray]
) -> list[tuple[IntArray, FloatArray]]:
    """Ids (N,) and rows (N, 3) of each key frame, with those added that are there before and after."""
    seen: dict[int, list[tuple[int, FloatArray]]] = {}
    for frame, (names, values) in enumerate(zip(ids, rows, strict=True)):
        for name, row in zip(names.tolist(), values, strict=True):
            seen.setdefault(name, []).append((frame, row))
    added: list[list[tuple[int, FloatArray]]] = [[] for _ in times_us]
    for name, places in seen.items():
        for (left, before), (right, after) in pairwise(places):
            for frame in range(left + 1, right):
                # The weights that the devkit gives; it also lets the scores pass through them.
                share = float(times_us[right] - times_us[frame]) / (times_us[right] - times_us[left])
                added[frame].append((name, (1.0 - share) * before + share * after))
    return [
        (
            np.concatenate([names, np.array([name for name, _ in more], dtype=np.int64)]),
            np.concatenate([values, np.array([row for _, row in more]).reshape(-1, 3)]),
        )
        for names, values, more in zip(ids, rows, added, strict=True)
    ]


# Figures at the thresholds ----------------------------------------------------------------------------------------


def _thresholds(filled: Sequence[ScoredMoment], compared: Sequence[Compared], gate_m: float) -> FloatArray:
    """(40,) for the recalls from the highest, rising; NaN where one is not reached."""
    steady = clear_counts(compared, by_centre(gate_m)).steady
    scores = np.sort(np.concatenate([one.scores[pairs] for one, pairs in zip(filled, steady, strict=True)]))[::-1]
    if not len(scores):
        return np.full(len(RECALLS), np.nan)
    reached = np.arange(1, len(scores) + 1) / sum(len(one.truth_ids) for one in compared)
    thresholds = np.where(reached[-1] >= RECALLS, np.interp(RECALLS, reached, scores), np.nan)
    return np.asarray(thresholds[::-1])


def _figures(
    filled: Sequence[ScoredMoment], compared: Sequence[Compared], threshold: float, gate_m: float
) -> AtThreshold:
    """All figures of the boxes from a threshold."""
    left = [one.only(scored.scores >= threshold) for one, scored in zip(compared, filled, strict=True)]
    clear = clear_counts(left, by_centre(gate_m))
    objects, boxes = (
        sum(map(len, ids)) for ids in zip(*((one.truth_ids, one.track_ids) for one in left), strict=True)
    )
    frames = sum(bool(len(one.truth_ids) or len(one.track_ids)) for one in left)
    false, missed, steady = boxes - clear.matches, objects - clear.matches, clear.matches - clear.switches
    first, gap = _durations_s(clear)
    return AtThreshold(
        MOTAR=max(0.0, 1 - false / steady) if steady else 0.0,
        MOTA=max(0.0, 1 - (missed + clear.switches + false) / objects),
        MOTP=clear.distance / clear.matches if clear.matches else _WORST_MOTP_M,
        recall=clear.matches / objects,
        GT=objects,
        TP=steady,
        FP=false,
        FN=missed,
        IDS=clear.switches,
        FRAG=clear.fragments,
        MT=clear.mostly_tracked,
        ML=clear.mostly_lost,
        FAF=100 * false / frames,
        TID_s=first,
        LGD_s=gap,
    )


def _durations_s(clear: Clear) -> tuple[float, float]:
    """Time until objects are first found, and longest time that they are not, mean over those that are ever found."""
    found = [hits for hits in clear.hits.values() if any(hits)]
    if not found:
        return _WORST_S, _WORST_S
    first = sum(hits.index(True) for hits in found)
    longest = sum(max((len(list(run)) for hit, run in groupby(hits) if not hit), default=0) for hits in found)
    return _KEY_FRAME_S * first / len(found), _KEY_FRAME_S * longest / len(found)


def _worst(boxes: int, objects: int) -> AtThreshold:
    """What the protocol says where no recall is reached."""
    unknown = float("nan")
    none = dict.fromkeys(("MOTAR", "MOTA", "recall", "TP", "MT"), 0.0)
    counts = dict.fromkeys(("FP", "IDS", "FRAG"), unknown)
    rest = {"MOTP": _WORST_MOTP_M, "GT": boxes, "FN": boxes, "ML": objects, "FAF": _WORST_FAF}
    return AtThreshold(**none, **counts, **rest, TID_s=_WORST_S, LGD_s=_WORST_S)
