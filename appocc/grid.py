"""The bird's-eye-view grid: conversion between metres and cells."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from appocc.checks import BoolArray, FloatArray, check_finite, check_shape
from appocc.errors import ShapeError
from appocc.typing import Cells, Points2


@dataclass(frozen=True)
class BEVGrid:
    """A grid on the ground plane of the ego frame: x forward, y left, metres; arrays are (..., X, Y).

    Cell i covers [min + i*cell, min + (i+1)*cell); the index of a point is rounded down.
    """

    x_min_m: float = -40.0
    x_max_m: float = 40.0
    y_min_m: float = -40.0
    y_max_m: float = 40.0
    cell_m: float = 0.4

    def __post_init__(self) -> None:
        """Check the extent: finite, positive, a whole number of cells.

        Raises:
            ShapeError: if it is not.
        """
        check_finite("grid", self.as_array())
        if self.cell_m <= 0:
            raise ShapeError(f"grid: expected a positive cell size, got {self.cell_m}")
        for axis, low, high in (("x", self.x_min_m, self.x_max_m), ("y", self.y_min_m, self.y_max_m)):
            cells = (high - low) / self.cell_m
            if round(cells) < 1 or abs(cells - round(cells)) > 1e-6:
                raise ShapeError(f"grid {axis}: expected a whole number of {self.cell_m} m cells, got {low}..{high}")

    @classmethod
    def surround(cls) -> BEVGrid:
        """Return the paper's 360 degree grid: 80 m x 80 m around the ego, (200, 200) cells of 0.4 m."""
        return cls()

    @classmethod
    def front(cls) -> BEVGrid:
        """Return the paper's 180 degree grid: 40 m forward, 80 m wide, (100, 200) cells of 0.4 m."""
        return cls(x_min_m=0.0)

    @classmethod
    def from_array(cls, values: ArrayLike) -> BEVGrid:
        """Return the grid of a stored array [x_min, x_max, y_min, y_max, cell].

        Raises:
            ShapeError: if it is not five numbers of a valid grid.
        """
        array = np.asarray(values, dtype=np.float64)
        check_shape("grid", array, (5,))
        return cls(*(float(value) for value in array))

    def as_array(self) -> FloatArray:
        """Return [x_min, x_max, y_min, y_max, cell] in metres, as stored on disk."""
        return np.array([self.x_min_m, self.x_max_m, self.y_min_m, self.y_max_m, self.cell_m])

    def halved(self) -> BEVGrid:
        """Return a grid with cells of twice the size from the same corner, with at least the same extent."""
        x, y = (2 * self.cell_m * -(-cells // 2) for cells in self.shape)
        return BEVGrid(self.x_min_m, self.x_min_m + x, self.y_min_m, self.y_min_m + y, 2 * self.cell_m)

    @property
    def shape(self) -> tuple[int, int]:
        """Number of cells (X, Y)."""
        return (
            round((self.x_max_m - self.x_min_m) / self.cell_m),
            round((self.y_max_m - self.y_min_m) / self.cell_m),
        )

    def cell_of(self, xy_m: ArrayLike) -> Cells:
        """Return the cell indices (..., 2) of points (..., 2) in the ego frame; they may be outside the grid."""
        xy = np.asarray(xy_m, dtype=np.float64)
        # The epsilon keeps 0.4 * 3 in cell 3 despite rounding.
        return np.floor((xy - [self.x_min_m, self.y_min_m]) / self.cell_m + 1e-9).astype(np.int64)

    def centre_of(self, cell: ArrayLike) -> Points2:
        """Return the centres (..., 2) in metres, ego frame, of cell indices (..., 2), which may be fractions."""
        index = np.asarray(cell, dtype=np.float64)
        return np.asarray([self.x_min_m, self.y_min_m] + (index + 0.5) * self.cell_m)

    def contains(self, cell: ArrayLike) -> BoolArray:
        """Return whether cell indices (..., 2) are inside the grid."""
        index = np.asarray(cell)
        return np.asarray(((index >= 0) & (index < np.array(self.shape))).all(axis=-1))

    def centres(self) -> Points2:
        """Return the centres (X, Y, 2) of all cells, metres, ego frame."""
        return self.centre_of(np.stack(np.meshgrid(*map(np.arange, self.shape), indexing="ij"), axis=-1))
