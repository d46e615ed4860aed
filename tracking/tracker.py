"""The tracker: detections of one moment after another in, tracks out."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from appocc.checks import BoolArray, FloatArray, IntArray, check_transform
from appocc.errors import DataError
from tracking.association.cascade import Rounds
from tracking.association.colour_likelihood import ColourTrust
from tracking.association.costs import AssociationConfig
from tracking.detections import Detections
from tracking.filtering.kalman import MotionConfig
from tracking.track_table import Followed, LifeConfig, Sightings, sightings_of
from tracking.tracks import Tracks

_AGAIN = AssociationConfig(gate_mps=20.0, gate_squared=30.0, gate_most_m=12.0, cost_most=15.0)
_FOUND = AssociationConfig(gate_m=1.0, gate_squared=12.0, gate_most_m=40.0, cost_most=3.0)
# So far off only a colour that few others have can tell that it is the same one; it may have turned.
_STRAYED = AssociationConfig(
    gate_m=1.0, gate_squared=12.0, gate_most_m=25.0, heading_cap=0.0, stray_mps=3.0, cost_most=0.0
)


@dataclass(frozen=True)
class TrackerConfig:
    """How tracks live, and which detections they may take.

    Attributes:
        clear: log-odds from which a detection may go to any track;
        weak: from these on to tracks that no clear one is left for, to keep them alive.
        begin: from these on a detection that no track took begins one.
        life: of tracks.
        association: of detections with tracks.
        again: of clear detections and tracks that are still without each other: faster than thought.
        found: of clear detections that are left with tracks that were lost;
        strayed: at last with tracks that went elsewhere while they were not seen.
        colour_doubt: how likely a colour is seen wrongly, before more is known; 1 leaves colour out.
    """

    clear: float = 0.5
    weak: float = -2.5
    begin: float = -2.5
    life: LifeConfig = field(default_factory=LifeConfig)
    association: AssociationConfig = field(default_factory=AssociationConfig)
    again: AssociationConfig = _AGAIN
    found: AssociationConfig = _FOUND
    strayed: AssociationConfig = _STRAYED
    colour_doubt: float = 0.02


# For blobs of maps, which flicker where a map is predicted: who is not sure must be seen twice.
# The centre of a blob jumps when vehicles begin to touch.
MAPS = TrackerConfig(
    life=LifeConfig(
        sure=2.2,
        confirm_s=0.15,
        coast_s=0.35,
        lost_s=2.2,
        motion=MotionConfig(push_m2ps3=2.0, swerve_m2ps3=0.2, along_m=0.3, across_m=0.3),
    ),
    association=AssociationConfig(gate_m=2.5, gate_mps=40.0, gate_most_m=20.0),
    again=replace(_AGAIN, gate_mps=12.0, gate_most_m=8.0),
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
        self._colours = ColourTrust(self.config.colour_doubt)

    def update(self, detections: Detections, timestamp_us: int, world_from_ego: FloatArray) -> Tracks:
        """Take in the detections of one moment and return the tracks that are told of, in order of id.

        Raises:
            DataError: if time does not move forward.
            ShapeError: if the pose is no rigid transform.
        """
        check_transform("world_from_ego", world_from_ego)
        seconds = self._predict(timestamp_us)
        kinds = np.array([self._kinds.setdefault(name, len(self._kinds)) for name in detections.kind], dtype=np.int64)
        seen = sightings_of(detections, world_from_ego, kinds, self.config.life.motion)
        # Of what a detector tells twice, one sighting is as good as none.
        seen = seen._replace(log_odds=np.where(detections.distinct(), seen.log_odds, -np.inf))
        left = self._associate(seen)
        alive = self._alive
        # In the ego frame; the inverse of a rotation is its transpose.
        places_m = (alive.place_world_m - world_from_ego[:3, 3]) @ world_from_ego[:3, :2]
        # Dropped are tracks unseen for too long, and unseen ones that left the view: who enters there is new.
        found = alive.detection >= 0
        alive.excuse(detections.view.blind(places_m) & ~found, seconds)
        keep = ~alive.dead & (detections.view.sees(places_m) | found)
        alive.keep(keep)
        # Unseen tracks whose places a detection covers: vehicles that touch, so that it is not a new one.
        (hidden,) = (alive.confirmed & (alive.detection < 0) & ~alive.lost).nonzero()
        below, above = detections.cover(places_m.compress(keep, axis=0).take(hidden, axis=0))
        new = left & (seen.log_odds >= self.config.begin)
        new[above] = False
        self._begin(new.nonzero()[0], seen)
        told = alive.told
        told[hidden[below]] = True
        return alive.tracks(told, tuple(self._kinds))

    def _predict(self, timestamp_us: int) -> float:
        """Move all tracks to a new time; by how many seconds."""
        seconds = 0.0
        if self._time_us is not None:
            if timestamp_us <= self._time_us:
                raise DataError(f"tracker: expected a time after {self._time_us} us, got {timestamp_us} us")
            seconds = (timestamp_us - self._time_us) * 1e-6
            if seconds > self.config.life.forget_resting_s:
                self._alive = Followed(self.config.life)
            self._alive.predict(seconds)
        self._time_us = timestamp_us
        return seconds

    def _associate(self, seen: Sightings) -> BoolArray:
        """Let tracks take sightings: clear ones, weak ones, clear ones farther off; at last who was lost or strayed.

        Returns:
            (M,) which sightings no track took.
        """
        alive, config = self._alive, self.config
        expected, shown = alive.expected(), alive.shown(seen)
        clear = seen.log_odds >= config.clear
        weak = ~clear & (seen.log_odds >= config.weak)
        rounds = Rounds(expected, shown)
        current = ~alive.lost
        pairs = rounds.pairs(current, np.ones_like(clear), config.association)
        self._colours.learn(pairs)
        pairs = self._colours.weighed(pairs)
        rounds.take(pairs, current, clear)
        rounds.take(pairs, alive.confirmed, weak)
        if (clear & rounds.left).any():
            coloured = clear & np.isfinite(shown.lab[:, 0]) & (config.colour_doubt < 1)
            for tracks, sights, rule in (
                (current, clear, config.again),
                (alive.lost, clear, config.found),
                (alive.known, coloured, config.strayed),
            ):
                rounds.take(self._colours.weighed(rounds.pairs(tracks, sights, rule)), tracks, sights)
        (found,) = (~rounds.free).nonzero()
        takes = rounds.takes[found]
        alive.see(found, seen.of(takes), takes, rounds.noise_m2[found], rounds.turn_rad[found])
        return rounds.left

    def _begin(self, columns: IntArray, seen: Sightings) -> None:
        """Begin tracks of sightings."""
        numbers = self._born + 1 + np.arange(len(columns))
        self._born += len(columns)
        self._alive.add(seen.of(columns), numbers, columns)
