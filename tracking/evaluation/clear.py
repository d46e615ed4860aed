"""CLEAR matching: frame by frame, keeping the pairs of earlier frames; definitions in `clear_id_hota`."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import linear_sum_assignment

from appocc.checks import FloatArray, IntArray
from tracking.evaluation.frames import DistanceFrame, MatchingRule

_NO_PAIR = 1e6


@dataclass(frozen=True, eq=False)
class IndexedFrame:
    """Required objects and remaining tracks of a frame, numbered from 0, with their distances (N, M)."""

    truth: IntArray
    track: IntArray
    distance: FloatArray


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
    kept, objects, _ = drop_ignored(frames, rule)
    clear = match_frames(kept, objects, rule)
    truths, outputs = sum(len(one.truth) for one in kept), sum(len(one.track) for one in kept)
    return ErrorCounts(truths, outputs, clear.matches, clear.switches)


def drop_ignored(frames: Sequence[DistanceFrame], rule: MatchingRule) -> tuple[list[IndexedFrame], int, int]:
    """Return the frames without what the protocol ignores, and their numbers of objects and tracks."""
    kept = []
    for one in frames:
        rows, columns = _pairs(one.distance, rule)
        keep = one.penalised.copy()
        keep[columns] = one.required[rows]
        kept.append((one.truth_ids[one.required], one.track_ids[keep], one.distance[one.required][:, keep]))
    return _numbered(kept)


def _numbered(kept: Sequence[tuple[IntArray, IntArray, FloatArray]]) -> tuple[list[IndexedFrame], int, int]:
    """Number the ids of frames (truth ids, track ids, distances) from 0; return the frames and the numbers of ids."""
    objects = np.unique(np.concatenate([truth for truth, _, _ in kept] or [np.zeros(0, np.int64)]))
    tracks = np.unique(np.concatenate([track for _, track, _ in kept] or [np.zeros(0, np.int64)]))
    frames = [
        IndexedFrame(np.searchsorted(objects, truth), np.searchsorted(tracks, track), distance)
        for truth, track, distance in kept
    ]
    return frames, len(objects), len(tracks)


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
    return match_frames(indexed, objects, rule)


def match_frames(frames: Sequence[IndexedFrame], objects: int, rule: MatchingRule) -> ClearCounts:
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


def _kept_pairs(frame: IndexedFrame, last: IntArray, rule: MatchingRule) -> list[tuple[int, int]]:
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
