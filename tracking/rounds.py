"""Rounds in which tracks take sightings: each leaves fewer of both to the next."""

from __future__ import annotations

import numpy as np

from appocc.checks import BoolArray
from tracking.association import NONE, AssociationConfig, Pairs, Predicted, Seen, matched, near, possible
from tracking.trust import ColourTrust


class Rounds:
    """Who of N tracks takes which of M sightings of one moment.

    Attributes:
        takes: (N,) number of the sighting that a track took; -1 for none.
        taken: (M,) whether a track took a sighting.
        noise_m2: (N, 2, 2) how well the place is known that was taken.
        turn_rad: (N,) by how much a track turned on the way; 0 if it went straight on.
    """

    def __init__(self, tracks: Predicted, seen: Seen, colours: ColourTrust) -> None:
        """Begin with none taken."""
        self._tracks, self._seen, self._colours = tracks, seen, colours
        n = len(tracks.xy_m)
        self.takes, self.taken = np.full(n, -1), np.zeros(len(seen.xy_m), np.bool_)
        self.noise_m2, self.turn_rad = np.zeros((n, 2, 2)), np.zeros(n)

    @property
    def free(self) -> BoolArray:
        """(N,) which tracks took nothing yet."""
        return self.takes < 0

    def pairs(self, tracks: BoolArray, sights: BoolArray, rule: AssociationConfig) -> Pairs:
        """Those that a rule allows of some tracks (N,) and sightings (M,) still free; colours do not count."""
        (rows,), (columns,) = (tracks & self.free).nonzero(), (sights & ~self.taken).nonzero()
        if not (len(rows) and len(columns)):
            return NONE
        reach_m = rule.reach_m(self._tracks.unseen_s[rows])
        one, other = near(self._tracks.xy_m[rows], self._seen.xy_m[columns], reach_m)
        return possible(self._tracks, self._seen, rows[one], columns[other], rule) if len(one) else NONE

    def take(self, pairs: Pairs) -> None:
        """Of free tracks and sightings those that go together best, colours weighed, take each other."""
        if not len(pairs.rows):
            return
        best = matched(self._colours.weighed(pairs))
        self.takes[best.rows], self.taken[best.columns] = best.columns, True
        self.noise_m2[best.rows], self.turn_rad[best.rows] = best.noise_m2, best.turn_rad
