"""Detections of one frame in the world frame, with the measurement noise of their classes."""

from __future__ import annotations

import numpy as np

from appocc.checks import BoolArray, FloatArray, IntArray
from tracking.association.paint import paint_density
from tracking.class_models import ClassTable
from tracking.compiled import compiled
from tracking.detections import Detections
from tracking.records import DETECTION, Records

# Standard deviation of a detection's velocity, with which its track starts.
_VELOCITY_STD_MPS = 1.5
# Relative increase of the variance of a box whose object is hidden: only a part of it was seen.
_HIDDEN_VARIANCE = 0.5
# Minimum heading weight, of square shapes.
_MIN_AXIS_WEIGHT = 0.01


def detections_in_world(
    detections: Detections, world_from_ego: FloatArray, classes: ClassTable, hidden: FloatArray
) -> Records:
    """Transform detections to the world frame, with the measurement noise of their classes.

    Args:
        detections: M detections in the ego frame.
        world_from_ego: (4, 4) ego pose.
        classes: models of the categories.
        hidden: (M,) shares that nearer boxes hide.

    Returns:
        M records of `DETECTION`.
    """
    found = np.empty(len(detections), DETECTION)
    _fill(
        found,
        np.array(world_from_ego, np.float64, order="C"),
        detections.ground_m,
        detections.yaw_rad,
        detections.heading_known,
        detections.size_m,
        detections.log_odds,
        detections.rgb,
        detections.lab,
        detections.velocity_mps,
        detections.truncated,
        hidden,
        paint_density(detections.lab),
        classes.numbers(detections.kind),
        classes.noise_level(detections.log_odds),
        classes.models,
        classes.noise_factors,
    )
    return found


@compiled
def _fill(
    found: Records,
    world_from_ego: FloatArray,
    ground_m: FloatArray,
    yaw_rad: FloatArray,
    heading_known: BoolArray,
    size_m: FloatArray,
    log_odds: FloatArray,
    rgb: FloatArray,
    lab: FloatArray,
    velocity_mps: FloatArray,
    truncated: BoolArray,
    hidden: FloatArray,
    colour_density: FloatArray,
    kind: IntArray,
    noise_level: IntArray,
    models: Records,
    noise_factors: FloatArray,
) -> None:
    """See `detections_in_world`; written to `found`."""
    turn = world_from_ego
    for i in range(len(found)):
        seen, model = found[i], models[kind[i]]
        seen.heading_known, seen.truncated = heading_known[i], truncated[i]
        seen.kind, seen.noise_level, seen.colour_density = kind[i], noise_level[i], colour_density[i]
        seen.log_odds = seen.evidence = log_odds[i]
        position, velocity = seen.position_world_m, seen.velocity_world_mps
        for k in range(3):
            seen.size_m[k], seen.rgb[k], seen.lab[k] = size_m[i, k], rgb[i, k], lab[i, k]
            position[k] = turn[k, 0] * ground_m[i, 0] + turn[k, 1] * ground_m[i, 1] + turn[k, 2] * ground_m[i, 2]
            position[k] += turn[k, 3]
        for k in range(2):
            velocity[k] = turn[k, 0] * velocity_mps[i, 0] + turn[k, 1] * velocity_mps[i, 1]
        ahead, left = np.cos(yaw_rad[i]), np.sin(yaw_rad[i])
        seen.yaw_world_rad = np.arctan2(
            turn[1, 0] * ahead + turn[1, 1] * left, turn[0, 0] * ahead + turn[0, 1] * left
        )
        cos, sin = np.cos(seen.yaw_world_rad), np.sin(seen.yaw_world_rad)
        width_m, length_m = size_m[i, 0], size_m[i, 1]
        weight = max(abs(length_m - width_m) / (length_m + width_m), _MIN_AXIS_WEIGHT)
        seen.axis[0], seen.axis[1] = weight * (cos * cos - sin * sin), weight * 2 * cos * sin
        along, across = model.along_speed_std_mps, model.across_speed_std_mps
        if np.isfinite(velocity[0]):
            along = across = _VELOCITY_STD_MPS
        else:
            velocity[0] = velocity[1] = 0.0
            if seen.truncated:  # the heading of its box says little about the direction of motion
                across = along
        _orient(seen.velocity_m2ps2, cos, sin, along, across)
        scale = np.sqrt(1 + _HIDDEN_VARIANCE * hidden[i])
        _orient(seen.noise_m2, cos, sin, scale * model.along_std_m, scale * model.across_std_m)
        factor = noise_factors[seen.noise_level, seen.kind]
        for j in range(2):
            for k in range(2):
                seen.surplus_noise_m2[j, k] = (1 - factor) * seen.noise_m2[j, k]
            if seen.truncated:
                seen.noise_m2[j, j] += model.truncated_std_m**2


@compiled
def _orient(cov: FloatArray, cos: float, sin: float, along_std: float, across_std: float) -> None:
    """Write a covariance with standard deviations along and across a heading to `cov` (2, 2)."""
    along, across = along_std**2, across_std**2
    cov[0, 0] = along * cos * cos + across * sin * sin
    cov[1, 1] = along * sin * sin + across * cos * cos
    cov[0, 1] = cov[1, 0] = (along - across) * cos * sin
