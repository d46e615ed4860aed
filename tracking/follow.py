"""One vehicle that is followed: its motion, heading, size, colour, and where it stands in its life."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from appocc.checks import FloatArray
from appocc.geometry import apply, wrap_angle
from tracking.blobs import Blobs
from tracking.motion import Motion, MotionConfig
from tracking.tracks import Memory, Track


@dataclass(frozen=True)
class LifeConfig:
    """Life cycle and smoothing; all times in seconds, so that frame rates and gaps do not matter.

    Attributes:
        sure_confidence: a blob of this confidence makes a track at once ...
        confirm_s: ... others when they were seen, without a miss, over this span.
        coast_s: how long a track that is not seen is still told of, at its predicted place.
        die_s: how long it is kept to be found again, and told of while its place is covered by vehicle cells.
        heading_s: time constant of the heading.
        turn_mps: speed from which motion says where the front is.
        sightings: how many sightings size and colour are the median of.
    """

    sure_confidence: float = 0.9
    confirm_s: float = 0.15
    coast_s: float = 0.35
    die_s: float = 2.2
    heading_s: float = 0.4
    turn_mps: float = 1.0
    sightings: int = 11
    motion: MotionConfig = field(default_factory=MotionConfig)


@dataclass(frozen=True)
class Sighting:
    """A blob in the world frame.

    Attributes:
        place_world_m: (3,) its centroid, on the ego's ground plane.
        yaw_world_rad: direction of its long axis, front and rear unknown.
        size_m: (2,) length and width.
        rgb: (3,) colour, NaN if unknown.
        confidence: mean vehicle probability.
        cut: whether it touches the rim of the grid.
    """

    place_world_m: FloatArray
    yaw_world_rad: float
    size_m: FloatArray
    rgb: FloatArray
    confidence: float
    cut: bool


def sightings(blobs: Blobs, world_from_ego: FloatArray) -> list[Sighting]:
    """The blobs of an ego frame in the world frame."""
    places = apply(world_from_ego, np.pad(blobs.centroid_m, ((0, 0), (0, 1))))
    axes = np.stack([np.cos(blobs.yaw_rad), np.sin(blobs.yaw_rad), np.zeros(len(blobs))], axis=1)
    axes = axes @ world_from_ego[:3, :3].T
    yaws = np.arctan2(axes[:, 1], axes[:, 0])
    sizes = np.stack([blobs.length_m, blobs.width_m], axis=1)
    return [
        Sighting(
            places[i],
            float(yaws[i]),
            sizes[i],
            blobs.rgb[i],
            float(blobs.confidence[i]),
            bool(blobs.touches_border[i]),
        )
        for i in range(len(blobs))
    ]


class Followed:
    """A vehicle from its first sighting to its end; changed in place by `predict`, `see` and `miss`."""

    def __init__(self, first: Sighting, number: int, config: LifeConfig) -> None:
        """Begin with a first sighting."""
        self.number = number
        self._config = config
        sigma_m = config.motion.cut_blob_m if first.cut else config.motion.blob_m
        self.motion = Motion(first.place_world_m[:2], sigma_m, config.motion)
        self._memory = Memory(config.sightings)
        self._axis = np.zeros(2)
        self._yaw_rad = first.yaw_world_rad
        self._heading_known = False
        self._confidences = 0.0
        self._hits = 0
        self._seen_s = 0.0
        self.unseen_s = 0.0
        self.confirmed = False
        self._remember(first)

    def blurs_m2(self, lengths_m: FloatArray) -> FloatArray:
        """(M,) variance of either component of the centroids of blobs of such lengths (M,), if they are this vehicle.

        Where a blob is longer than the vehicle it merges with another, where it is shorter a part is missing: the
        vehicle lies anywhere within the difference (a uniform distribution: its square over 12).
        """
        surplus_m = lengths_m - self._memory.median()[0]
        return np.asarray(self._config.motion.blob_m**2 + surplus_m**2 / 12)

    @property
    def dead(self) -> bool:
        """Whether it was out of sight for too long; before it is confirmed, any miss is."""
        return self.unseen_s > (self._config.die_s if self.confirmed else 0.0)

    def predict(self, seconds: float) -> None:
        """Let time pass; it counts as unseen until `see` is called."""
        self.motion.predict(seconds)
        self.unseen_s += seconds

    def see(self, sighting: Sighting) -> None:
        """Take in a sighting of now."""
        blur_m2 = float(self.blurs_m2(sighting.size_m[:1])[0])
        self.motion.update(sighting.place_world_m[:2], blur_m2**0.5)
        self._remember(sighting)

    def _remember(self, sighting: Sighting) -> None:
        """All that a sighting tells besides the place."""
        config = self._config
        self._turn(sighting, self.unseen_s)
        self._seen_s += self.unseen_s
        self.unseen_s = 0.0
        self._hits += 1
        self._confidences += sighting.confidence
        self.confirmed |= sighting.confidence >= config.sure_confidence or self._seen_s >= config.confirm_s
        self._ground_m = float(sighting.place_world_m[2])
        # A vehicle that the rim cuts off is at least as large as what shows of it.
        known_m = self._memory.median()[:2] if sighting.cut and self._hits > 1 else np.zeros(2)
        size = np.maximum(sighting.size_m, known_m)
        self._memory.add(np.concatenate([size, sighting.rgb]))

    def _turn(self, sighting: Sighting, seconds: float) -> None:
        """Smooth the axis, as a vector of twice its angle; long shapes show it better than square ones."""
        long, wide = sighting.size_m
        twice = 2 * sighting.yaw_world_rad
        seen = (long - wide) / (long + wide) * np.array([np.cos(twice), np.sin(twice)])
        keep = np.exp(-seconds / self._config.heading_s) if self._hits else 0.0
        self._axis = keep * self._axis + (1 - keep) * seen
        yaw = float(np.arctan2(self._axis[1], self._axis[0]) / 2)
        velocity = self.motion.velocity_mps
        if self.motion.moves and np.hypot(*velocity) >= self._config.turn_mps:
            self._heading_known, wanted = True, float(np.arctan2(velocity[1], velocity[0]))
        else:
            wanted = self._yaw_rad
        self._yaw_rad = yaw if np.cos(yaw - wanted) >= 0 else float(wrap_angle(yaw + np.pi))

    @property
    def position_world_m(self) -> FloatArray:
        """(3,) place on the ground."""
        return np.append(self.motion.position_m, self._ground_m)

    @property
    def rgb(self) -> FloatArray:
        """(3,) colour, NaN if never seen."""
        return self._memory.median()[2:]

    def track(self) -> Track:
        """What is known now."""
        median = self._memory.median()
        return Track(
            self.number,
            self.position_world_m,
            self.motion.velocity_mps,
            self._yaw_rad,
            self._heading_known,
            float(median[0]),
            float(median[1]),
            median[2:],
            self._confidences / self._hits,
            self.unseen_s == 0.0,
        )
