"""Objects and tracks of one frame as input of the metrics, and the rule by which they can match."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.distance import cdist

from appocc.checks import BoolArray, FloatArray, IntArray, check_finite, check_shape

GATE_M = 2.0


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
