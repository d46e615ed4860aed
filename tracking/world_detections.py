"""Detections of one frame in the world frame, with the measurement noise of their classes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from appocc.checks import BoolArray, FloatArray, IntArray
from appocc.geometry import apply
from tracking.association.costs import DetectionFeatures
from tracking.association.paint import paint_density
from tracking.class_models import ClassTable
from tracking.detections import Detections
from tracking.filtering.kalman import oriented_covariance

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
    model, rotation = classes.parameters(kind), world_from_ego[:2, :2]
    x, y = rotation @ np.array([np.cos(detections.yaw_rad), np.sin(detections.yaw_rad)])
    yaw_rad = np.arctan2(y, x)
    noise_m2 = oriented_covariance(yaw_rad, model.along_std_m**2, model.across_std_m**2)
    truncated_m2 = (model.truncated_std_m * detections.truncated) ** 2
    return WorldDetections(
        position_world_m=apply(world_from_ego, detections.ground_m),
        yaw_world_rad=yaw_rad,
        heading_known=detections.heading_known,
        values=np.concatenate([detections.size_m, detections.rgb, detections.lab], axis=1),
        noise_m2=noise_m2 + truncated_m2[:, None, None] * np.eye(2),
        surplus_noise_m2=(1 - classes.noise_factor(kind, detections.log_odds))[:, None, None] * noise_m2,
        velocity_world_mps=detections.velocity_mps @ rotation.T,
        axis=_weighted_axis(yaw_rad, detections.size_m),
        log_odds=detections.log_odds,
        evidence=detections.log_odds,
        truncated=detections.truncated,
        kind=kind,
    )


def _weighted_axis(yaw_rad: FloatArray, size_m: FloatArray) -> FloatArray:
    """(M, 2) unit vectors at twice the heading (M,), weighted by the elongation of sizes (M, 3)."""
    width, length, _ = size_m.T
    weight = np.maximum(np.abs(length - width) / (length + width), _MIN_AXIS_WEIGHT)
    twice = 2 * yaw_rad
    return np.asarray((weight * np.array([np.cos(twice), np.sin(twice)])).T)
