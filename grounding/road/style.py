"""Gaps that the ego keeps, as far as its user may want to set them."""

from __future__ import annotations

from dataclasses import dataclass

from appocc.errors import AppoccError


@dataclass(frozen=True)
class DrivingStyle:
    """Gaps to other vehicles.

    Attributes:
        stop_gap_m: between bumpers, to stop at or approach a vehicle.
        park_gap_m: between bumpers, to park.
        following_m: behind a vehicle that is followed, standing.
        following_s: beyond that, seconds of its speed.
        clearance_m: least distance to vehicles on all sides of a place.
    """

    stop_gap_m: float = 2.0
    park_gap_m: float = 1.0
    following_m: float = 6.0
    following_s: float = 1.5
    clearance_m: float = 0.3

    def following_gap_m(self, speed_mps: float | None) -> float:
        """Return the gap behind a vehicle of some speed that is followed; None: a standing one."""
        return self.following_m + self.following_s * (speed_mps or 0.0)

    def __post_init__(self) -> None:
        """Check the gaps.

        Raises:
            AppoccError: if one is negative or larger than 30.
        """
        for name, value in vars(self).items():
            if not 0 <= value <= 30:
                raise AppoccError(f"driving style: expected {name} from 0 to 30, got {value}")


DEFAULT_STYLE = DrivingStyle()
