"""Association costs: gating, negative log-likelihoods of position, heading, size and colour, and assignment."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from appocc.checks import BoolArray, FloatArray, IntArray
from tracking.compiled import compiled
from tracking.records import Records

# Larger heading changes are treated as heading errors, not as turns.
_MAX_TURN_RAD = 1.0
# Extra cost of the turn hypothesis over straight motion.
_TURN_COST = 2.0


@dataclass(frozen=True, kw_only=True)
class AssociationConfig:
    """Gates and costs of track-detection pairs.

    A pair passes the gate if it is closer than `min_gate_m` or within `gate_chi2`. The gate radius is
    `min_gate_m + gate_speed_mps * unseen_s`, at most `max_gate_m`.

    Attributes:
        min_gate_m: distance that always passes the gate.
        gate_chi2: gate on the squared Mahalanobis distance to the prediction.
        gate_speed_mps: growth of the gate radius with the time since the last detection.
        max_gate_m: maximum gate radius.
        heading_std_rad: standard deviation of heading differences, modulo pi.
        max_heading_cost: cap on the heading cost in squared standard deviations; 0 disables it.
        size_log_std: standard deviation of the log ratio of length and width, summed.
        max_size_cost: cap on the size cost in squared standard deviations; 0 disables it.
        drift_std_mps: extra standard deviation of the speed, in all directions.
        max_cost: cost of no assignment (a vehicle gone and a new one). Pairs above it are not matched.
    """

    min_gate_m: float = 2.0
    gate_chi2: float = 7.0
    gate_speed_mps: float = 12.0
    max_gate_m: float = 6.0
    heading_std_rad: float = 0.3
    max_heading_cost: float = 9.0
    size_log_std: float = 0.3
    max_size_cost: float = 0.0
    drift_std_mps: float = 0.0
    max_cost: float = 7.0

    def gate_radius_m(self, unseen_s: FloatArray) -> FloatArray:
        """Return the gate radius (N,) for times since the last detection (N,)."""
        return np.maximum(
            np.minimum(self.min_gate_m + self.gate_speed_mps * unseen_s, self.max_gate_m), self.min_gate_m
        )


class CandidatePairs(NamedTuple):
    """P gated pairs of a track and a detection.

    Attributes:
        rows: (P,) track indices.
        columns: (P,) detection indices.
        noise_m2: (P, 2, 2) covariance of the detection's position, given the track.
        turn_rad: (P,) turn since the last detection; 0 for straight motion.
        cost: (P,) cost of the match minus the cost of no assignment, without colours.
        colour_ratio: (P,) likelihood ratio of the colours, same vehicle against any vehicle; NaN if unknown.
    """

    rows: IntArray
    columns: IntArray
    noise_m2: FloatArray
    turn_rad: FloatArray
    cost: FloatArray
    colour_ratio: FloatArray


NO_PAIRS = CandidatePairs(
    np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 2, 2)), np.zeros(0), np.zeros(0), np.zeros(0)
)


def gate_pairs(
    tracks: Records, detections: Records, rows: IntArray, columns: IntArray, config: AssociationConfig
) -> CandidatePairs:
    """Gate pairs of tracks and detections, by index (P,), (P,), and compute their costs.

    The caller applies the gate radius (`gate_radius_m`). Pairs of different categories are removed. The cost is twice
    the negative log-likelihood of the position given the prediction, for straight motion or along an arc, plus the
    capped costs of heading and size.

    A detection longer than the vehicle is merged with another one, a shorter one is partly missing. Along its
    heading, the position is then uniform over the length difference: variance of its square over 12.

    Args:
        tracks: N records of `PREDICTION`.
        detections: M records of `DETECTION`.
        rows: track indices.
        columns: detection indices.
        config: gates and costs.
    """
    n = len(rows)
    pairs = CandidatePairs(rows.copy(), columns.copy(), np.empty((n, 2, 2)), *np.empty((3, n)))
    count = _gate(
        *pairs,
        tracks,
        detections,
        config.gate_chi2,
        config.min_gate_m,
        config.heading_std_rad,
        config.max_heading_cost,
        config.size_log_std,
        config.max_size_cost,
        config.drift_std_mps,
        config.max_cost,
    )
    return pairs if count == n else CandidatePairs._make([each[:count] for each in pairs])


@compiled
def _gate(
    rows: IntArray,
    columns: IntArray,
    noise_m2: FloatArray,
    turns_rad: FloatArray,
    costs: FloatArray,
    colour_ratio: FloatArray,
    tracks: Records,
    detections: Records,
    gate_chi2: float,
    min_gate_m: float,
    heading_std_rad: float,
    max_heading_cost: float,
    size_log_std: float,
    max_size_cost: float,
    drift_std_mps: float,
    max_cost: float,
) -> int:
    """See `gate_pairs`; the pairs inside the gates are written to the front of (P,), and their number returned."""
    size = 0
    for pair in range(len(rows)):
        n, m = rows[pair], columns[pair]
        track, seen = tracks[n], detections[m]
        if track.kind != seen.kind:
            continue
        yaw_rad = seen.yaw_world_rad
        cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
        surplus_m2 = (seen.size_m[1] - track.size_m[1]) ** 2 / 12
        noise_xx = seen.noise_m2[0, 0] + surplus_m2 * cos * cos
        noise_yy = seen.noise_m2[1, 1] + surplus_m2 * sin * sin
        noise_xy = seen.noise_m2[0, 1] + surplus_m2 * cos * sin
        drift_m2 = (drift_std_mps * track.unseen_s) ** 2
        xx = track.cov_m2[0, 0] + noise_xx + drift_m2
        yy = track.cov_m2[1, 1] + noise_yy + drift_m2
        xy = track.cov_m2[0, 1] + noise_xy

        x, y = seen.position_world_m[0] - track.xy_m[0], seen.position_world_m[1] - track.xy_m[1]
        determinant = xx * yy - xy * xy
        chi2, distance_m = (x * x * yy - 2 * x * y * xy + y * y * xx) / determinant, np.hypot(x, y)
        turn_rad = yaw_rad - track.yaw_rad
        turn_rad -= np.pi * np.rint(turn_rad / np.pi)
        if turn_rad != 0 and abs(turn_rad) <= _MAX_TURN_RAD and track.heading_weight > 0:
            # To the end of an arc instead of a straight path, see `arc_offset`.
            way_x, way_y = track.displacement_m[0], track.displacement_m[1]
            chord = np.sin(turn_rad / 2) / (turn_rad / 2)
            ahead, left = chord * np.cos(turn_rad / 2) - 1, chord * np.sin(turn_rad / 2)
            x, y = x - ahead * way_x + left * way_y, y - left * way_x - ahead * way_y
            arc_chi2 = (x * x * yy - 2 * x * y * xy + y * y * xx) / determinant
            if arc_chi2 + _TURN_COST < chi2:
                chi2, distance_m = arc_chi2, np.hypot(x, y)
            else:
                turn_rad = 0.0
        else:
            turn_rad = 0.0
        if chi2 > gate_chi2 and distance_m > min_gate_m * track.gate_scale:
            continue

        cost = chi2 + np.log(determinant) - max_cost
        heading_chi2 = (np.sin(track.yaw_rad - yaw_rad) / heading_std_rad) ** 2
        cost += min(heading_chi2, max_heading_cost) * track.heading_weight
        if max_size_cost:
            wider = abs(np.log(track.size_m[0] / seen.size_m[0]))
            longer = abs(np.log(track.size_m[1] / seen.size_m[1]))
            cost += min(((wider + longer) / size_log_std) ** 2, max_size_cost)
        # The track's Gaussian over the density among all vehicles.
        colour_chi2, colour_variance = 0.0, 1.0
        for k in range(3):
            colour_chi2 += (track.lab[k] - seen.lab[k]) ** 2 / track.lab_variance[k]
            colour_variance *= track.lab_variance[k]
        density = np.exp(-colour_chi2 / 2) / np.sqrt(colour_variance)
        rows[size], columns[size], turns_rad[size] = n, m, turn_rad
        noise_m2[size, 0, 0], noise_m2[size, 1, 1] = noise_xx, noise_yy
        noise_m2[size, 0, 1] = noise_m2[size, 1, 0] = noise_xy
        costs[size], colour_ratio[size] = cost, density / seen.colour_density
        size += 1
    return size


def solve_assignment(rows: IntArray, columns: IntArray, cost: FloatArray) -> BoolArray:
    """Return which pairs (P,) are assigned at the minimum total cost. All costs are negative.

    Connected components of the pair graph are solved separately.
    """
    if len(set(rows.tolist())) == len(set(columns.tolist())) == len(rows):  # no conflicts
        return np.ones(len(rows), np.bool_)
    row_count, column_count = np.bincount(rows)[rows], np.bincount(columns)[columns]
    component = _components(rows, columns)
    size = np.bincount(component)[component]
    # A component with a single row or a single column takes its cheapest pair.
    is_star = (row_count == size) | (column_count == size)
    order = np.lexsort((cost, component))
    chosen = np.zeros(len(rows), np.bool_)
    chosen[order[_starts(component[order])]] = True
    chosen &= is_star
    if not is_star.all():
        rest = order[~is_star[order]]
        chosen[rest] = _solve_components(component[rest], rows[rest], columns[rest], cost[rest])
    return chosen


def _components(rows: IntArray, columns: IntArray) -> IntArray:
    """(P,) connected component of each pair, as its lowest row; pairs that share a row or a column are connected."""
    lowest, count = np.arange(rows.max() + 1), columns.max() + 1
    while True:
        of_columns = np.full(count, len(lowest))
        np.minimum.at(of_columns, columns, lowest[rows])
        lower = lowest.copy()
        np.minimum.at(lower, rows, of_columns[columns])
        lower = lower[lower]  # path compression: long chains take few iterations
        if (lower == lowest).all():
            return lowest[rows]
        lowest = lower


def _solve_components(component: IntArray, rows: IntArray, columns: IntArray, cost: FloatArray) -> BoolArray:
    """(P,) assigned pairs, by the Hungarian method for each component; pairs are sorted by component."""
    # Consecutive indices within each component.
    i = np.unique(component * (rows.max() + 1) + rows, return_inverse=True)[1]
    j = np.unique(component * (columns.max() + 1) + columns, return_inverse=True)[1]
    assigned = np.full(int(i.max()) + 1, -1)
    starts = np.flatnonzero(_starts(component))
    corners = [edge.reduceat(each, starts).tolist() for each in (i, j) for edge in (np.minimum, np.maximum)]
    for start, end, top, bottom, left, right in zip(starts, [*starts[1:], len(component)], *corners, strict=True):
        table = np.zeros((bottom - top + 1, right - left + 1))  # no assignment costs nothing
        table[i[start:end] - top, j[start:end] - left] = cost[start:end]
        table_rows, table_columns = linear_sum_assignment(table)
        assigned[top + table_rows] = left + table_columns
    return np.asarray(assigned[i] == j)


def _starts(component: IntArray) -> BoolArray:
    """(P,) first pair of each component, in sorted order."""
    return np.concatenate([[True], component[1:] != component[:-1]])
