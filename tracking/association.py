"""Which blob belongs to which track: Hungarian matching over place and colour."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from appocc.checks import FloatArray, IntArray

_FORBIDDEN = 1e6


@dataclass(frozen=True)
class AssociationConfig:
    """What pairs of tracks and blobs are possible, and what they cost.

    Attributes:
        gate_m: distance that is always possible.
        gate_sigmas: beyond it, as many standard deviations of the prediction ...
        gate_most_m: ... but never more than this.
        colour_rgb: standard deviation of a vehicle's mean colour from one sighting to the next.
        colour_cap: most that a difference in colour may cost, in squared standard deviations (0: colour is not used).
    """

    gate_m: float = 2.5
    gate_sigmas: float = 3.0
    gate_most_m: float = 10.0
    colour_rgb: float = 20.0
    colour_cap: float = 9.0


def associate(
    track_xy_m: FloatArray,
    variance_m2: FloatArray,
    track_rgb: FloatArray,
    blob_xy_m: FloatArray,
    blob_rgb: FloatArray,
    config: AssociationConfig,
) -> tuple[IntArray, IntArray]:
    """Rows and columns of the cheapest assignment of N tracks to M blobs, within the gates.

    The cost of a pair is the negative log likelihood of the blob's place given the track, doubled, plus the squared
    difference in colour over its variance, capped: paint may lie in shade or be seen wrongly, a place cannot.

    Args:
        track_xy_m: (N, 2) predicted places.
        variance_m2: (N, M) variance of either component of (blob - prediction).
        track_rgb: (N, 3) colours, NaN where unknown.
        blob_xy_m: (M, 2).
        blob_rgb: (M, 3), NaN where unknown.
        config: gates and weights.
    """
    distance = cdist(track_xy_m, blob_xy_m)
    cost = distance**2 / variance_m2 + 2 * np.log(variance_m2) + _colour_cost(track_rgb, blob_rgb, config)
    possible = distance <= _gates_m(variance_m2, config)
    rows, columns = linear_sum_assignment(np.where(possible, cost, _FORBIDDEN))
    keep = possible[rows, columns]
    return rows[keep], columns[keep]


def _gates_m(variance_m2: FloatArray, config: AssociationConfig) -> FloatArray:
    return np.clip(config.gate_sigmas * np.sqrt(variance_m2), config.gate_m, config.gate_most_m)


def _colour_cost(track_rgb: FloatArray, blob_rgb: FloatArray, config: AssociationConfig) -> FloatArray:
    """(N, M) squared colour difference in standard deviations, capped; half the cap where a colour is unknown."""
    squared = cdist(track_rgb, blob_rgb, "sqeuclidean") / config.colour_rgb**2
    return np.minimum(np.where(np.isfinite(squared), squared, config.colour_cap / 2), config.colour_cap)
