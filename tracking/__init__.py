"""Multi-object tracking of vehicles from bird's-eye-view maps or from detections.

Example: track the objects of the maps of a recording, or the vehicle instances of maps without objects.

    from tracking import MAPS, OBJECTS, Detections, Tracker

    tracker = Tracker(OBJECTS if with_objects else MAPS)
    for bev, timestamp_us, world_from_ego in recording:
        detections = Detections.from_bev(bev)
        for track in tracker.update(detections, timestamp_us, world_from_ego):
            print(track.id, track.position_world_m, track.speed_mps)

Boxes of a detector become detections by `Detections.from_boxes`.
"""

from tracking.detections import Detections
from tracking.instances.instances import find_instances
from tracking.presets import MAPS, OBJECTS
from tracking.tracker import Tracker, TrackerConfig
from tracking.tracks import Track, Tracks

__all__ = ["MAPS", "OBJECTS", "Detections", "Track", "Tracker", "TrackerConfig", "Tracks", "find_instances"]
