"""Results of nuScenes' detection benchmark: boxes in the world frame by sample, read from and written as JSON."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import AllowInfNan, Field, ValidationError

from appocc.checks import FloatArray
from appocc.errors import DataError
from appocc.files import write_json
from appocc.geometry import apply, quaternion_from_rotation, quaternion_from_yaw, rotation_from_quaternion
from appocc.jsonparts import JsonPart, first_problem
from appocc.objects import BEVObjects

# The benchmark's limit.
MOST_PER_SAMPLE = 500
# Attributes by kind, in motion and at rest, and the speed between them, as nuScenes' baselines choose them.
_ATTRIBUTES = {
    "car": ("vehicle.moving", "vehicle.parked"),
    "truck": ("vehicle.moving", "vehicle.parked"),
    "bus": ("vehicle.moving", "vehicle.stopped"),
    "motorcycle": ("cycle.with_rider", "cycle.without_rider"),
    "bicycle": ("cycle.with_rider", "cycle.without_rider"),
    "pedestrian": ("pedestrian.moving", "pedestrian.standing"),
}
_MOVING_MPS = 0.2
# What most do: the attribute of unknown velocities.
_PARKED = ("car", "truck")

_Vector = Annotated[list[float], Field(min_length=3, max_length=3)]
_Quaternion = Annotated[list[float], Field(min_length=4, max_length=4)]
_Share = Annotated[float, Field(ge=0, le=1)]
_Speed = Annotated[float, AllowInfNan()] | None


class ResultBox(JsonPart):
    """A box of the benchmark's results; `paint_rgb`, sRGB 0..255, is an extension."""

    translation: _Vector
    size: _Vector
    rotation: _Quaternion
    velocity: Annotated[list[_Speed], Field(min_length=2, max_length=2)] = [None, None]  # noqa: RUF012 - copied
    detection_name: str
    detection_score: _Share
    attribute_name: str = ""
    paint_rgb: _Vector | None = None


class _Results(JsonPart):
    results: dict[str, Any]


class _SampleResults(JsonPart):
    results: dict[str, list[ResultBox]]


def read_boxes(path: Path, content: Any, sample_tokens: Sequence[str]) -> list[list[ResultBox]]:
    """Return the boxes of samples from the JSON value of a results file; other samples are not validated.

    Raises:
        DataError: if the value is damaged or lacks a sample.
    """
    boxes = []
    try:
        results = _Results.model_validate(content).results
        for token in sample_tokens:
            if token not in results:
                raise DataError(f"{path}: expected boxes, or an empty list, for sample {token}, got nothing")
            boxes.append(_SampleResults.model_validate({"results": {token: results[token]}}).results[token])
    except ValidationError as error:
        raise DataError(f"{path}: expected detection results of nuScenes ({first_problem(error)})") from error
    return boxes


def result_boxes(objects: BEVObjects, world_from_ego: FloatArray) -> list[ResultBox]:
    """Return objects of a map as boxes in the world frame, best scores first; unknown velocities are 0.

    Args:
        objects: in the ego frame; only the best MOST_PER_SAMPLE are returned.
        world_from_ego: (4, 4) ego pose.
    """
    best = objects.select(np.argsort(-objects.score, kind="stable")[:MOST_PER_SAMPLE])
    turn = world_from_ego[:3, :3]
    centres = apply(world_from_ego, best.centre_m)
    rotations = turn @ rotation_from_quaternion(quaternion_from_yaw(best.yaw_rad).reshape(-1, 4))
    velocities = (np.pad(np.nan_to_num(best.velocity_mps), ((0, 0), (0, 1))) @ turn.T)[:, :2]
    unknown = np.isnan(best.velocity_mps).any(axis=1)
    moving = np.where(unknown, ~np.isin(best.kind, _PARKED), np.hypot(*velocities.T) > _MOVING_MPS)
    return [
        ResultBox(
            translation=centre.tolist(),
            size=size.tolist(),
            rotation=quaternion_from_rotation(rotation).tolist(),
            velocity=velocity.tolist(),
            detection_name=kind,
            detection_score=float(score),
            attribute_name=_ATTRIBUTES[kind][0 if moves else 1],
            paint_rgb=None if np.isnan(rgb).any() else rgb.tolist(),
        )
        for centre, size, rotation, velocity, moves, kind, score, rgb in zip(
            centres, best.size_wlh_m, rotations, velocities, moving, best.kind, best.score, best.rgb, strict=True
        )
    ]


def write_results(path: Path, boxes: Mapping[str, Sequence[ResultBox]]) -> None:
    """Write the boxes of a camera-only detector by sample token.

    Raises:
        DataError: if the file cannot be written.
    """
    results = {token: [{"sample_token": token, **box.model_dump()} for box in own] for token, own in boxes.items()}
    used = {f"use_{sensor}": sensor == "camera" for sensor in ("camera", "lidar", "radar", "map", "external")}
    write_json(path, {"meta": used, "results": results}, indent=None)
