"""Which detection belongs to which track: place, heading and colour, weighed as likelihoods, matched as a whole."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from appocc.checks import FloatArray, IntArray
from tracking.motion import determinant_of, squared

_FORBIDDEN = 1e6


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
        colour_cap: most that a difference in colour may cost: a shadow must not break a track. 0 leaves colour out.
    """

    gate_m: float = 2.0
    gate_squared: float = 7.0
    gate_mps: float = 12.0
    gate_most_m: float = 6.0
    heading_rad: float = 0.3
    heading_cap: float = 9.0
    size: float = 0.3
    size_cap: float = 0.0
    colour_cap: float = 9.0


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
    """

    xy_m: FloatArray
    cov_m2: FloatArray
    yaw_rad: FloatArray
    size_m: FloatArray
    lab: FloatArray
    lab_variance: FloatArray
    kind: IntArray
    unseen_s: FloatArray

    def of(self, rows: IntArray) -> Predicted:
        """Some of them (M,)."""
        return type(self)._make(each[rows] for each in self)


class Seen(NamedTuple):
    """What M detections show, in the frame of the tracks.

    Attributes:
        xy_m: (M, 2) places.
        noise_m2: (M, 2, 2) how well they are known.
        yaw_rad: (M,) headings.
        size_m: (M, 2) width and length.
        lab: (M, 3) colours, NaN where unknown.
        kind: (M,) numbers of categories.
    """

    xy_m: FloatArray
    noise_m2: FloatArray
    yaw_rad: FloatArray
    size_m: FloatArray
    lab: FloatArray
    kind: IntArray

    def of(self, columns: IntArray) -> Seen:
        """Some of them (K,)."""
        return type(self)._make(each[columns] for each in self)


def associate(tracks: Predicted, seen: Seen, config: AssociationConfig) -> tuple[IntArray, IntArray]:
    """Rows and columns of the assignment with the most pairs within the gates, then the least cost.

    The cost of a pair is its negative log likelihood, doubled: of the place given the prediction, and of the heading,
    size and colour given the track's, each capped, for it may be seen wrongly; a place cannot.
    """
    reach_m = np.minimum(config.gate_m + config.gate_mps * tracks.unseen_s, config.gate_most_m)
    rows, columns = _near(tracks.xy_m, seen.xy_m, float(reach_m.max(initial=0.0)))
    alike = tracks.kind[rows] == seen.kind[columns]
    rows, columns = rows[alike], columns[alike]
    track, sight = tracks.of(rows), seen.of(columns)
    offset, cov = sight.xy_m - track.xy_m, track.cov_m2 + noise_of(track, sight)
    far, apart_m = squared(offset, cov), np.hypot(*offset.T)
    possible = ((far <= config.gate_squared) & (apart_m <= reach_m[rows])) | (apart_m <= config.gate_m)
    cost = far + np.log(determinant_of(cov)) + _unlike(track, sight, config)
    return _matched(rows[possible], columns[possible], cost[possible])


def noise_of(track: Predicted, sight: Seen) -> FloatArray:
    """(P, 2, 2) covariances of the places of sightings, if each is that track.

    Where a sighting is longer than the vehicle it merges with another, where it is shorter a part is missing: the
    vehicle lies anywhere within the difference (a uniform distribution: its square over 12).
    """
    surplus_m = sight.size_m[:, 1] - track.size_m[:, 1]
    return np.asarray(sight.noise_m2 + (surplus_m**2 / 12)[:, None, None] * np.eye(2))


def _near(one: FloatArray, other: FloatArray, within_m: float) -> tuple[IntArray, IntArray]:
    """All pairs (P,), (P,) of points (N, 2) and (M, 2) that are not farther apart."""
    if not len(one) or not len(other):
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    pairs = KDTree(one).sparse_distance_matrix(KDTree(other), within_m, output_type="coo_matrix")
    return np.asarray(pairs.row, np.int64), np.asarray(pairs.col, np.int64)


def _unlike(track: Predicted, sight: Seen, config: AssociationConfig) -> FloatArray:
    """(P,) what differences in heading, size and colour cost."""
    cost = np.zeros(len(track.xy_m))
    if config.heading_cap:
        turn = np.abs(np.sin(track.yaw_rad - sight.yaw_rad)) / config.heading_rad
        cost += np.minimum(turn**2, config.heading_cap)
    if config.size_cap:
        growth = np.abs(np.log(track.size_m / sight.size_m)).sum(axis=1) / config.size
        cost += np.minimum(growth**2, config.size_cap)
    if config.colour_cap:
        strange = ((track.lab - sight.lab) ** 2 / track.lab_variance).sum(axis=1)
        strange = np.where(np.isfinite(strange), strange, config.colour_cap / 2)
        cost += np.minimum(strange, config.colour_cap)
    return cost


def _matched(rows: IntArray, columns: IntArray, cost: FloatArray) -> tuple[IntArray, IntArray]:
    """The best assignment among possible pairs (P,); groups that share no pair are solved one by one."""
    if not len(rows):
        return rows, columns
    n, m = int(rows.max()) + 1, int(columns.max()) + 1
    links = coo_matrix((np.ones(len(rows)), (rows, n + columns)), shape=(n + m, n + m))
    group = connected_components(links, directed=False)[1][rows]
    chosen = np.bincount(group)[group] == 1  # with no other choice there is nothing to solve
    shared = np.flatnonzero(~chosen)
    shared = shared[np.argsort(group[shared], kind="stable")]
    for part in np.split(shared, np.flatnonzero(np.diff(group[shared])) + 1) if len(shared) else ():
        chosen[part[_solved(rows[part], columns[part], cost[part])]] = True
    order = np.flatnonzero(chosen)
    order = order[np.argsort(rows[order], kind="stable")]
    return rows[order], columns[order]


def _solved(rows: IntArray, columns: IntArray, cost: FloatArray) -> IntArray:
    """Which of the pairs of one group are taken."""
    own_rows, i = np.unique(rows, return_inverse=True)
    own_columns, j = np.unique(columns, return_inverse=True)
    table = np.full((len(own_rows), len(own_columns)), _FORBIDDEN)
    table[i, j] = cost
    number = np.full(table.shape, -1)
    number[i, j] = np.arange(len(rows))
    taken = number[linear_sum_assignment(table)]
    return taken[taken >= 0]
