"""Which detection belongs to which track: place, heading, size and colour as likelihoods, matched as a whole."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from appocc.checks import BoolArray, FloatArray, IntArray
from tracking.filtering.kalman import bend, determinant_of, squared

_UNIT = np.eye(2)
_FEW = 5000
# A sighting whose heading is farther off than this tells of no turn.
_MOST_TURN_RAD = 1.0
# How much likelier, as a cost, it must be that a vehicle turned than that it went straight on.
_TURN_COST = 2.0


@dataclass(frozen=True)
class AssociationConfig:
    """What pairs of tracks and detections are possible, and what they cost.

    Attributes:
        gate_m: distance that is always possible.
        gate_squared: beyond it, so far by Mahalanobis' squared distance to the prediction ...
        gate_mps: ... but never more than `gate_m` and this far for each second since the track was seen,
        gate_most_m: nor more than this.
        heading_rad: standard deviation of a heading from one sighting to the next; front and rear are not told apart.
        heading_cap: most that it may cost, in squared standard deviations; 0 leaves it out.
        size: standard deviation of the logarithm of length and width, taken together.
        size_cap: likewise.
        stray_mps: how much faster or slower than thought they may have gone, to any side.
        cost_most: what it costs to leave both alone: a vehicle gone and a new one. No pair may cost more.
    """

    gate_m: float = 2.0
    gate_squared: float = 7.0
    gate_mps: float = 12.0
    gate_most_m: float = 6.0
    heading_rad: float = 0.3
    heading_cap: float = 9.0
    size: float = 0.3
    size_cap: float = 0.0
    stray_mps: float = 0.0
    cost_most: float = 7.0

    def reach_m(self, unseen_s: FloatArray) -> FloatArray:
        """(N,) how far tracks may be from what is seen of them, after times unseen (N,)."""
        return np.maximum(np.minimum(self.gate_m + self.gate_mps * unseen_s, self.gate_most_m), self.gate_m)


class Predicted(NamedTuple):
    """What N tracks expect to be seen.

    Attributes:
        xy_m: (N, 2) places.
        cov_m2: (N, 2, 2) how well they are known.
        yaw_rad: (N,) headings.
        size_m: (N, 2) width and length.
        lab: (N, 3) colours, NaN where unknown.
        lab_variance: (N, 3) of a sighting's colour about it.
        kind: (N,) numbers of categories.
        unseen_s: (N,) time since they were seen.
        way_m: (N, 2) how far they went since then, if straight on.
    """

    xy_m: FloatArray
    cov_m2: FloatArray
    yaw_rad: FloatArray
    size_m: FloatArray
    lab: FloatArray
    lab_variance: FloatArray
    kind: IntArray
    unseen_s: FloatArray
    way_m: FloatArray

    def of(self, rows: IntArray) -> Predicted:
        """Some of them (M,)."""
        return type(self)._make([each.take(rows, axis=0) for each in self])


class Seen(NamedTuple):
    """What M detections show, in the frame of the tracks.

    Attributes:
        xy_m: (M, 2) places.
        noise_m2: (M, 2, 2) how well they are known.
        yaw_rad: (M,) headings.
        size_m: (M, 2) width and length.
        lab: (M, 3) colours, NaN where unknown.
        frequency: (M,) of such colours among vehicles, see `tracking.association.paint.paint_density`.
        kind: (M,) numbers of categories.
    """

    xy_m: FloatArray
    noise_m2: FloatArray
    yaw_rad: FloatArray
    size_m: FloatArray
    lab: FloatArray
    frequency: FloatArray
    kind: IntArray

    def of(self, columns: IntArray) -> Seen:
        """Some of them (K,)."""
        return type(self)._make([each.take(columns, axis=0) for each in self])


class Pairs(NamedTuple):
    """P possible pairs of a track and a detection.

    Attributes:
        rows: (P,) numbers of tracks.
        columns: (P,) numbers of detections.
        noise_m2: (P, 2, 2) how well the detection's place is known, if it is that track.
        turn_rad: (P,) by how much the track turned on the way, if it is that track; 0 if it went straight on.
        cost: (P,) of taking it for that track, less that of leaving both alone; colours not counted.
        alike: (P,) how much likelier their colours are, if it is that track than if it is any; NaN if unknown.
    """

    rows: IntArray
    columns: IntArray
    noise_m2: FloatArray
    turn_rad: FloatArray
    cost: FloatArray
    alike: FloatArray

    def of(self, numbers: IntArray) -> Pairs:
        """Some of them (K,)."""
        return type(self)._make([each.take(numbers, axis=0) for each in self])


NONE = Pairs(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 2, 2)), np.zeros(0), np.zeros(0), np.zeros(0))


def possible(tracks: Predicted, seen: Seen, rows: IntArray, columns: IntArray, config: AssociationConfig) -> Pairs:
    """Those of some pairs of tracks and detections, by number (P,), (P,), that are of one kind and within the gates.

    How far a track reaches (`reach_m`) is left to who looks for pairs. The cost of a pair is its negative log
    likelihood, doubled: of the place given the prediction, straight on or around a bend, and of heading and size
    given the track's, each bounded, for it may be seen wrongly.
    """
    same = tracks.kind[rows] == seen.kind[columns]
    rows, columns = rows[same], columns[same]
    track, sight = tracks.of(rows), seen.of(columns)
    noise_m2 = noise_of(track, sight)
    cov = track.cov_m2 + noise_m2
    if config.stray_mps:
        cov = cov + ((config.stray_mps * track.unseen_s) ** 2)[:, None, None] * _UNIT
    turn_rad = _turn_of(track, sight)
    (ahead, left), (way_x, way_y) = bend(turn_rad), track.way_m.T
    x, y = (sight.xy_m - track.xy_m).T
    bent_x, bent_y = x - ahead * way_x + left * way_y, y - left * way_x - ahead * way_y
    straight_far, bent_far = squared(x, y, cov), squared(bent_x, bent_y, cov)
    turns = bent_far + _TURN_COST < straight_far
    far = np.where(turns, bent_far, straight_far)
    away_m = np.where(turns, np.hypot(bent_x, bent_y), np.hypot(x, y))
    near_enough = (far <= config.gate_squared) | (away_m <= config.gate_m)
    cost = far + np.log(determinant_of(cov)) + _unlike(track, sight, config) - config.cost_most
    return Pairs(rows, columns, noise_m2, turn_rad * turns, cost, _alike(track, sight)).of(near_enough.nonzero()[0])


def _turn_of(track: Predicted, sight: Seen) -> FloatArray:
    """(P,) turns from the headings of tracks to those of sightings, front or rear; 0 where they are too far off."""
    turn_rad = sight.yaw_rad - track.yaw_rad
    turn_rad -= np.pi * np.rint(turn_rad / np.pi)
    return turn_rad * (np.abs(turn_rad) <= _MOST_TURN_RAD)


def noise_of(track: Predicted, sight: Seen) -> FloatArray:
    """(P, 2, 2) covariances of the places of sightings, if each is that track.

    Where a sighting is longer than the vehicle it merges with another, where it is shorter a part is missing: the
    vehicle lies anywhere within the difference (a uniform distribution: its square over 12).
    """
    surplus_m = sight.size_m[:, 1] - track.size_m[:, 1]
    return np.asarray(sight.noise_m2 + (surplus_m**2 / 12)[:, None, None] * _UNIT)


def near(one: FloatArray, other: FloatArray, reach_m: FloatArray) -> tuple[IntArray, IntArray]:
    """All pairs (P,), (P,) of points (N, 2) and (M, 2) that are no farther apart than those of the N reach (N,).

    They are in order of the N. A search in order of x finds those near along x, of which few are near along y; of few
    points all pairs are looked at.
    """
    if len(one) * len(other) <= _FEW:
        inside = cdist(one, other, "sqeuclidean") <= (reach_m * reach_m)[:, None]
        (places,) = inside.reshape(-1).nonzero()  # of a row this is faster than of a table
        rows = places // len(other)
        return rows, places - rows * len(other)
    order = other[:, 0].argsort(kind="stable")
    x, y = other[order].T
    first = x.searchsorted(one[:, 0] - reach_m)
    count = x.searchsorted(one[:, 0] + reach_m, side="right") - first
    rows = np.arange(len(one)).repeat(count)
    places = np.arange(len(rows)) + (first + count - count.cumsum()).repeat(count)
    beside = np.abs(y[places] - one[:, 1].repeat(count)) <= reach_m.repeat(count)
    rows, columns = rows[beside], order[places[beside]]
    offset = other[columns] - one[rows]
    inside = np.hypot(offset[:, 0], offset[:, 1]) <= reach_m[rows]
    return rows[inside], columns[inside]


def _unlike(track: Predicted, sight: Seen, config: AssociationConfig) -> FloatArray:
    """(P,) what differences in heading and size cost."""
    cost = np.zeros(len(track.xy_m))
    if config.heading_cap:
        turn = np.abs(np.sin(track.yaw_rad - sight.yaw_rad)) / config.heading_rad
        cost += np.minimum(turn**2, config.heading_cap)
    if config.size_cap:
        growth = np.abs(np.log(track.size_m / sight.size_m)).sum(axis=1) / config.size
        cost += np.minimum(growth**2, config.size_cap)
    return cost


def _alike(track: Predicted, sight: Seen) -> FloatArray:
    """(P,) how much likelier the colours of sightings are, if they are those tracks than if they are any vehicle."""
    far = ((track.lab - sight.lab) ** 2 / track.lab_variance).sum(axis=1)
    return np.asarray(np.exp(-far / 2) / np.sqrt(track.lab_variance.prod(axis=1)) / sight.frequency)


def matched(pairs: Pairs) -> Pairs:
    """Those of pairs that make the assignment with the least cost; none that costs more than leaving both alone.

    Groups that share neither a track nor a detection are solved one by one.
    """
    (worth,) = (pairs.cost < 0).nonzero()
    if not len(worth):
        return NONE
    rows, columns, cost = pairs.rows[worth], pairs.columns[worth], pairs.cost[worth]
    of_row, of_column = np.bincount(rows)[rows], np.bincount(columns)[columns]
    if ((of_row == 1) & (of_column == 1)).all():  # nobody has a choice
        return pairs.of(worth)
    group = _groups(rows, columns)
    size = np.bincount(group)[group]
    # Where all pairs of a group have one row or one column in common, it takes the cheapest of them.
    plain = (of_row == size) | (of_column == size)
    order = np.lexsort((cost, group))
    chosen = np.zeros(len(rows), np.bool_)
    chosen[order[_begins(group[order])]] = True
    chosen &= plain
    if not plain.all():
        rest = order[~plain[order]]
        chosen[rest] = _solved(group[rest], rows[rest], columns[rest], cost[rest])
    return pairs.of(worth[chosen])


def _groups(rows: IntArray, columns: IntArray) -> IntArray:
    """(P,) the lowest row that each pair is linked with, over pairs that have a row or a column in common."""
    lowest, count = np.arange(rows.max() + 1), columns.max() + 1
    while True:
        of_columns = np.full(count, len(lowest))
        np.minimum.at(of_columns, columns, lowest[rows])
        lower = lowest.copy()
        np.minimum.at(lower, rows, of_columns[columns])
        lower = lower[lower]  # a long chain takes few rounds: the row found may know a lower one already
        if (lower == lowest).all():
            return lowest[rows]
        lowest = lower


def _solved(group: IntArray, rows: IntArray, columns: IntArray, cost: FloatArray) -> BoolArray:
    """(P,) which pairs are taken, in order of their groups."""
    # Numbers that run on from group to group, so that those of one group have no gaps.
    i = np.unique(group * (rows.max() + 1) + rows, return_inverse=True)[1]
    j = np.unique(group * (columns.max() + 1) + columns, return_inverse=True)[1]
    mates = np.full(int(i.max()) + 1, -1)
    starts = np.flatnonzero(_begins(group))
    corners = [edge.reduceat(each, starts).tolist() for each in (i, j) for edge in (np.minimum, np.maximum)]
    for start, end, top, bottom, left, right in zip(starts, [*starts[1:], len(group)], *corners, strict=True):
        table = np.zeros((bottom - top + 1, right - left + 1))  # whoever is left alone costs nothing
        table[i[start:end] - top, j[start:end] - left] = cost[start:end]
        own, other = linear_sum_assignment(table)
        mates[top + own] = left + other
    return np.asarray(mates[i] == j)


def _begins(group: IntArray) -> BoolArray:
    """(P,) whether a pair is the first of its group, in order of groups."""
    return np.concatenate([[True], group[1:] != group[:-1]])
