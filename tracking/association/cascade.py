"""Matching cascade: stages that match tracks to detections, each with what earlier stages left unmatched."""

from __future__ import annotations

import numpy as np

from appocc.checks import BoolArray
from tracking.association.costs import (
    NO_PAIRS,
    AssociationConfig,
    CandidatePairs,
    DetectionFeatures,
    TrackFeatures,
    gate_pairs,
    solve_assignment,
)
from tracking.neighbours import find_neighbours


class MatchingCascade:
    """State of the cascade for N tracks and M detections of one frame.

    Attributes:
        unmatched_tracks: (N,) tracks without a detection.
        unmatched_detections: (M,) detections without a track.
        detection: (N,) index of the matched detection; valid where the track is matched.
        noise_m2: (N, 2, 2) covariance of that detection's position.
        turn_rad: (N,) turn of the track since its last detection; 0 for straight motion.
    """

    def __init__(self, tracks: TrackFeatures, detections: DetectionFeatures) -> None:
        """Start with nothing matched."""
        self._tracks, self._detections = tracks, detections
        n, m = len(tracks.xy_m), len(detections.xy_m)
        self.unmatched_tracks, self.unmatched_detections = np.ones(n, np.bool_), np.ones(m, np.bool_)
        self.detection, self.noise_m2, self.turn_rad = np.zeros(n, np.int64), np.zeros((n, 2, 2)), np.zeros(n)

    def candidates(self, tracks: BoolArray, detections: BoolArray, config: AssociationConfig) -> CandidatePairs:
        """Return the gated pairs of unmatched tracks and detections in masks (N,), (M,); without colour costs."""
        (rows,) = (tracks & self.unmatched_tracks).nonzero()
        (columns,) = (detections & self.unmatched_detections).nonzero()
        if not (len(rows) and len(columns)):
            return NO_PAIRS
        radius_m = (config.gate_radius_m(self._tracks.unseen_s) * self._tracks.gate_scale).take(rows)
        track_xy_m, detection_xy_m = self._tracks.xy_m.take(rows, axis=0), self._detections.xy_m.take(columns, axis=0)
        i, j = find_neighbours(track_xy_m, detection_xy_m, radius_m)
        return gate_pairs(self._tracks, self._detections, rows[i], columns[j], config) if len(i) else NO_PAIRS

    def match(self, pairs: CandidatePairs, tracks: BoolArray, detections: BoolArray) -> None:
        """Match unmatched tracks and detections in masks (N,), (M,) at the minimum total cost."""
        if not len(pairs.rows):
            return
        allowed = (tracks & self.unmatched_tracks)[pairs.rows] & (detections & self.unmatched_detections)[
            pairs.columns
        ]
        if not allowed.any():
            return
        if not allowed.all():
            pairs = pairs._replace(cost=np.where(allowed, pairs.cost, np.inf))
        best = solve_assignment(pairs)
        self.unmatched_tracks[best.rows] = self.unmatched_detections[best.columns] = False
        self.detection[best.rows], self.turn_rad[best.rows] = best.columns, best.turn_rad
        self.noise_m2[best.rows] = best.noise_m2
