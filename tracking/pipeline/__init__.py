"""Tracking pipeline: maps or detections of a recording in, tracks and files out."""

from tracking.pipeline.online import (
    DetectionFrame,
    OnlineTracker,
    best_scores,
    count_tracks,
    run_tracker,
    select_scores,
)
from tracking.pipeline.output_paths import check_apart, kitti_folder, people_path, tracks_folder
from tracking.pipeline.scenes import (
    SceneFrames,
    SceneTracks,
    read_key_frames,
    track_detections,
    track_maps,
    track_samples,
    track_scene,
    write_tracks,
)
from tracking.pipeline.sequences import (
    KittiTracks,
    people_config,
    track_kitti,
    track_people,
    track_sequence,
    write_kitti_tracks,
)

__all__ = [
    "DetectionFrame",
    "KittiTracks",
    "OnlineTracker",
    "SceneFrames",
    "SceneTracks",
    "best_scores",
    "check_apart",
    "count_tracks",
    "kitti_folder",
    "people_config",
    "people_path",
    "read_key_frames",
    "run_tracker",
    "select_scores",
    "track_detections",
    "track_kitti",
    "track_maps",
    "track_people",
    "track_samples",
    "track_scene",
    "track_sequence",
    "tracks_folder",
    "write_kitti_tracks",
    "write_tracks",
]
