"""The ego vehicle: its dimensions and the grid cells below its body."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from appocc.checks import BoolArray
from appocc.errors import ShapeError
from appocc.grid import BEVGrid

# Distance between the axles as a share of the length.
_WHEELBASE = 0.6


@dataclass(frozen=True)
class EgoVehicle:
    """Dimensions of the ego vehicle; the origin of the ego frame is its rear axle.

    Attributes:
        length_m: bumper to bumper.
        width_m: width of the body, without mirrors.
        rear_overhang_m: distance from the rear axle to the rear bumper.
        turning_circle_m: diameter of the turning circle, kerb to kerb.

    Raises:
        ShapeError: if a dimension is not positive, or the rear axle is not within the length.
    """

    length_m: float = 4.6
    width_m: float = 1.9
    rear_overhang_m: float = 1.0
    turning_circle_m: float = 11.0

    def __post_init__(self) -> None:
        """Check the sizes."""
        for field in fields(self):
            value = getattr(self, field.name)
            if not 0 < value < 100:
                raise ShapeError(f"EgoVehicle: {field.name}: expected metres above 0 and below 100, got {value}")
        if self.rear_overhang_m >= self.length_m:
            limit = f"expected less than length_m ({self.length_m})"
            raise ShapeError(f"EgoVehicle: rear_overhang_m: {limit}, got {self.rear_overhang_m}")

    @property
    def centre_m(self) -> float:
        """Distance from the rear axle forward to the centre of the body."""
        return self.length_m / 2 - self.rear_overhang_m

    @property
    def turning_radius_m(self) -> float:
        """Least radius of the way of the rear axle's centre, from the turning circle of the outer front wheel."""
        half_circle = self.turning_circle_m / 2
        wheelbase = min(_WHEELBASE * self.length_m, 0.8 * half_circle)
        return max(math.sqrt(half_circle**2 - wheelbase**2) - self.width_m / 2, self.width_m / 2)

    def body_cells(self, grid: BEVGrid) -> BoolArray:
        """(X, Y) cells of a grid in the ego frame whose centre is below the body."""
        x_m, y_m = grid.centres()[..., 0], grid.centres()[..., 1]
        ahead = (x_m >= -self.rear_overhang_m) & (x_m <= self.length_m - self.rear_overhang_m)
        return ahead & (abs(y_m) <= self.width_m / 2)
