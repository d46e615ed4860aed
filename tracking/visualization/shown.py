"""Tracks as boxes for viewers."""

from __future__ import annotations

import numpy as np

from appocc.geometry import quaternion_from_yaw, rotation_from_quaternion
from appocc.viewer.timeline import ShownBoxes
from tracking.pipeline import SceneTracks
from tracking.visualization.panels import corners_world, track_colour
from tracking.visualization.video import collect_trails


def shown_tracks(result: SceneTracks) -> list[ShownBoxes]:
    """Return the tracks of each key frame in the colours of the video, labelled "id class", with trails."""
    return [_shown(result, number) for number in range(len(result.samples))]


def _shown(result: SceneTracks, number: int) -> ShownBoxes:
    tracks = result.tracks[number]
    trails = collect_trails(result, number)
    corners = np.array([corners_world(track) for track in tracks]).reshape(-1, 8, 3)
    heights = np.ptp(corners[..., 2], axis=1)
    sizes = [(track.length_m, track.width_m, height) for track, height in zip(tracks, heights, strict=True)]
    yaw = np.array([track.yaw_world_rad for track in tracks])
    return ShownBoxes(
        corners.mean(axis=1),
        np.array(sizes).reshape(-1, 3),
        rotation_from_quaternion(quaternion_from_yaw(yaw)).reshape(-1, 3, 3),
        np.array([track_colour(track.id) for track in tracks], np.uint8).reshape(-1, 3),
        tuple(f"{track.id} {track.kind}" for track in tracks),
        tuple(str(track.id) for track in tracks),
        tuple(trails[track.id] for track in tracks),
    )
