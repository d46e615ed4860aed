"""Fields of view: where a detector can detect objects, and where it is blind."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from appocc.checks import BoolArray, FloatArray
from appocc.grid import BEVGrid
from tracking.config_checks import check_config


@runtime_checkable
class FieldOfView(Protocol):
    """Area in which vehicles can be detected; points (P, 2) are on the ground, ego frame, metres."""

    def sees(self, xy_ego_m: FloatArray) -> BoolArray:
        """(P,) whether points are in the field of view."""
        ...

    def blind(self, xy_ego_m: FloatArray) -> BoolArray:
        """(P,) whether points are in a blind spot of the field of view; there are none by default."""
        return np.zeros(len(xy_ego_m), np.bool_)


@dataclass(frozen=True)
class CircularView(FieldOfView):
    """Field of view up to a range around the ego.

    Attributes:
        range_m: distance on the ground.
    """

    range_m: float = np.inf

    def __post_init__(self) -> None:
        """Check the range.

        Raises:
            ShapeError: if it is no distance.
        """
        check_config(self)

    def sees(self, xy_ego_m: FloatArray) -> BoolArray:
        """See `FieldOfView`."""
        return np.asarray(np.hypot(xy_ego_m[:, 0], xy_ego_m[:, 1]) <= self.range_m)


@dataclass(frozen=True, eq=False)
class GridView(FieldOfView):
    """Field of view of a grid in the ego frame.

    Attributes:
        grid: extent of the field of view.
        known: (X, Y) cells in which vehicles can be detected, the others are blind spots; None for all.
    """

    grid: BEVGrid
    known: BoolArray | None = None

    def sees(self, xy_ego_m: FloatArray) -> BoolArray:
        """See `FieldOfView`."""
        return self.grid.contains(self.grid.cell_of(xy_ego_m))

    def blind(self, xy_ego_m: FloatArray) -> BoolArray:
        """See `FieldOfView`."""
        if self.known is None:
            return super().blind(xy_ego_m)
        cells = self.grid.cell_of(xy_ego_m)
        inside = self.grid.contains(cells)
        i, j = np.where(inside[:, None], cells, 0).T
        return np.asarray(inside & ~self.known[i, j])
