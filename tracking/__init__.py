"""Multi-object tracking of vehicles from bird's-eye-view maps or from detections.

Example: track the vehicles of the maps of a recording.

    from tracking import MAPS, Tracker, find_instances

    tracker = Tracker(MAPS)
    for bev, timestamp_us, world_from_ego in recording:
        detections = find_instances(bev).as_detections()
        for track in tracker.update(detections, timestamp_us, world_from_ego):
            print(track.id, track.position_world_m, track.speed_mps)

Boxes of a detector become detections by `Detections.from_boxes`.
"""

from tracking.detections import Detections
from tracking.instances.instances import find_instances
from tracking.presets import MAPS
from tracking.tracker import Tracker, TrackerConfig
from tracking.tracks import Track, Tracks

__all__ = ["MAPS", "Detections", "Track", "Tracker", "TrackerConfig", "Tracks", "find_instances"]
