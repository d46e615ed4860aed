"""The tracker: detections of one moment after another in, tracks out."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from appocc.checks import BoolArray, FloatArray, IntArray, check_transform
from appocc.errors import DataError
from appocc.geometry import apply, inverse
from tracking.association import AssociationConfig, Predicted, Seen, associate, noise_of
from tracking.detections import Detections
from tracking.follow import Followed, LifeConfig, Sightings, sightings_of
from tracking.motion import MotionConfig
from tracking.tracks import Tracks


@dataclass(frozen=True)
class TrackerConfig:
    """How tracks live, and which detections they may take.

    Attributes:
        clear: log-odds from which a detection may go to any track;
        weak: from these on to tracks that no clear one is left for, to keep them alive.
        begin: from these on a detection that no track took begins one.
        life: of tracks.
        association: of detections with tracks.
        again: of clear detections and tracks that are still without each other: found again, or faster than thought.
    """

    clear: float = 0.5
    weak: float = -2.5
    begin: float = -2.5
    life: LifeConfig = field(default_factory=LifeConfig)
    association: AssociationConfig = field(default_factory=AssociationConfig)
    again: AssociationConfig = field(default_factory=lambda: AssociationConfig(gate_squared=30.0, gate_most_m=8.0))


# For blobs of maps, which flicker where a map is predicted: who is not sure must be seen twice.
# The centre of a blob jumps when vehicles begin to touch.
MAPS = TrackerConfig(
    life=LifeConfig(
        sure=2.2,
        confirm_s=0.15,
        coast_s=0.35,
        die_s=2.2,
        motion=MotionConfig(push_m2ps3=2.0, swerve_m2ps3=0.2, along_m=0.3, across_m=0.3),
    ),
    association=AssociationConfig(gate_m=2.5, gate_mps=40.0, gate_most_m=10.0),
)


class Tracker:
    """Follows vehicles in the world frame, where the ego's own motion cancels; the same input gives the same ids.

    It never looks ahead, and remembers no more the longer it runs.
    """

    def __init__(self, config: TrackerConfig | None = None) -> None:
        """Start with no tracks."""
        self.config = config or TrackerConfig()
        self._alive = Followed(self.config.life)
        self._kinds: dict[str, int] = {}
        self._time_us: int | None = None
        self._born = 0

    def update(self, detections: Detections, timestamp_us: int, world_from_ego: FloatArray) -> Tracks:
        """Take in the detections of one moment and return the tracks that are told of, in order of id.

        Raises:
            DataError: if time does not move forward.
            ShapeError: if the pose is no rigid transform.
        """
        check_transform("world_from_ego", world_from_ego)
        self._predict(timestamp_us)
        kinds = [self._kinds.setdefault(name, len(self._kinds)) for name in detections.kind]
        seen = sightings_of(detections, world_from_ego, np.array(kinds, dtype=np.int64))
        taken = self._associate(seen)
        self._bury(detections, world_from_ego)
        # Unseen tracks whose places a detection covers: vehicles that touch, so that it is not a new one.
        hidden = np.flatnonzero(self._alive.confirmed & (self._alive.detection < 0))
        covered = detections.cover(self._places_ego(world_from_ego)[hidden])
        free = ~taken & (seen.log_odds >= self.config.begin) & ~covered.any(axis=0)
        self._begin(np.flatnonzero(free), seen)
        told = self._alive.told
        told[hidden] |= covered.any(axis=1)
        return self._alive.tracks(told, tuple(self._kinds))

    def _predict(self, timestamp_us: int) -> None:
        """Move all tracks to a new time."""
        if self._time_us is not None:
            if timestamp_us <= self._time_us:
                raise DataError(f"tracker: expected a time after {self._time_us} us, got {timestamp_us} us")
            self._alive.predict((timestamp_us - self._time_us) * 1e-6)
        self._time_us = timestamp_us

    def _associate(self, seen: Sightings) -> BoolArray:
        """(M,) whether a track took a sighting: clear ones, weak ones, and then clear ones farther off."""
        taken = np.zeros(len(seen.log_odds), dtype=np.bool_)
        expected, shown = self._alive.expected(), self._alive.shown(seen)
        config, alive = self.config, self._alive
        clear = seen.log_odds >= config.clear
        weak = ~clear & (seen.log_odds >= config.weak)
        for sights, rule in ((clear, config.association), (weak, config.association), (clear, config.again)):
            lack = (alive.detection < 0) & (alive.confirmed | (sights is clear))
            self._take(np.flatnonzero(lack), np.flatnonzero(sights & ~taken), expected, shown, seen, rule, taken)
        return taken

    def _take(
        self,
        rows: IntArray,
        columns: IntArray,
        expected: Predicted,
        shown: Seen,
        seen: Sightings,
        rule: AssociationConfig,
        taken: BoolArray,
    ) -> None:
        """Let some tracks take some sightings, and note which."""
        if not len(rows) or not len(columns):
            return
        i, j = associate(expected.of(rows), shown.of(columns), rule)
        rows, columns = rows[i], columns[j]
        self._alive.see(rows, seen.of(columns), columns, noise_of(expected.of(rows), shown.of(columns)))
        taken[columns] = True

    def _begin(self, columns: IntArray, seen: Sightings) -> None:
        """Begin tracks of sightings."""
        numbers = self._born + 1 + np.arange(len(columns))
        self._born += len(columns)
        self._alive.add(seen.of(columns), numbers, columns)

    def _bury(self, detections: Detections, world_from_ego: FloatArray) -> None:
        """Drop tracks that were unseen for too long, and unseen ones that left the view: who enters there is new."""
        alive = self._alive
        inside = detections.view.sees(self._places_ego(world_from_ego))
        alive.keep(~alive.dead & (inside | (alive.detection >= 0)))

    def _places_ego(self, world_from_ego: FloatArray) -> FloatArray:
        """(N, 2) places of tracks in the ego frame."""
        return apply(inverse(world_from_ego), self._alive.place_world_m)[:, :2]
