"""Tracks as KITTI tracking results: what of them is in the picture, and rows of text for each sequence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from appocc.checks import FloatArray
from appocc.files import write_bytes
from appocc.geometry import apply, inverse, wrap_angle
from tracking.detections import log_odds_of
from tracking.io.kitti import EGO_FROM_CAM, HEIGHT_PX, WIDTH_PX, KittiFrame, KittiSequence, ego_yaw
from tracking.tracks import Track

TYPES = {"pedestrian": "Pedestrian", "car": "Car", "bicycle": "Cyclist"}
# Of a track whose height no detection told.
HEIGHT_M = 1.5
_NEAR_M = 0.1
# The corners of a box: four around its floor, then four around its roof; lengthwise, to the left, upwards.
_ROUND = ((0.5, 0.5), (0.5, -0.5), (-0.5, -0.5), (-0.5, 0.5))
_CORNERS = np.array([(*corner, up) for up in (0.0, 1.0) for corner in _ROUND])
_RINGS = [(*pairwise(range(4)), (3, 0)), (*pairwise(range(4, 8)), (7, 4))]
_EDGES = np.array([*_RINGS[0], *_RINGS[1], *((i, i + 4) for i in range(4))])


@dataclass(frozen=True)
class KittiResult:
    """A track in a frame's own coordinates.

    Attributes:
        id: number of the track.
        kind: its category.
        score: certainty as log-odds, which tell sure tracks from surer ones better than probabilities.
        image_box_px: (4,) left, top, right, bottom in the picture.
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


def results_of(sequence: KittiSequence, tracks: Sequence[Sequence[Track]]) -> tuple[tuple[KittiResult, ...], ...]:
    """The tracks of each of the T frames that are in its picture.

    One that a detection was matched to has the detection's rectangle, the others that around their projected box.
    """
    return tuple(
        tuple(result for track in moment if (result := _result(sequence.projection, frame, track)) is not None)
        for frame, moment in zip(sequence.frames, tracks, strict=True)
    )


def _result(projection: FloatArray, frame: KittiFrame, track: Track) -> KittiResult | None:
    ego_from_world = inverse(frame.world_from_ego)
    ground = apply(ego_from_world, track.position_world_m)
    ahead = ego_from_world[:3, :3] @ [np.cos(track.yaw_world_rad), np.sin(track.yaw_world_rad), 0.0]
    yaw = float(np.arctan2(ahead[1], ahead[0]))
    size = np.array([track.width_m, track.length_m, track.height_m if np.isfinite(track.height_m) else HEIGHT_M])
    if track.detection is not None:
        rectangle: FloatArray | None = frame.image_boxes_px[track.detection]
    else:
        rectangle = projected_box(projection, ground, yaw, size)
    if rectangle is None:
        return None
    score = float(log_odds_of(np.array(track.score)))
    return KittiResult(track.id, track.kind, score, rectangle, ground, yaw, size)


def projected_box(
    projection: FloatArray, ground_m: FloatArray, yaw_rad: float, size_m: FloatArray
) -> FloatArray | None:
    """The least rectangle (left, top, right, bottom; pixels) around the part of a box that is in the picture's frame.

    Args:
        projection: (3, 4) pixels from camera coordinates.
        ground_m: (3,) bottom centre, ego frame.
        yaw_rad: heading, ego frame.
        size_m: (3,) width, length, height.

    Returns:
        The rectangle (4,) clipped to the picture; None if the box lies behind the camera or beside the picture.
    """
    width, length, height = size_m
    along, across, up = (_CORNERS * [length, width, height]).T
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    corners = ground_m + np.stack([along * cos - across * sin, along * sin + across * cos, up], axis=1)
    seen = _in_front(corners @ EGO_FROM_CAM[:3, :3] @ projection[:, :3].T + projection[:, 3])
    if not len(seen):
        return None
    pixels = seen[:, :2] / seen[:, 2:]
    limits = np.array([WIDTH_PX - 1, HEIGHT_PX - 1])
    left_top, right_bottom = pixels.min(axis=0).clip(0, limits), pixels.max(axis=0).clip(0, limits)
    return np.concatenate([left_top, right_bottom]) if (left_top < right_bottom).all() else None


def _in_front(corners: FloatArray) -> FloatArray:
    """The corners in front of the camera, and where edges come out from behind it; (8, 3) -> (N, 3), homogeneous."""
    start, end = corners[_EDGES[:, 0]], corners[_EDGES[:, 1]]
    crossing = (start[:, 2] < _NEAR_M) != (end[:, 2] < _NEAR_M)
    start, end = start[crossing], end[crossing]
    share = (_NEAR_M - start[:, 2:]) / (end[:, 2:] - start[:, 2:])
    return np.concatenate([corners[corners[:, 2] >= _NEAR_M], start + share * (end - start)])


def write_results(path: Path, results: Sequence[Sequence[KittiResult]]) -> None:
    """Write rows `frame id type truncated occluded alpha x1 y1 x2 y2 h w l x y z ry score`; metres, radians, pixels.

    Truncation and occlusion are not known (-1). A track of another kind than KITTI's is a Car.

    Raises:
        DataError: if the file cannot be written.
    """
    lines = [_line(number, result) for number, moment in enumerate(results) for result in moment]
    write_bytes(path, "".join(lines).encode())


def _line(frame: int, result: KittiResult) -> str:
    x, y, z = EGO_FROM_CAM[:3, :3].T @ result.ground_m
    width, length, height = result.size_m
    rotation_y = float(ego_yaw(np.array(result.yaw_rad)))
    alpha = float(wrap_angle(rotation_y - np.arctan2(x, z)))
    numbers = (alpha, *result.image_box_px, height, width, length, x, y, z, rotation_y)
    names = f"{frame} {result.id} {TYPES.get(result.kind, 'Car')} -1 -1"
    return " ".join([names, *(f"{number:.4f}" for number in numbers), f"{result.score:.6f}"]) + "\n"
