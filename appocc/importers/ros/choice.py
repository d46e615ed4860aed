"""What a user chooses where a bag leaves more than one possibility."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class Choice:
    """Choice of frames and topics; None and () mean: found in the bag.

    Attributes:
        base_frame: frame of the vehicle: x ahead, y left, z up, below or at the rear axle.
        height_m: height of its origin above the road.
        odometry: topic of nav_msgs/Odometry, or the fixed frame from which tf leads to the base frame.
        lidar: topic of sensor_msgs/PointCloud2.
        cameras: names of cameras.
    """

    base_frame: str | None = None
    height_m: float = 0.0
    odometry: str | None = None
    lidar: str | None = None
    cameras: tuple[str, ...] = ()

    def as_json(self) -> dict[str, Any]:
        """Return JSON values."""
        return asdict(self)
