"""Rectangular parts of buildings, and their secondary walls."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from appocc.checks import FloatArray
from appocc.simulation.scenery.builder import Builder, LocalFrame
from appocc.simulation.scenery.facade import FacadeStyle, add_window_wall, window_columns, window_rows

SIDES = ("front", "right", "back", "left")


@dataclass(frozen=True)
class BuildingPart:
    """A rectangle s0..s1, d0..d1 of a local frame, with walls up to `eaves_m`."""

    frame: LocalFrame
    s0: float
    s1: float
    d0: float
    d1: float
    eaves_m: float

    def turned(self) -> BuildingPart:
        """Return the same rectangle with s along its depth."""
        frame = self.frame.moved(self.s1, self.d0, 1)
        return BuildingPart(frame, 0.0, self.d1 - self.d0, 0.0, self.s1 - self.s0, self.eaves_m)

    def side(self, name: str) -> tuple[LocalFrame, float]:
        """Return frame and length of its front, right, back or left wall."""
        s0, s1, d0, d1 = self.s0, self.s1, self.d0, self.d1
        corner = {"front": (s0, d0, 0), "right": (s1, d0, 1), "back": (s1, d1, 2), "left": (s0, d1, 3)}[name]
        return self.frame.moved(*corner), (s1 - s0) if name in ("front", "back") else (d1 - d0)


def plain_window_columns(length_m: float, style: FacadeStyle) -> FloatArray:
    """Return (n, 2) left and right edges of the windows of a back or side wall."""
    # They are visible only from a distance, through gaps: fewer windows suffice.
    return window_columns(length_m, replace(style, bay_m=1.35 * style.bay_m), 0.8)


def add_plain_side(builder: Builder, part: BuildingPart, name: str, style: FacadeStyle, closed: bool) -> None:
    """Add a wall with panes, or without windows if it is closed."""
    frame, length = part.side(name)
    s = np.zeros((0, 2)) if closed else plain_window_columns(length, style)
    z = window_rows(style.floors_m(), style, len(s))
    add_window_wall(builder, frame, length, (0.0, part.eaves_m), s, z, style=style, detailed=False)
