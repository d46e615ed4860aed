"""Detections of one frame in the world frame, with the measurement noise of their classes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from appocc.checks import BoolArray, FloatArray, IntArray
from tracking.association.costs import DetectionFeatures
from tracking.association.paint import paint_density
from tracking.class_models import ClassTable
from tracking.compiled import compiled
from tracking.detections import Detections

# Columns of the attributes of a detection.
SIZE, RGB, LAB = slice(0, 3), slice(3, 6), slice(6, 9)
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
        velocity_world_mps: (M, 2) measured velocities; NaN where unknown.
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


def detections_in_world(detections: Detections, world_from_ego: FloatArray, classes: ClassTable) -> WorldDetections:
    """Transform detections to the world frame, with the measurement noise of their classes."""
    kind = classes.numbers(detections.kind)
    model = classes.parameters(kind)
    n = len(kind)
    position_m, yaw_rad, velocity_mps, axis = np.empty((n, 3)), np.empty(n), np.empty((n, 2)), np.empty((n, 2))
    noise_m2, surplus_m2 = np.empty((n, 2, 2)), np.empty((n, 2, 2))
    _transform(
        (position_m, yaw_rad, velocity_mps, axis, noise_m2, surplus_m2),
        np.array(world_from_ego, np.float64, order="C"),
        detections.ground_m,
        detections.yaw_rad,
        detections.size_m,
        detections.velocity_mps,
        detections.truncated,
        model.along_std_m,
        model.across_std_m,
        model.truncated_std_m,
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
        axis=axis,
        log_odds=detections.log_odds,
        evidence=detections.log_odds,
        truncated=detections.truncated,
        kind=kind,
    )


@compiled
def _transform(
    result: tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray],
    world_from_ego: FloatArray,
    ground_m: FloatArray,
    yaw_rad: FloatArray,
    size_m: FloatArray,
    velocity_mps: FloatArray,
    truncated: BoolArray,
    along_std_m: FloatArray,
    across_std_m: FloatArray,
    truncated_std_m: FloatArray,
    noise_factor: FloatArray,
) -> None:
    """Write positions, headings, velocities, axes, noises and surplus noises to `result`, see `WorldDetections`."""
    (position_m, yaw, velocity, axis, noise_m2, surplus_m2), turn = result, world_from_ego
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
        along_m2, across_m2 = along_std_m[i] ** 2, across_std_m[i] ** 2
        noise_m2[i, 0, 0] = along_m2 * cos * cos + across_m2 * sin * sin
        noise_m2[i, 1, 1] = along_m2 * sin * sin + across_m2 * cos * cos
        noise_m2[i, 0, 1] = noise_m2[i, 1, 0] = (along_m2 - across_m2) * cos * sin
        for j in range(2):
            for k in range(2):
                surplus_m2[i, j, k] = (1 - noise_factor[i]) * noise_m2[i, j, k]
            if truncated[i]:
                noise_m2[i, j, j] += truncated_std_m[i] ** 2
