"""The ego vehicle: its size, and the cells of a grid below its body."""

from __future__ import annotations

from appocc.checks import BoolArray
from appocc.grid import BEVGrid

# Length and width of the body, and its rear overhang: the part behind the rear axle, the origin of the ego frame.
EGO_LENGTH_M, EGO_WIDTH_M, EGO_REAR_M = 4.6, 1.9, 1.0


def body_cells(grid: BEVGrid) -> BoolArray:
    """(X, Y) cells of a grid in the ego frame whose centre is below the body of the ego."""
    x_m, y_m = grid.centres()[..., 0], grid.centres()[..., 1]
    return (x_m >= -EGO_REAR_M) & (x_m <= EGO_LENGTH_M - EGO_REAR_M) & (abs(y_m) <= EGO_WIDTH_M / 2)
