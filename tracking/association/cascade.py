"""Rounds in which tracks take sightings: each leaves fewer of both to the next."""

from __future__ import annotations

import numpy as np

from appocc.checks import BoolArray
from tracking.association.costs import NONE, AssociationConfig, Pairs, Predicted, Seen, matched, near, possible


class Rounds:
    """Who of N tracks takes which of M sightings of one moment.

    Attributes:
        free: (N,) which tracks took nothing yet.
        left: (M,) which sightings no track took yet.
        takes: (N,) number of the sighting that a track took, if it is not free ...
        noise_m2: (N, 2, 2) ... and how well its place is known,
        turn_rad: (N,) and by how much the track turned on the way; 0 if it went straight on.
    """

    def __init__(self, tracks: Predicted, seen: Seen) -> None:
        """Begin with none taken."""
        self._tracks, self._seen = tracks, seen
        n, m = len(tracks.xy_m), len(seen.xy_m)
        self.free, self.left = np.ones(n, np.bool_), np.ones(m, np.bool_)
        self.takes, self.noise_m2, self.turn_rad = np.zeros(n, np.int64), np.zeros((n, 2, 2)), np.zeros(n)

    def pairs(self, tracks: BoolArray, sights: BoolArray, rule: AssociationConfig) -> Pairs:
        """Those that a rule allows of some tracks (N,) and sightings (M,) still free; colours do not count."""
        (rows,), (columns,) = (tracks & self.free).nonzero(), (sights & self.left).nonzero()
        if not (len(rows) and len(columns)):
            return NONE
        reach_m = rule.reach_m(self._tracks.unseen_s[rows])
        one, other = near(self._tracks.xy_m.take(rows, axis=0), self._seen.xy_m.take(columns, axis=0), reach_m)
        return possible(self._tracks, self._seen, rows[one], columns[other], rule) if len(one) else NONE

    def take(self, pairs: Pairs, tracks: BoolArray, sights: BoolArray) -> None:
        """Of some tracks (N,) and sightings (M,) still free those that go together best take each other."""
        may = (tracks & self.free)[pairs.rows] & (sights & self.left)[pairs.columns]
        if not may.any():
            return
        best = matched(pairs._replace(cost=np.where(may, pairs.cost, np.inf)))
        self.free[best.rows] = self.left[best.columns] = False
        self.takes[best.rows], self.turn_rad[best.rows] = best.columns, best.turn_rad
        self.noise_m2[best.rows] = best.noise_m2
