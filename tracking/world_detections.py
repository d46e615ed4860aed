"""Detections of one frame in the world frame, with the measurement noise of their classes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from appocc.checks import BoolArray, FloatArray, IntArray
from tracking.association.costs import DetectionFeatures
from tracking.association.paint import paint_density
from tracking.class_models import ClassParameters, ClassTable
from tracking.compiled import compiled
from tracking.detections import Detections

# Columns of the attributes of a detection.
SIZE, RGB, LAB = slice(0, 3), slice(3, 6), slice(6, 9)
# Standard deviation of a detection's velocity, with which its track starts.
_VELOCITY_STD_MPS = 1.5
# Relative increase of the variance of a box whose object is hidden: only a part of it was seen.
_HIDDEN_VARIANCE = 0.5
# Minimum heading weight, of square shapes.
_MIN_AXIS_WEIGHT = 0.01


class WorldDetections(NamedTuple):
    """M detections of one frame in the world frame.

    Attributes:
        position_world_m: (M, 3) points on the ground below the centres.
        yaw_world_rad: (M,) headings.
        heading_known: (M,) whether the heading distinguishes front and rear.
        values: (M, 9) width, length, height, sRGB and CIELAB colour.
        noise_m2: (M, 2, 2) configured covariances of the positions, for association.
        surplus_noise_m2: (M, 2, 2) what they exceed the learnt covariances by.
        velocity_world_mps: (M, 2) measured velocities; 0 where unknown.
        velocity_m2ps2: (M, 2, 2) covariances of these, with which tracks start.
        axis: (M, 2) unit vectors at twice the heading, weighted by how elongated the shape is.
        log_odds: (M,) log-odds of being a vehicle, for thresholds.
        evidence: (M,) the same for the score, lower if the object is also detected as another category.
        truncated: (M,) whether a part may be missing.
        kind: (M,) category indices.
    """

    position_world_m: FloatArray
    yaw_world_rad: FloatArray
    heading_known: BoolArray
    values: FloatArray
    noise_m2: FloatArray
    surplus_noise_m2: FloatArray
    velocity_world_mps: FloatArray
    velocity_m2ps2: FloatArray
    axis: FloatArray
    log_odds: FloatArray
    evidence: FloatArray
    truncated: BoolArray
    kind: IntArray

    def select(self, columns: IntArray) -> WorldDetections:
        """Return the detections at indices (K,)."""
        return type(self)._make([each.take(columns, axis=0) for each in self])

    def features(self) -> DetectionFeatures:
        """Return the features for association."""
        lab = self.values[:, LAB].copy()
        return DetectionFeatures(
            xy_m=self.position_world_m[:, :2].copy(),
            noise_m2=self.noise_m2,
            yaw_rad=self.yaw_world_rad,
            size_m=self.values[:, :2].copy(),
            lab=lab,
            colour_density=paint_density(lab),
            kind=self.kind,
        )


def detections_in_world(
    detections: Detections, world_from_ego: FloatArray, classes: ClassTable, hidden: FloatArray
) -> WorldDetections:
    """Transform detections to the world frame, with the measurement noise of their classes.

    Args:
        detections: M detections in the ego frame.
        world_from_ego: (4, 4) ego pose.
        classes: models of the categories.
        hidden: (M,) shares that nearer boxes hide.
    """
    kind = classes.numbers(detections.kind)
    model = classes.parameters(kind)
    n = len(kind)
    position_m, yaw_rad, velocity_mps, axis = np.empty((n, 3)), np.empty(n), np.empty((n, 2)), np.empty((n, 2))
    noise_m2, surplus_m2, velocity_m2ps2 = np.empty((3, n, 2, 2))
    _transform(
        (position_m, yaw_rad, velocity_mps, velocity_m2ps2, axis, noise_m2, surplus_m2),
        np.array(world_from_ego, np.float64, order="C"),
        detections.ground_m,
        detections.yaw_rad,
        detections.size_m,
        detections.velocity_mps,
        detections.truncated,
        hidden,
        model,
        classes.noise_factor(kind, detections.log_odds),
    )
    return WorldDetections(
        position_world_m=position_m,
        yaw_world_rad=yaw_rad,
        heading_known=detections.heading_known,
        values=np.concatenate([detections.size_m, detections.rgb, detections.lab], axis=1),
        noise_m2=noise_m2,
        surplus_noise_m2=surplus_m2,
        velocity_world_mps=velocity_mps,
        velocity_m2ps2=velocity_m2ps2,
        axis=axis,
        log_odds=detections.log_odds,
        evidence=detections.log_odds,
        truncated=detections.truncated,
        kind=kind,
    )


@compiled
def _transform(
    result: tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray],
    world_from_ego: FloatArray,
    ground_m: FloatArray,
    yaw_rad: FloatArray,
    size_m: FloatArray,
    velocity_mps: FloatArray,
    truncated: BoolArray,
    hidden: FloatArray,
    model: ClassParameters,
    noise_factor: FloatArray,
) -> None:
    """Write to `result`, see `WorldDetections`.

    These are positions, headings, velocities and their covariances, axes, noises and surplus noises.
    """
    (position_m, yaw, velocity, velocity_m2ps2, axis, noise_m2, surplus_m2), turn = result, world_from_ego
    for i in range(len(yaw)):
        x, y, z = ground_m[i, 0], ground_m[i, 1], ground_m[i, 2]
        for k in range(3):
            position_m[i, k] = turn[k, 0] * x + turn[k, 1] * y + turn[k, 2] * z + turn[k, 3]
        for k in range(2):
            velocity[i, k] = turn[k, 0] * velocity_mps[i, 0] + turn[k, 1] * velocity_mps[i, 1]
        ahead, left = np.cos(yaw_rad[i]), np.sin(yaw_rad[i])
        yaw[i] = np.arctan2(turn[1, 0] * ahead + turn[1, 1] * left, turn[0, 0] * ahead + turn[0, 1] * left)
        cos, sin = np.cos(yaw[i]), np.sin(yaw[i])
        width_m, length_m = size_m[i, 0], size_m[i, 1]
        weight = max(abs(length_m - width_m) / (length_m + width_m), _MIN_AXIS_WEIGHT)
        axis[i, 0], axis[i, 1] = weight * (cos * cos - sin * sin), weight * 2 * cos * sin
        along, across = model.along_speed_std_mps[i], model.across_speed_std_mps[i]
        if np.isfinite(velocity[i, 0]):
            along = across = _VELOCITY_STD_MPS
        else:
            velocity[i, 0] = velocity[i, 1] = 0.0
            if truncated[i]:  # the heading of its box says little about the direction of motion
                across = along
        _orient(velocity_m2ps2, i, cos, sin, along, across)
        scale = np.sqrt(1 + _HIDDEN_VARIANCE * hidden[i])
        _orient(noise_m2, i, cos, sin, scale * model.along_std_m[i], scale * model.across_std_m[i])
        for j in range(2):
            for k in range(2):
                surplus_m2[i, j, k] = (1 - noise_factor[i]) * noise_m2[i, j, k]
            if truncated[i]:
                noise_m2[i, j, j] += model.truncated_std_m[i] ** 2


@compiled
def _orient(cov: FloatArray, i: int, cos: float, sin: float, along_std: float, across_std: float) -> None:
    """Write a covariance (2, 2) with standard deviations along and across a heading to `cov` (N, 2, 2)."""
    along, across = along_std**2, across_std**2
    cov[i, 0, 0] = along * cos * cos + across * sin * sin
    cov[i, 1, 1] = along * sin * sin + across * cos * cos
    cov[i, 0, 1] = cov[i, 1, 0] = (along - across) * cos * sin
