"""Rectangular parts of buildings, and their secondary walls."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from appocc.checks import FloatArray
from appocc.simulation.scenery.builder import Builder, Place
from appocc.simulation.scenery.facade import Look, columns, window_rows, windows_wall

SIDES = ("front", "right", "back", "left")


@dataclass(frozen=True)
class Span:
    """A rectangle s0..s1, d0..d1 of a local frame, with walls up to `eaves_m`."""

    place: Place
    s0: float
    s1: float
    d0: float
    d1: float
    eaves_m: float

    def turned(self) -> Span:
        """Return the same rectangle with s along its depth."""
        place = self.place.moved(self.s1, self.d0, 1)
        return Span(place, 0.0, self.d1 - self.d0, 0.0, self.s1 - self.s0, self.eaves_m)

    def side(self, name: str) -> tuple[Place, float]:
        """Return frame and length of its front, right, back or left wall."""
        s0, s1, d0, d1 = self.s0, self.s1, self.d0, self.d1
        corner = {"front": (s0, d0, 0), "right": (s1, d0, 1), "back": (s1, d1, 2), "left": (s0, d1, 3)}[name]
        return self.place.moved(*corner), (s1 - s0) if name in ("front", "back") else (d1 - d0)


def plain_columns(length_m: float, look: Look) -> FloatArray:
    """Return (n, 2) left and right edges of the windows of a back or side wall."""
    # They are visible only from a distance, through gaps: fewer windows suffice.
    return columns(length_m, replace(look, bay_m=1.35 * look.bay_m), 0.8)


def plain_side(builder: Builder, span: Span, name: str, look: Look, closed: bool) -> None:
    """Add a wall with panes, or without windows if it is closed."""
    place, length = span.side(name)
    s = np.zeros((0, 2)) if closed else plain_columns(length, look)
    z = window_rows(look.floors_m(), look, len(s))
    windows_wall(builder, place, length, (0.0, span.eaves_m), s, z, look, False)
