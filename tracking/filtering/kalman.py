"""Motion of many vehicles: constant-velocity Kalman filters in the world frame, in seconds and metres.

All filters take their steps together, in arrays: fifty vehicles cost as much as two of filterpy's `KalmanFilter`,
of which each is the twin (tested to 1e-9).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from appocc.checks import BoolArray, FloatArray, IntArray

# Certainly not zero: so many standard deviations.
_CERTAIN = 3.0
# Added to angles before they divide, for 0 / 0 is 1 here.
_TINY = 1e-300


@dataclass(frozen=True)
class MotionConfig:
    """How vehicles move and how well sightings show it: a vehicle goes where its front or rear points.

    Attributes:
        speed_mps: standard deviation of the velocity along the heading, before any motion was seen.
        drift_mps: the same across it.
        push_m2ps3: spectral density of the acceleration along the heading, taken as white noise.
        swerve_m2ps3: the same across it.
        along_m: standard deviation of a sighting's place along the heading.
        across_m: the same across it.
        cut_m: what is added to both where a part of the vehicle may be missing.
    """

    speed_mps: float = 8.0
    drift_mps: float = 0.5
    push_m2ps3: float = 1.0
    swerve_m2ps3: float = 0.1
    along_m: float = 0.25
    across_m: float = 0.2
    cut_m: float = 0.5


def spread(yaw_rad: FloatArray, along: FloatArray | float, across: FloatArray | float) -> FloatArray:
    """(N, 2, 2) covariances of headings (N,): variances along and across them."""
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    ahead = (along - across) * cos
    result = np.empty((2, 2, len(yaw_rad)))
    result[0, 0] = xx = across + ahead * cos
    result[1, 1] = along + across - xx
    result[0, 1] = result[1, 0] = ahead * sin
    return result.transpose(2, 0, 1)


class Motions:
    """Filters with states x, y, vx, vy.

    Attributes:
        mean: (N, 4) states, world frame.
        cov: (N, 4, 4) their covariances.
    """

    def __init__(self, config: MotionConfig) -> None:
        """Start with none."""
        self._config = config
        self.mean = np.zeros((0, 4))
        self.cov = np.zeros((0, 4, 4))

    def add(self, xy_world_m: FloatArray, yaw_rad: FloatArray, place_m2: FloatArray) -> None:
        """Begin with first sightings: places (M, 2) with covariances (M, 2, 2), and headings (M,)."""
        config, cov = self._config, np.zeros((len(xy_world_m), 4, 4))
        cov[:, :2, :2] = place_m2
        cov[:, 2:, 2:] = spread(yaw_rad, config.speed_mps**2, config.drift_mps**2)
        mean = np.concatenate([xy_world_m, np.zeros((len(xy_world_m), 2))], axis=1)
        self.mean = np.concatenate([self.mean, mean])
        self.cov = np.concatenate([self.cov, cov])

    def keep(self, chosen: BoolArray) -> None:
        """Go on with some (N,) only."""
        self.mean, self.cov = self.mean.compress(chosen, axis=0), self.cov.compress(chosen, axis=0)

    def predict(self, seconds: FloatArray, yaw_rad: FloatArray) -> None:
        """Move on by time spans (N,); vehicles are pushed along headings (N,) more than across."""
        config = self._config
        # Numpy is fast where the last axis is the long one.
        mean, cov = self.mean.T, self.cov.transpose(1, 2, 0).copy()
        mean[:2] += seconds * mean[2:]
        pushed = seconds * spread(yaw_rad, config.push_m2ps3, config.swerve_m2ps3).transpose(1, 2, 0)
        place, mixed, speed = cov[:2, :2], cov[:2, 2:], cov[2:, 2:]
        later = mixed + seconds * (speed + pushed / 2)
        place += seconds * (mixed + later.transpose(1, 0, 2) - seconds / 6 * pushed)
        speed += pushed
        mixed[:], cov[2:, :2] = later, later.transpose(1, 0, 2)
        self.cov = np.ascontiguousarray(cov.transpose(2, 0, 1))

    def turn(self, rows: IntArray, angle_rad: FloatArray, seconds: FloatArray) -> None:
        """The last `seconds` (M,) of some filters went along arcs that turned by angles (M,), not straight on."""
        step = np.zeros((len(rows), 4, 4))
        step[:, :2, :2] = np.eye(2)
        step[:, :2, 2:] = _matrices(*bend(angle_rad)) * seconds[:, None, None]
        step[:, 2:, 2:] = _matrices(np.cos(angle_rad), np.sin(angle_rad))
        self.mean[rows] = (step @ self.mean[rows][..., None])[..., 0]
        self.cov[rows] = step @ self.cov[rows] @ step.transpose(0, 2, 1)

    def update(self, rows: IntArray, xy_world_m: FloatArray, noise_m2: FloatArray) -> None:
        """Take in a sighting of each of some filters (M,): places (M, 2) with covariances (M, 2, 2)."""
        mean, cov = self.mean.take(rows, axis=0), self.cov.take(rows, axis=0)
        gain = cov[:, :, :2] @ inverse_of(cov[:, :2, :2] + noise_m2)  # M 4 2
        self.mean[rows] = mean + (gain @ (xy_world_m - mean[:, :2])[..., None])[..., 0]
        cov -= gain @ cov[:, :2]
        self.cov[rows] = (cov + cov.transpose(0, 2, 1)) / 2

    def moves(self) -> BoolArray:
        """(N,) whether the velocity is certainly not zero."""
        vx, vy = self.mean[:, 2:].T
        return squared(vx, vy, self.cov[:, 2:, 2:]) > _CERTAIN**2

    def rest(self, most_mps: float) -> BoolArray:
        """(N,) whether they stand, as far as is known: no faster than so much, and that well known."""
        known_mps = np.sqrt(self.cov[:, 2, 2] + self.cov[:, 3, 3])
        return np.asarray((np.hypot(*self.mean[:, 2:].T) < most_mps) & (known_mps < 2 * most_mps))

    def blur_m(self) -> FloatArray:
        """(N,) standard deviation of the place in the direction in which it is known least."""
        xx, yy, xy = self.cov[:, 0, 0], self.cov[:, 1, 1], self.cov[:, 0, 1]
        return np.asarray(np.sqrt((xx + yy) / 2 + np.hypot((xx - yy) / 2, xy)))


def bend(angle_rad: FloatArray) -> tuple[FloatArray, FloatArray]:
    """What leads from the end of a straight way to that of an arc as long, which turns by angles (N,).

    Returns:
        (N,), (N,) by how much to go on along the straight way and to the left of it, as shares of its length.
    """
    half = angle_rad / 2 + _TINY
    sin = np.sin(half)
    chord = sin / half
    return chord * np.cos(half) - 1, chord * sin


def _matrices(ahead: FloatArray, left: FloatArray) -> FloatArray:
    """(N, 2, 2) what adds up shares (N,), (N,) of a vector and of it turned to the left."""
    result = np.empty((len(ahead), 2, 2))
    result[:, 0, 0] = result[:, 1, 1] = ahead
    result[:, 1, 0] = left
    result[:, 0, 1] = -left
    return result


def inverse_of(matrices: FloatArray) -> FloatArray:
    """Inverses of symmetric matrices (..., 2, 2)."""
    result = np.empty_like(matrices)
    determinant = determinant_of(matrices)
    result[..., 0, 0] = matrices[..., 1, 1] / determinant
    result[..., 1, 1] = matrices[..., 0, 0] / determinant
    result[..., 0, 1] = result[..., 1, 0] = -matrices[..., 0, 1] / determinant
    return result


def determinant_of(matrices: FloatArray) -> FloatArray:
    """Determinants of symmetric matrices (..., 2, 2)."""
    return np.asarray(matrices[..., 0, 0] * matrices[..., 1, 1] - matrices[..., 0, 1] ** 2)


def squared(x: FloatArray, y: FloatArray, cov: FloatArray) -> FloatArray:
    """(N,) squared Mahalanobis lengths of offsets (N,), (N,) under covariances (N, 2, 2)."""
    xx, yy, xy = cov[:, 0, 0], cov[:, 1, 1], cov[:, 0, 1]
    return np.asarray((x * x * yy - 2 * x * y * xy + y * y * xx) / (xx * yy - xy * xy))
