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
    result = np.empty((len(yaw_rad), 2, 2))
    result[:, 0, 0] = cos * cos * along + sin * sin * across
    result[:, 1, 1] = sin * sin * along + cos * cos * across
    result[:, 0, 1] = result[:, 1, 0] = cos * sin * (along - across)
    return result


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
        mean = np.concatenate([xy_world_m, np.zeros_like(xy_world_m)], axis=1)
        self.mean = np.concatenate([self.mean, mean])
        self.cov = np.concatenate([self.cov, cov])

    def keep(self, chosen: BoolArray) -> None:
        """Go on with some (N,) only."""
        self.mean, self.cov = self.mean[chosen], self.cov[chosen]

    def predict(self, seconds: FloatArray, yaw_rad: FloatArray) -> None:
        """Move on by time spans (N,); vehicles are pushed along headings (N,) more than across."""
        config, cov = self._config, self.cov
        push = spread(yaw_rad, config.push_m2ps3, config.swerve_m2ps3)
        self.mean[:, :2] += seconds[:, None] * self.mean[:, 2:]
        span = seconds[:, None, None]
        place, mixed, speed = cov[:, :2, :2], cov[:, :2, 2:], cov[:, 2:, 2:]
        place += span * (mixed + mixed.transpose(0, 2, 1)) + span**2 * speed + span**3 / 3 * push
        mixed += span * speed + span**2 / 2 * push
        speed += span * push
        cov[:, 2:, :2] = mixed.transpose(0, 2, 1)

    def turn(self, rows: IntArray, angle_rad: FloatArray, seconds: FloatArray) -> None:
        """The last `seconds` (M,) of some filters went along arcs that turned by angles (M,), not straight on."""
        step = np.zeros((len(rows), 4, 4))
        step[:, :2, :2] = np.eye(2)
        step[:, :2, 2:] = bend(angle_rad) * seconds[:, None, None]
        step[:, 2:, 2:] = _rotation(angle_rad)
        self.mean[rows] = (step @ self.mean[rows][..., None])[..., 0]
        self.cov[rows] = step @ self.cov[rows] @ step.transpose(0, 2, 1)

    def update(self, rows: IntArray, xy_world_m: FloatArray, noise_m2: FloatArray) -> None:
        """Take in a sighting of each of some filters (M,): places (M, 2) with covariances (M, 2, 2)."""
        mean, cov = self.mean[rows], self.cov[rows]
        gain = cov[:, :, :2] @ inverse_of(cov[:, :2, :2] + noise_m2)  # M 4 2
        self.mean[rows] = mean + (gain @ (xy_world_m - mean[:, :2])[..., None])[..., 0]
        cov = cov - gain @ cov[:, :2]
        self.cov[rows] = (cov + cov.transpose(0, 2, 1)) / 2

    def moves(self) -> BoolArray:
        """(N,) whether the velocity is certainly not zero."""
        speed, cov = self.mean[:, 2:], self.cov[:, 2:, 2:]
        return np.asarray(squared(speed, cov) > _CERTAIN**2)

    def rest(self, most_mps: float) -> BoolArray:
        """(N,) whether they stand, as far as is known: no faster than so much, and that well known."""
        known_mps = np.sqrt(self.cov[:, 2, 2] + self.cov[:, 3, 3])
        return np.asarray((np.hypot(*self.mean[:, 2:].T) < most_mps) & (known_mps < 2 * most_mps))

    def blur_m(self) -> FloatArray:
        """(N,) standard deviation of the place in the direction in which it is known least."""
        xx, yy, xy = self.cov[:, 0, 0], self.cov[:, 1, 1], self.cov[:, 0, 1]
        return np.asarray(np.sqrt((xx + yy) / 2 + np.hypot((xx - yy) / 2, xy)))


def bend(angle_rad: FloatArray) -> FloatArray:
    """(N, 2, 2) what leads from the end of a straight way to that of an arc as long, which turns by angles (N,)."""
    half = angle_rad / 2
    chord = np.divide(np.sin(half), half, out=np.ones_like(half), where=half != 0)
    result = chord[:, None, None] * _rotation(half)
    result[:, 0, 0] -= 1
    result[:, 1, 1] -= 1
    return np.asarray(result)


def _rotation(angle_rad: FloatArray) -> FloatArray:
    """(N, 2, 2) rotations by angles (N,)."""
    result = np.empty((len(angle_rad), 2, 2))
    result[:, 0, 0] = result[:, 1, 1] = np.cos(angle_rad)
    result[:, 1, 0] = sin = np.sin(angle_rad)
    result[:, 0, 1] = -sin
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


def squared(offset: FloatArray, cov: FloatArray) -> FloatArray:
    """Squared Mahalanobis lengths of offsets (..., 2) under covariances (..., 2, 2)."""
    x, y = offset[..., 0], offset[..., 1]
    shape = x * x * cov[..., 1, 1] - 2 * x * y * cov[..., 0, 1] + y * y * cov[..., 0, 0]
    return np.asarray(shape / determinant_of(cov))
