"""Motion of one vehicle: a constant-velocity Kalman filter in the world frame, in seconds and metres."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from filterpy.common import Q_continuous_white_noise
from filterpy.kalman import KalmanFilter

from appocc.checks import FloatArray


@dataclass(frozen=True)
class MotionConfig:
    """How vehicles move and how well blobs show it.

    Attributes:
        first_speed_mps: standard deviation of each component of the velocity before any motion was seen.
        unrest_m2ps3: spectral density of the acceleration, taken as white noise.
        blob_m: standard deviation of a blob's centroid on each axis.
        cut_blob_m: the same for a first blob at the rim of the grid, of which an unknown part is missing.
    """

    first_speed_mps: float = 12.0
    unrest_m2ps3: float = 2.0
    blob_m: float = 0.3
    cut_blob_m: float = 0.5


class Motion:
    """State x, y, vx, vy in the world frame; both axes share one variance, so that the gate is a circle."""

    def __init__(self, xy_world_m: FloatArray, sigma_m: float, config: MotionConfig) -> None:
        """Start at a first sighting (2,), velocity unknown."""
        self._config = config
        self._filter = KalmanFilter(dim_x=4, dim_z=2)
        self._filter.x = np.concatenate([xy_world_m, np.zeros(2)])
        self._filter.P = np.diag([sigma_m**2] * 2 + [config.first_speed_mps**2] * 2)
        self._filter.H = np.eye(2, 4)

    def predict(self, seconds: float) -> None:
        """Move on by a time span."""
        self._filter.F = np.eye(4) + seconds * np.eye(4, k=2)
        self._filter.Q = Q_continuous_white_noise(
            2, seconds, self._config.unrest_m2ps3, block_size=2, order_by_dim=False
        )
        self._filter.predict()

    def update(self, xy_world_m: FloatArray, sigma_m: float) -> None:
        """Take in a sighting (2,) with the standard deviation of each of its components."""
        self._filter.update(xy_world_m, R=np.eye(2) * sigma_m**2)

    @property
    def position_m(self) -> FloatArray:
        """(2,) position."""
        return np.array(self._filter.x[:2])

    @property
    def velocity_mps(self) -> FloatArray:
        """(2,) velocity."""
        return np.array(self._filter.x[2:])

    @property
    def moves(self) -> bool:
        """Whether the velocity is certainly not zero: three standard deviations."""
        return bool(np.hypot(*self._filter.x[2:]) > 3 * np.sqrt(self._filter.P[2, 2]))

    @property
    def variance_m2(self) -> float:
        """Variance of either component of the position."""
        return float(self._filter.P[0, 0])
