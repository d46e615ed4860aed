"""Constant-velocity Kalman filters of many vehicles, in the world frame, in seconds and metres.

All filters are updated together by compiled loops. Each filter equals filterpy's to 1e-9 (tested).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from appocc.checks import BoolArray, FloatArray, IntArray
from tracking.compiled import compiled

# Number of standard deviations by which a moving vehicle's velocity differs from zero.
_MOVING_SIGMA = 2.0
# Added to angles before a division, so that sin(0) / 0 is 1.
_TINY = 1e-300


@dataclass(frozen=True, kw_only=True)
class MotionConfig:
    """Motion and measurement model: a vehicle moves along its heading, hardly across it.

    Attributes:
        along_speed_std_mps: initial standard deviation of the velocity along the heading.
        across_speed_std_mps: the same across the heading.
        along_accel_psd_m2ps3: spectral density of the white-noise acceleration along the heading.
        across_accel_psd_m2ps3: the same across the heading.
        heading_psd_rad2ps: spectral density of the random walk of the direction of motion: the faster a vehicle, the
            less certain is its path in bends. At 0 the velocity does not turn with the detected heading either.
        along_std_m: standard deviation of a detection's position along the heading.
        across_std_m: the same across the heading.
        truncated_std_m: standard deviation added to both if the detection is truncated.
        stationary_psd: factor on the spectral densities of the acceleration while stationary: most such vehicles are
            parked.
    """

    along_speed_std_mps: float = 8.0
    across_speed_std_mps: float = 0.5
    along_accel_psd_m2ps3: float = 1.0
    across_accel_psd_m2ps3: float = 0.1
    heading_psd_rad2ps: float = 0.005
    along_std_m: float = 0.25
    across_std_m: float = 0.2
    truncated_std_m: float = 0.5
    stationary_psd: float = 0.2


def oriented_covariance(yaw_rad: FloatArray, along: FloatArray | float, across: FloatArray | float) -> FloatArray:
    """Return covariances (N, 2, 2) with given variances along and across headings (N,)."""
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    ahead = (along - across) * cos
    result = np.empty((len(yaw_rad), 2, 2))
    result[:, 0, 0] = xx = across + ahead * cos
    result[:, 1, 1] = along + across - xx
    result[:, 0, 1] = result[:, 1, 0] = ahead * sin
    return result


def acceleration_psd(
    yaw_rad: FloatArray,
    velocity_mps: FloatArray,
    along_m2ps3: FloatArray | float,
    across_m2ps3: FloatArray | float,
    heading_rad2ps: FloatArray | float,
) -> FloatArray:
    """Return spectral densities (N, 2, 2) of the acceleration at headings (N,) and velocities (N, 2).

    A random walk of the direction of motion accelerates across it, in proportion to the speed.
    """
    speed_m2ps2 = (velocity_mps * velocity_mps).sum(axis=1)
    return oriented_covariance(yaw_rad, along_m2ps3, across_m2ps3 + heading_rad2ps * speed_m2ps2)


class KalmanFilters:
    """N filters with states x, y, vx, vy.

    Attributes:
        mean: (N, 4) states, world frame.
        cov: (N, 4, 4) covariances of the states.
    """

    def __init__(self) -> None:
        """Start with no filters."""
        self.mean = np.zeros((0, 4))
        self.cov = np.zeros((0, 4, 4))

    def add(
        self, xy_world_m: FloatArray, noise_m2: FloatArray, velocity_mps: FloatArray, cov_m2ps2: FloatArray
    ) -> None:
        """Add M filters at positions (M, 2) and velocities (M, 2) with covariances (M, 2, 2) of both."""
        cov = np.zeros((len(xy_world_m), 4, 4))
        cov[:, :2, :2] = noise_m2
        cov[:, 2:, 2:] = cov_m2ps2
        mean = np.concatenate([xy_world_m, velocity_mps], axis=1)
        self.mean = np.concatenate([self.mean, mean])
        self.cov = np.concatenate([self.cov, cov])

    def keep(self, mask: BoolArray) -> None:
        """Keep the filters of a mask (N,)."""
        self.mean, self.cov = self.mean.compress(mask, axis=0), self.cov.compress(mask, axis=0)

    def predict(self, seconds: FloatArray, psd_m2ps3: FloatArray) -> None:
        """Predict over time steps (N,), with spectral densities (N, 2, 2) of the white-noise acceleration."""
        _predict(self.mean, self.cov, seconds, psd_m2ps3)

    def turn(self, rows: IntArray, angle_rad: FloatArray, seconds: FloatArray) -> None:
        """Replace straight motion over the last `seconds` (M,) by arcs that turn by angles (M,)."""
        step = np.zeros((len(rows), 4, 4))
        step[:, :2, :2] = np.eye(2)
        step[:, :2, 2:] = _scaled_rotations(*arc_offset(angle_rad)) * seconds[:, None, None]
        step[:, 2:, 2:] = _scaled_rotations(np.cos(angle_rad), np.sin(angle_rad))
        self.mean[rows] = (step @ self.mean[rows][..., None])[..., 0]
        self.cov[rows] = step @ self.cov[rows] @ step.transpose(0, 2, 1)

    def update(self, rows: IntArray, xy_world_m: FloatArray, noise_m2: FloatArray) -> None:
        """Update filters (M,) with measured positions (M, 2) and their covariances (M, 2, 2)."""
        _update(self.mean, self.cov, rows, xy_world_m, noise_m2, np.empty((2, 4)))

    def speed_mps(self) -> FloatArray:
        """(N,) speeds."""
        return np.asarray(np.hypot(self.mean[:, 2], self.mean[:, 3]))

    def is_moving(self) -> BoolArray:
        """(N,) whether the velocity differs from zero by at least two standard deviations."""
        moving = np.empty(len(self.mean), np.bool_)
        _find_moving(self.mean, self.cov, moving)
        return moving

    def is_stationary(self, max_mps: float) -> BoolArray:
        """(N,) whether the speed is below a limit, with a standard deviation below twice the limit."""
        stationary = np.empty(len(self.mean), np.bool_)
        _find_stationary(self.mean, self.cov, float(max_mps), stationary)
        return stationary

    def position_std_m(self) -> FloatArray:
        """(N,) standard deviation of the position along its least certain direction."""
        std_m = np.empty(len(self.mean))
        _position_std(self.cov, std_m)
        return std_m


@compiled
def _position_std(cov: FloatArray, std_m: FloatArray) -> None:
    """See `KalmanFilters.position_std_m`; written to `std_m` (N,)."""
    for n in range(len(cov)):
        xx, yy, xy = cov[n, 0, 0], cov[n, 1, 1], cov[n, 0, 1]
        std_m[n] = np.sqrt((xx + yy) / 2 + np.hypot((xx - yy) / 2, xy))


@compiled
def _find_stationary(mean: FloatArray, cov: FloatArray, max_mps: float, stationary: BoolArray) -> None:
    """See `KalmanFilters.is_stationary`; written to `stationary` (N,)."""
    for n in range(len(mean)):
        slow = np.hypot(mean[n, 2], mean[n, 3]) < max_mps
        stationary[n] = slow and cov[n, 2, 2] + cov[n, 3, 3] < 4 * max_mps**2


@compiled
def _find_moving(mean: FloatArray, cov: FloatArray, moving: BoolArray) -> None:
    """See `KalmanFilters.is_moving`; written to `moving` (N,)."""
    for n in range(len(mean)):
        x, y, xx, yy, xy = mean[n, 2], mean[n, 3], cov[n, 2, 2], cov[n, 3, 3], cov[n, 2, 3]
        chi2 = (x * x * yy - 2 * x * y * xy + y * y * xx) / (xx * yy - xy * xy)
        moving[n] = chi2 > _MOVING_SIGMA**2


@compiled
def _predict(mean: FloatArray, cov: FloatArray, seconds: FloatArray, psd_m2ps3: FloatArray) -> None:
    """See `KalmanFilters.predict`; states (N, 4) and covariances (N, 4, 4) are changed in place."""
    for n in range(len(mean)):
        step = seconds[n]
        for i in range(2):
            mean[n, i] += step * mean[n, i + 2]
            for j in range(2):
                cross, noise = cov[n, i, j + 2], step * psd_m2ps3[n, i, j]
                mirrored = cov[n, j, i + 2] + step * (cov[n, i + 2, j + 2] + noise / 2)
                cov[n, i, j] += step * (cross + mirrored - step / 6 * noise)
        for i in range(2):
            for j in range(2):
                noise = step * psd_m2ps3[n, i, j]
                cov[n, i, j + 2] += step * (cov[n, i + 2, j + 2] + noise / 2)
                cov[n, j + 2, i] = cov[n, i, j + 2]
        for i in range(2):
            for j in range(2):
                cov[n, i + 2, j + 2] += step * psd_m2ps3[n, i, j]


@compiled
def _update(
    mean: FloatArray,
    cov: FloatArray,
    rows: IntArray,
    xy_world_m: FloatArray,
    noise_m2: FloatArray,
    seen: FloatArray,
) -> None:
    """See `KalmanFilters.update`; states (N, 4) and covariances (N, 4, 4) are changed in place.

    `seen` (2, 4) is room for H P.
    """
    for k, n in enumerate(rows):
        xx, yy = cov[n, 0, 0] + noise_m2[k, 0, 0], cov[n, 1, 1] + noise_m2[k, 1, 1]
        xy = cov[n, 0, 1] + noise_m2[k, 0, 1]
        determinant = xx * yy - xy * xy
        x, y = xy_world_m[k, 0] - mean[n, 0], xy_world_m[k, 1] - mean[n, 1]
        for i in range(4):
            seen[0, i], seen[1, i] = cov[n, 0, i], cov[n, 1, i]
        for i in range(4):
            gain_x = (seen[0, i] * yy - seen[1, i] * xy) / determinant
            gain_y = (seen[1, i] * xx - seen[0, i] * xy) / determinant
            mean[n, i] += gain_x * x + gain_y * y
            for j in range(i, 4):
                cov[n, i, j] -= gain_x * seen[0, j] + gain_y * seen[1, j]
                cov[n, j, i] = cov[n, i, j]


def arc_offset(angle_rad: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the offset from the end of a straight path to the end of an arc of equal length, for turns (N,).

    Returns:
        (N,), (N,) offsets ahead and to the left, as fractions of the length.
    """
    half = angle_rad / 2 + _TINY
    sin = np.sin(half)
    chord = sin / half
    return chord * np.cos(half) - 1, chord * sin


def _scaled_rotations(ahead: FloatArray, left: FloatArray) -> FloatArray:
    """(N, 2, 2) matrices [[ahead, -left], [left, ahead]]."""
    result = np.empty((len(ahead), 2, 2))
    result[:, 0, 0] = result[:, 1, 1] = ahead
    result[:, 1, 0] = left
    result[:, 0, 1] = -left
    return result
