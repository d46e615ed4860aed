"""KITTI tracking results: tracks inside the image, and a text file for each sequence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from appocc.checks import FloatArray
from appocc.files import write_bytes
from appocc.geometry import apply, inverse, wrap_angle
from tracking.detections import log_odds_from_probability
from tracking.io.kitti import HEIGHT_PX, WIDTH_PX, KittiFrame, KittiSequence, convert_yaw
from tracking.io.kitti_oxts import EGO_FROM_CAM
from tracking.tracks import Track
from tracking.vehicle_classes import HEIGHT_M

TYPES = {"pedestrian": "Pedestrian", "car": "Car", "bicycle": "Cyclist"}
_NEAR_M = 0.1
# Corners of a unit box, ahead, left and up: four at the bottom, then four at the top.
_RECTANGLE = ((0.5, 0.5), (0.5, -0.5), (-0.5, -0.5), (-0.5, 0.5))
_CORNERS = np.array([(*corner, up) for up in (0.0, 1.0) for corner in _RECTANGLE])
_RINGS = [(*pairwise(range(4)), (3, 0)), (*pairwise(range(4, 8)), (7, 4))]
_EDGES = np.array([*_RINGS[0], *_RINGS[1], *((i, i + 4) for i in range(4))])


@dataclass(frozen=True, kw_only=True, eq=False)
class KittiResult:
    """A track in the ego frame and the image of one frame.

    Attributes:
        id: track id.
        kind: category.
        score: log-odds of being an object; probabilities close to 1 would lose resolution.
        image_box_px: (4,) left, top, right, bottom in the image.
        ground_m: (3,) bottom centre, ego frame.
        yaw_rad: heading, ego frame.
        size_m: (3,) width, length, height.
    """

    id: int
    kind: str
    score: float
    image_box_px: FloatArray
    ground_m: FloatArray
    yaw_rad: float
    size_m: FloatArray


def kitti_results(sequence: KittiSequence, tracks: Sequence[Sequence[Track]]) -> tuple[tuple[KittiResult, ...], ...]:
    """Return the tracks inside the image of each of the T frames.

    The image box of a detected track is that of the detection, otherwise that of the projected 3D box.
    """
    return tuple(
        tuple(result for track in states if (result := _result(sequence.projection, frame, track)) is not None)
        for frame, states in zip(sequence.frames, tracks, strict=True)
    )


def kitti_score(probability: float) -> float:
    """Return the score of a result: the log-odds of a probability."""
    return float(log_odds_from_probability(np.array(probability))) if probability > 0 else -np.inf


def _result(projection: FloatArray, frame: KittiFrame, track: Track) -> KittiResult | None:
    ego_from_world = inverse(frame.world_from_ego)
    ground = apply(ego_from_world, track.position_world_m)
    ahead = ego_from_world[:3, :3] @ [np.cos(track.yaw_world_rad), np.sin(track.yaw_world_rad), 0.0]
    yaw = float(np.arctan2(ahead[1], ahead[0]))
    usual_m = HEIGHT_M.get(track.kind, HEIGHT_M["car"])
    size = np.array([track.width_m, track.length_m, track.height_m if np.isfinite(track.height_m) else usual_m])
    if track.detection is not None:
        image_box: FloatArray | None = frame.image_boxes_px[track.detection]
    else:
        image_box = project_box(projection, ground, yaw, size)
    if image_box is None:
        return None
    return KittiResult(
        id=track.id,
        kind=track.kind,
        score=kitti_score(track.score),
        image_box_px=image_box,
        ground_m=ground,
        yaw_rad=yaw,
        size_m=size,
    )


def project_box(
    projection: FloatArray, ground_m: FloatArray, yaw_rad: float, size_m: FloatArray
) -> FloatArray | None:
    """Return the image box (left, top, right, bottom; pixels) around the visible part of a 3D box.

    Args:
        projection: (3, 4) pixels from camera coordinates.
        ground_m: (3,) bottom centre, ego frame.
        yaw_rad: heading, ego frame.
        size_m: (3,) width, length, height.

    Returns:
        The box (4,) clipped to the image; None if the 3D box is behind the camera or outside the image.
    """
    width, length, height = size_m
    along, across, up = (_CORNERS * [length, width, height]).T
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    corners = ground_m + np.stack([along * cos - across * sin, along * sin + across * cos, up], axis=1)
    visible = _clip_near(corners @ EGO_FROM_CAM[:3, :3] @ projection[:, :3].T + projection[:, 3])
    if not len(visible):
        return None
    pixels = visible[:, :2] / visible[:, 2:]
    limits = np.array([WIDTH_PX - 1, HEIGHT_PX - 1])
    left_top, right_bottom = pixels.min(axis=0).clip(0, limits), pixels.max(axis=0).clip(0, limits)
    return np.concatenate([left_top, right_bottom]) if (left_top < right_bottom).all() else None


def _clip_near(corners: FloatArray) -> FloatArray:
    """Clip a box by the near plane: corners in front of it and intersections; (8, 3) -> (N, 3), homogeneous."""
    start, end = corners[_EDGES[:, 0]], corners[_EDGES[:, 1]]
    crossing = (start[:, 2] < _NEAR_M) != (end[:, 2] < _NEAR_M)
    start, end = start[crossing], end[crossing]
    share = (_NEAR_M - start[:, 2:]) / (end[:, 2:] - start[:, 2:])
    return np.concatenate([corners[corners[:, 2] >= _NEAR_M], start + share * (end - start)])


def write_kitti_results(path: Path, results: Sequence[Sequence[KittiResult]]) -> None:
    """Write rows `frame id type truncated occluded alpha x1 y1 x2 y2 h w l x y z ry score`; metres, radians, pixels.

    Truncation and occlusion are unknown (-1). Tracks of categories that KITTI lacks are written as Car.

    Raises:
        DataError: if the file cannot be written.
    """
    lines = [_line(number, result) for number, frame in enumerate(results) for result in frame]
    write_bytes(path, "".join(lines).encode())


def _line(frame: int, result: KittiResult) -> str:
    x, y, z = EGO_FROM_CAM[:3, :3].T @ result.ground_m
    width, length, height = result.size_m
    rotation_y = float(convert_yaw(np.array(result.yaw_rad)))
    alpha = float(wrap_angle(rotation_y - np.arctan2(x, z)))
    numbers = (alpha, *result.image_box_px, height, width, length, x, y, z, rotation_y)
    names = f"{frame} {result.id} {TYPES.get(result.kind, 'Car')} -1 -1"
    return " ".join([names, *(f"{number:.4f}" for number in numbers), f"{result.score:.6f}"]) + "\n"
