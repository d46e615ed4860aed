"""Objects of the maps of a drive with what their tracks know: velocity and paint."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from appocc.bevmap import BEVMap
from appocc.checks import FloatArray
from appocc.objects import BEVObjects
from tracking.detections import Detections
from tracking.presets import OBJECTS
from tracking.tracker import Tracker
from tracking.tracks import Track

# A track knows its velocity from this detection on: the second one of a far vehicle is often that of its neighbour.
_DETECTIONS = 3
# Weight of a paint: falls with the square of the distance from here on, and with time: light and shadow change.
_NEAR_M, _FORGET_S = 8.0, 1.4


@dataclass
class _History:
    """What the detections of a track up to a time add up to: their number, and their paints (3,) with weights."""

    time_us: int
    detections: int = 0
    paint: FloatArray = field(default_factory=lambda: np.zeros(3))
    weight: float = 0.0

    def add(self, rgb: FloatArray, distance_m: float, time_us: int) -> None:
        """Add a detection; its paint (3,) may be unknown (NaN)."""
        kept = np.exp((self.time_us - time_us) * 1e-6 / _FORGET_S)
        self.detections, self.time_us = self.detections + 1, time_us
        self.paint, self.weight = kept * self.paint, kept * self.weight
        if np.isfinite(rgb).all():
            weight = max(distance_m, _NEAR_M) ** -2.0
            self.paint, self.weight = self.paint + weight * rgb, self.weight + weight


class TrackedObjects:
    """Track the objects of the maps of a drive, one map at a time.

    One map shows no motion, and networks compare two badly. The paint is the mean over the maps; near and recent ones
    weigh most. Places, headings, sizes and scores stay those of the map. Call `reset` before another drive.
    """

    def __init__(self) -> None:
        """Start without tracks."""
        self.reset()

    def reset(self) -> None:
        """Forget all maps: the next one is the first of a drive."""
        self._tracker = Tracker(OBJECTS)
        self._histories: dict[int, _History] = {}
        self._time_us: int | None = None

    def __call__(self, bev: BEVMap, timestamp_us: int, world_from_ego: FloatArray) -> BEVMap:
        """Return a map whose objects have what their tracks know; a map without objects as it is.

        Args:
            bev: the map after those before, in order of time; a time that is not later begins another drive.
            timestamp_us: its time, microseconds.
            world_from_ego: (4, 4) its ego pose.
        """
        if bev.objects is None:
            return bev
        if self._time_us is not None and timestamp_us <= self._time_us:
            self.reset()
        self._time_us = timestamp_us
        tracks = self._tracker.update(Detections.from_bev(bev), timestamp_us, world_from_ego)
        number = np.flatnonzero(bev.are_known(bev.objects))
        matched = {int(number[track.detection]): track for track in tracks if track.detection is not None}
        for i, track in matched.items():
            distance_m = float(np.hypot(*bev.objects.centre_m[i, :2]))
            history = self._histories.setdefault(track.id, _History(timestamp_us))
            history.add(bev.objects.rgb[i], distance_m, timestamp_us)
        oldest_us = timestamp_us - 1e6 * OBJECTS.lifecycle.forget_stationary_s
        self._histories = {track: own for track, own in self._histories.items() if own.time_us >= oldest_us}
        return replace(bev, objects=self._completed(bev.objects, matched, world_from_ego))

    def _completed(self, objects: BEVObjects, tracks: dict[int, Track], world_from_ego: FloatArray) -> BEVObjects:
        """Return objects with what their tracks know, by number of the object."""
        velocity_mps, rgb = objects.velocity_mps.copy(), objects.rgb.copy()
        ego_from_world = world_from_ego[:2, :2].T
        for i, track in tracks.items():
            history = self._histories[track.id]
            if history.detections >= _DETECTIONS and track.velocity_known:
                velocity_mps[i] = ego_from_world @ track.velocity_world_mps if track.moving else 0.0
            if history.weight > 0:
                rgb[i] = history.paint / history.weight
        return replace(objects, velocity_mps=velocity_mps, rgb=rgb)
