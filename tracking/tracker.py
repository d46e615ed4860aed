"""The tracker: blobs of one moment after another in, tracks out."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from appocc.checks import FloatArray, IntArray, check_transform
from appocc.errors import DataError
from appocc.geometry import apply, inverse
from appocc.grid import BEVGrid
from tracking.association import AssociationConfig, associate
from tracking.blobs import Blobs
from tracking.follow import Followed, LifeConfig, Sighting, sightings
from tracking.tracks import Track


@dataclass(frozen=True)
class TrackerConfig:
    """How tracks live, and which blobs they may take."""

    life: LifeConfig = field(default_factory=LifeConfig)
    association: AssociationConfig = field(default_factory=AssociationConfig)


class Tracker:
    """Follows vehicles in the world frame, where the ego's own motion cancels; the same input gives the same ids."""

    def __init__(self, config: TrackerConfig | None = None) -> None:
        """Start with no tracks."""
        self.config = config or TrackerConfig()
        self._alive: list[Followed] = []
        self._time_us: int | None = None
        self._born = 0

    def update(self, blobs: Blobs, timestamp_us: int, world_from_ego: FloatArray) -> tuple[Track, ...]:
        """Take in the blobs of one moment and return the confirmed tracks, in order of id.

        Raises:
            DataError: if time does not move forward.
            ShapeError: if the pose is no rigid transform.
        """
        check_transform("world_from_ego", world_from_ego)
        self._predict(timestamp_us)
        seen = sightings(blobs, world_from_ego)
        rows, columns = self._associate(seen)
        for row, column in zip(rows, columns, strict=True):
            self._alive[row].see(seen[column])
        self._bury(blobs.grid, world_from_ego)
        for column in sorted(set(range(len(seen))) - set(columns.tolist()) - self._merged(blobs, world_from_ego)):
            self._born += 1
            self._alive.append(Followed(seen[column], self._born, self.config.life))
        return self._told(blobs, world_from_ego)

    def _predict(self, timestamp_us: int) -> None:
        """Move all tracks to a new time."""
        if self._time_us is not None:
            if timestamp_us <= self._time_us:
                raise DataError(f"tracker: expected a time after {self._time_us} us, got {timestamp_us} us")
            for followed in self._alive:
                followed.predict((timestamp_us - self._time_us) * 1e-6)
        self._time_us = timestamp_us

    def _associate(self, seen: list[Sighting]) -> tuple[IntArray, IntArray]:
        """Rows of tracks and columns of sightings that belong together."""
        if not self._alive or not seen:
            return np.zeros(0, np.int64), np.zeros(0, np.int64)
        lengths = np.array([sighting.size_m[0] for sighting in seen])
        return associate(
            np.stack([followed.motion.position_m for followed in self._alive]),
            np.stack([followed.motion.variance_m2 + followed.blurs_m2(lengths) for followed in self._alive]),
            np.stack([followed.rgb for followed in self._alive]),
            np.stack([sighting.place_world_m[:2] for sighting in seen]),
            np.stack([sighting.rgb for sighting in seen]),
            self.config.association,
        )

    def _bury(self, grid: BEVGrid, world_from_ego: FloatArray) -> None:
        """Drop tracks that were unseen for too long, and unseen ones that left the grid: who enters there is new."""
        inside = grid.contains(grid.cell_of(self._places_ego(self._alive, world_from_ego)))
        self._alive = [
            followed
            for followed, within in zip(self._alive, inside, strict=True)
            if not followed.dead and (within or not followed.unseen_s)
        ]

    def _merged(self, blobs: Blobs, world_from_ego: FloatArray) -> set[int]:
        """Blobs over the places of confirmed tracks that were not seen: vehicles that touch, not a new one."""
        hidden = [followed for followed in self._alive if followed.confirmed and followed.unseen_s]
        return set(np.flatnonzero(blobs.cover(self._places_ego(hidden, world_from_ego)).any(axis=0)).tolist())

    def _told(self, blobs: Blobs, world_from_ego: FloatArray) -> tuple[Track, ...]:
        """The confirmed tracks that are seen, briefly unseen, or hidden in a blob that another track took."""
        confirmed = [followed for followed in self._alive if followed.confirmed]
        covered = np.asarray(blobs.cover(self._places_ego(confirmed, world_from_ego)).any(axis=1))
        return tuple(
            followed.track()
            for followed, hidden in zip(confirmed, covered, strict=True)
            if hidden or followed.unseen_s <= self.config.life.coast_s
        )

    @staticmethod
    def _places_ego(some: list[Followed], world_from_ego: FloatArray) -> FloatArray:
        """(N, 2) places of tracks in the ego frame."""
        places = np.array([followed.position_world_m for followed in some]).reshape(-1, 3)
        return apply(inverse(world_from_ego), places)[:, :2]
