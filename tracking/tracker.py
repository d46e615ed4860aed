"""Online multi-object tracker: detections of one frame after another in, tracks out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from numbers import Integral

import numpy as np
from numpy.typing import ArrayLike

from appocc.checks import BoolArray, IntArray, as_array, check_transform
from appocc.errors import DataError, ShapeError
from tracking.association.cascade import MatchingCascade
from tracking.association.colour_likelihood import ColourLikelihood
from tracking.association.costs import AssociationConfig
from tracking.class_models import CLASS_MODELS, ClassModel, ClassTable
from tracking.config_checks import check_config
from tracking.detections import Detections
from tracking.range_image import RangeImage
from tracking.records import Records
from tracking.track_table import LifecycleConfig, TrackTable
from tracking.tracks import Tracks
from tracking.world_detections import detections_in_world

REMATCH_STAGE = AssociationConfig(gate_speed_mps=30.0, gate_chi2=30.0, max_gate_m=16.0, max_cost=15.0)
# A detection at the place of a track is the same vehicle, whatever colour it has now.
SAME_PLACE_STAGE = AssociationConfig(min_gate_m=1.0, gate_chi2=0.0, gate_speed_mps=0.0, max_gate_m=1.0, max_cost=15.0)
LOST_STAGE = AssociationConfig(min_gate_m=1.0, gate_chi2=12.0, max_gate_m=40.0, max_cost=3.0)
# At such distances only a rare colour identifies a vehicle, whose heading may have changed.
DRIFTED_STAGE = AssociationConfig(
    min_gate_m=1.0, gate_chi2=12.0, max_gate_m=25.0, max_heading_cost=0.0, drift_std_mps=3.0, max_cost=0.0
)


@dataclass(frozen=True, kw_only=True)
class TrackerConfig:
    """Detection thresholds, track life cycle and association stages.

    Attributes:
        high_threshold: log-odds above which a detection takes part in all stages.
        low_threshold: log-odds above which a detection extends confirmed tracks without a high one.
        init_threshold: log-odds above which an unmatched detection starts a track.
        lifecycle: life cycle of tracks.
        association: first stages, current tracks: high detections, then low ones.
        rematch: current tracks, high detections; wider gates, for faster motion than predicted.
        lost: lost tracks, high detections.
        drifted: last stage, established tracks that left their predicted path; high detections with a known colour.
        classes: models of categories; others have the motion model of the life cycle.
        colour_outlier_rate: initial probability that a colour is wrong; 1 disables colours.
        occlusion: whether nearer detections hide farther ones from the ego. False for positions in an image, or in a
            world in which the position of the camera is unknown.
    """

    high_threshold: float = 0.5
    low_threshold: float = -2.5
    init_threshold: float = -2.5
    lifecycle: LifecycleConfig = field(default_factory=LifecycleConfig)
    association: AssociationConfig = field(default_factory=AssociationConfig)
    rematch: AssociationConfig = REMATCH_STAGE
    lost: AssociationConfig = LOST_STAGE
    drifted: AssociationConfig = DRIFTED_STAGE
    classes: Mapping[str, ClassModel] = field(default_factory=lambda: CLASS_MODELS)
    colour_outlier_rate: float = 0.1
    occlusion: bool = True

    def __post_init__(self) -> None:
        """Check all values.

        Raises:
            ShapeError: if one is of a wrong type, NaN or out of range, see `check_config`.
        """
        check_config(self)


class Tracker:
    """Tracks vehicles in the world frame, where the ego motion cancels; deterministic.

    The tracker is causal, and its memory is bounded.

    Example:
        >>> tracker = Tracker()
        >>> tracks = tracker.update(detections, timestamp_us, world_from_ego)
        >>> [(track.id, track.position_world_m) for track in tracks]
    """

    def __init__(self, config: TrackerConfig | None = None) -> None:
        """Start with no tracks.

        Raises:
            ShapeError: if the configuration is none.
        """
        self.config = TrackerConfig() if config is None else config
        if not isinstance(self.config, TrackerConfig):
            raise ShapeError(f"tracker: expected a TrackerConfig, got {config!r}")
        self._classes = ClassTable(self.config.classes, ClassModel(motion=self.config.lifecycle.motion))
        self._table = TrackTable(self.config.lifecycle, self._classes)
        self._time_us: int | None = None
        self._last_id = 0
        self._colours = ColourLikelihood(self.config.colour_outlier_rate)

    def update(self, detections: Detections, timestamp_us: int, world_from_ego: ArrayLike) -> Tracks:
        """Process the detections of one frame and return the reported tracks, ordered by id.

        Args:
            detections: detections in the ego frame.
            timestamp_us: integer time of the frame in microseconds. Other units cannot be told from it: nanoseconds
                or milliseconds must be converted.
            world_from_ego: (4, 4) ego pose, an array or lists.

        Raises:
            DataError: if the time is no integer or does not increase.
            ShapeError: if the detections are none, or the pose is not a rigid transform.
        """
        if not isinstance(detections, Detections):
            raise ShapeError(f"tracker: expected Detections, got {detections!r}")
        world_from_ego = as_array("world_from_ego", world_from_ego)
        check_transform("world_from_ego", world_from_ego)
        seconds = self._predict(timestamp_us)
        solid = (detections.log_odds >= self.config.high_threshold) & self.config.occlusion
        image = RangeImage(detections.ground_m, detections.yaw_rad, detections.size_m, solid)
        hidden = image.hidden(detections.ground_m, detections.size_m)
        found = detections_in_world(detections, world_from_ego, self._classes, hidden)
        kept, found["evidence"] = detections.resolve_duplicates()
        found["log_odds"][~kept] = -np.inf
        unmatched = self._associate(found)
        table = self._table
        # In the ego frame; the inverse of a rotation is its transpose.
        xy_ego_m = (table.position_world_m - world_from_ego[:3, 3]) @ world_from_ego[:3, :2]
        # Unmatched tracks outside the field of view are dropped: a vehicle that enters there is a new one.
        matched = table.state["detection"] >= 0
        expired = table.count_misses(detections.view.blind(xy_ego_m), image.hidden(xy_ego_m, table.size_m), seconds)
        keep = ~expired & (detections.view.sees(xy_ego_m) | matched)
        table.keep(keep)
        # An unmatched track inside a detection's box belongs to a vehicle that touches the detected one: the track
        # is reported, and the detection starts no new track.
        (unseen,) = (table.state["confirmed"] & (table.state["detection"] < 0) & ~table.state["lost"]).nonzero()
        covered, covering = detections.find_containing(xy_ego_m.compress(keep, axis=0).take(unseen, axis=0))
        new = unmatched & (found["log_odds"] >= self.config.init_threshold)
        own = table.state["kind"][unseen[covered]] == found["kind"][covering]
        new[covering[own]] = False
        self._start_tracks(new.nonzero()[0], found)
        reported = table.reportable
        reported[unseen[covered[own]]] = True
        return table.tracks(reported)

    def _predict(self, timestamp_us: int) -> float:
        """Predict all tracks to a new time; return the time step in seconds."""
        if not isinstance(timestamp_us, Integral):
            raise DataError(f"tracker: expected an integer time in microseconds, got {timestamp_us!r}")
        seconds = 0.0
        if self._time_us is not None:
            if timestamp_us <= self._time_us:
                raise DataError(f"tracker: expected a time after {self._time_us} us, got {timestamp_us} us")
            seconds = (timestamp_us - self._time_us) * 1e-6
            if seconds > self.config.lifecycle.forget_stationary_s:
                self._table = TrackTable(self.config.lifecycle, self._classes)
            self._table.predict(seconds)
        self._time_us = timestamp_us
        return seconds

    def _associate(self, found: Records) -> BoolArray:
        """Match detections to tracks in stages, update the matched tracks, and return unmatched detections (M,)."""
        table, config = self._table, self.config
        high = found["log_odds"] >= config.high_threshold
        low = ~high & (found["log_odds"] >= config.low_threshold)
        cascade = MatchingCascade(table.predictions(), found)
        lost = table.state["lost"]
        current = ~lost
        pairs = cascade.candidates(current, np.ones(len(high), np.bool_), config.association)
        self._colours.update(pairs)
        pairs = self._colours.add_cost(pairs)
        cascade.match(pairs, current, high)
        cascade.match(pairs, table.state["confirmed"], low)
        if (high & cascade.unmatched_detections).any():
            coloured = high & np.isfinite(found["lab"][:, 0]) & (config.colour_outlier_rate < 1)
            for tracks, candidates, stage in (
                (current, high, config.rematch),
                (current, high, SAME_PLACE_STAGE),
                (lost, high, config.lost),
                (table.established, coloured, config.drifted),
            ):
                pairs = cascade.candidates(tracks, candidates, stage)
                if stage is not SAME_PLACE_STAGE:
                    pairs = self._colours.add_cost(pairs)
                cascade.match(pairs, tracks, candidates)
        (rows,) = (~cascade.unmatched_tracks).nonzero()
        columns, noise_m2 = cascade.detection.take(rows), cascade.noise_m2.take(rows, axis=0)
        table.update(rows, found, columns, noise_m2, cascade.turn_rad.take(rows))
        return cascade.unmatched_detections

    def _start_tracks(self, columns: IntArray, found: Records) -> None:
        """Start a track for each detection at indices (K,)."""
        if not len(columns):
            return
        ids = self._last_id + 1 + np.arange(len(columns))
        self._last_id += len(columns)
        self._table.add(found, columns, ids)
