"""Matching cascade: stages that match tracks to detections, each with what earlier stages left unmatched."""

from __future__ import annotations

import numpy as np

from appocc.checks import BoolArray
from tracking.association.costs import (
    NO_PAIRS,
    AssociationConfig,
    CandidatePairs,
    gate_pairs,
    solve_assignment,
)
from tracking.neighbours import find_neighbours
from tracking.records import Records


class MatchingCascade:
    """State of the cascade for N tracks and M detections of one frame.

    Attributes:
        unmatched_tracks: (N,) tracks without a detection.
        unmatched_detections: (M,) detections without a track.
        detection: (N,) index of the matched detection; valid where the track is matched.
        noise_m2: (N, 2, 2) covariance of that detection's position.
        turn_rad: (N,) turn of the track since its last detection; 0 for straight motion.
    """

    def __init__(self, tracks: Records, detections: Records) -> None:
        """Start with nothing matched; `tracks` are N records of `PREDICTION`, `detections` M of `DETECTION`."""
        self._tracks, self._detections = tracks, detections
        n, m = len(tracks), len(detections)
        self.unmatched_tracks, self.unmatched_detections = np.ones(n, np.bool_), np.ones(m, np.bool_)
        self.detection, self.noise_m2, self.turn_rad = np.zeros(n, np.int64), np.zeros((n, 2, 2)), np.zeros(n)

    def candidates(self, tracks: BoolArray, detections: BoolArray, config: AssociationConfig) -> CandidatePairs:
        """Return the gated pairs of unmatched tracks and detections in masks (N,), (M,); without colour costs."""
        (rows,) = (tracks & self.unmatched_tracks).nonzero()
        (columns,) = (detections & self.unmatched_detections).nonzero()
        if not (len(rows) and len(columns)):
            return NO_PAIRS
        radius_m = config.gate_radius_m(self._tracks["unseen_s"].take(rows)) * self._tracks["gate_scale"].take(rows)
        track_xy_m = self._tracks["xy_m"].take(rows, axis=0)
        i, j = find_neighbours(track_xy_m, self._detections["position_world_m"].take(columns, axis=0), radius_m)
        if not len(i):
            return NO_PAIRS
        return gate_pairs(self._tracks, self._detections, rows.take(i), columns.take(j), config)

    def match(self, pairs: CandidatePairs, tracks: BoolArray, detections: BoolArray) -> None:
        """Match unmatched tracks and detections in masks (N,), (M,) at the minimum total cost.

        Pairs of positive cost stay unmatched.
        """
        if not len(pairs.rows):
            return
        useful = (tracks & self.unmatched_tracks).take(pairs.rows) & (pairs.cost < 0)
        useful &= (detections & self.unmatched_detections).take(pairs.columns)
        (best,) = useful.nonzero()
        if not len(best):
            return
        best = best.compress(solve_assignment(pairs.rows.take(best), pairs.columns.take(best), pairs.cost.take(best)))
        rows, columns = pairs.rows.take(best), pairs.columns.take(best)
        self.unmatched_tracks[rows] = self.unmatched_detections[columns] = False
        self.detection[rows], self.turn_rad[rows] = columns, pairs.turn_rad.take(best)
        self.noise_m2[rows] = pairs.noise_m2.take(best, axis=0)
