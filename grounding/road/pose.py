"""A pose on the ground plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from appocc.checks import FloatArray


@dataclass(frozen=True)
class Pose2D:
    """Pose of the centre of the ego's footprint, in the present ego frame.

    Attributes:
        x_m: forward.
        y_m: to the left.
        heading_rad: relative to the present heading.
    """

    x_m: float
    y_m: float
    heading_rad: float = 0.0

    @property
    def xy_m(self) -> FloatArray:
        """(2,) position."""
        return np.array([self.x_m, self.y_m])

    @property
    def ahead(self) -> FloatArray:
        """(2,) unit vector of the heading."""
        return np.array([np.cos(self.heading_rad), np.sin(self.heading_rad)])
