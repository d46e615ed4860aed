"""Track table: the state of all tracks as arrays: motion, heading, size, colour and life cycle."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from appocc.checks import BoolArray, FloatArray, IntArray
from tracking.class_models import ClassTable
from tracking.detections import probability_from_log_odds
from tracking.filtering.kalman import KalmanFilters, MotionConfig
from tracking.filtering.running_median import RunningMedian
from tracking.records import LAB, PREDICTION, RGB, SIZE, TRACK, Records, append, compress
from tracking.track_loops import (
    advance,
    count_misses,
    find_reportable,
    follow,
    measure,
    prior_returns,
    score_tracks,
    write_predictions,
)
from tracking.tracks import Tracks

# Frame interval before the second frame: its detections are independent of earlier ones.
_NO_STEP_S = 1e9


@dataclass(frozen=True, kw_only=True)
class LifecycleConfig:
    """Track life cycle and smoothing; times are in seconds, so that frame rates and gaps do not matter.

    Attributes:
        confirm_log_odds: a detection with these log-odds confirms its track immediately.
        confirm_first_log_odds: so does one with these in the first frame, in which every object is new.
        confirm_s: otherwise a track is confirmed after this time without a miss.
        coast_s: maximum time an unmatched track is reported at its predicted position.
        coast_std_m: maximum standard deviation of that position.
        coast_chance: minimum chance 0..1 that the track is detected again, as learnt from the recording.
        lost_s: time without a detection after which a track is lost; only the lost stage can match it again.
        forget_s: time without a detection after which a track is deleted.
        forget_stationary_s: the same for stationary tracks, which may be occluded for long.
        stationary_mps: speed below which a track is stationary; it keeps its position while unmatched.
        heading_smoothing_s: time constant of the heading.
        front_from_motion_mps: speed above which the motion determines front and rear.
        median_window: number of detections in the medians of size and colour.
        correlation_s: detections of a track closer in time repeat each other's errors: at a frame interval t each
            counts as 1 - exp(-t / correlation_s) independent ones.
        memory_s: time constant after which earlier detections are forgotten in the score.
        miss_log_odds: a frame in which a track should be detected and is not counts in the score as a detection of
            these log-odds.
        lab_std: prior standard deviations of lightness and the two colour axes between a detection and its track;
            illumination mostly changes the first.
        lab_prior_weight: weight of that prior in detections.
        motion: motion and measurement model of categories without one of their own.
    """

    confirm_log_odds: float = -np.inf
    confirm_first_log_odds: float = np.inf
    confirm_s: float = 0.0
    coast_s: float = 1.2
    coast_std_m: float = 2.5
    coast_chance: float = 0.4
    lost_s: float = 1.2
    forget_s: float = 8.0
    forget_stationary_s: float = 30.0
    stationary_mps: float = 1.0
    heading_smoothing_s: float = 0.3
    front_from_motion_mps: float = 1.0
    median_window: int = 11
    correlation_s: float = 0.1
    memory_s: float = 1.0
    miss_log_odds: float = -1.0
    lab_std: tuple[float, float, float] = (10.0, 5.0, 5.0)
    lab_prior_weight: float = 4.0
    motion: MotionConfig = field(default_factory=MotionConfig)


class TrackTable:
    """N tracks, ordered by id.

    Attributes:
        state: times, headings and evidence, N records of `TRACK`.
        filters: N Kalman filters: positions and velocities.
    """

    def __init__(self, config: LifecycleConfig, classes: ClassTable) -> None:
        """Start with no tracks."""
        self._config, self._classes = config, classes
        self._lab_prior = np.array(config.lab_std), float(config.lab_prior_weight)
        self._coasting = (
            float(config.lost_s),
            float(config.coast_chance),
            float(config.coast_std_m),
            float(config.coast_s),
        )
        self._returns = prior_returns()
        self._limits = (
            float(config.miss_log_odds),
            float(config.lost_s),
            float(config.forget_s),
            float(config.forget_stationary_s),
        )
        self._set_step(_NO_STEP_S)
        self.filters = KalmanFilters()
        self._medians = RunningMedian(config.median_window, 9)
        self.state: Records = np.zeros(0, TRACK)

    def __len__(self) -> int:
        """Number of tracks."""
        return len(self.state)

    @property
    def position_world_m(self) -> FloatArray:
        """(N, 3) positions on the ground."""
        return np.concatenate([self.filters.mean[:, :2], self.state["ground_m"][:, None]], axis=1)

    @property
    def size_m(self) -> FloatArray:
        """(N, 3) width, length, height."""
        return self._medians.median[:, SIZE]

    @property
    def score(self) -> FloatArray:
        """(N,) probability of being an object of the category, from detections, misses and the prior.

        Later frames count more: the weights decay with `memory_s`.
        """
        return probability_from_log_odds(self._log_odds()[1])

    @property
    def established(self) -> BoolArray:
        """(N,) whether a track is confirmed and has positive log-odds by its detections.

        Misses do not count: an occluded object is missed, too, and is remembered.
        """
        return np.asarray(self.state["confirmed"] & (self._log_odds()[0] > 0))

    def _log_odds(self) -> FloatArray:
        """(2, N) log-odds of being an object of the category: by the detections alone, and with misses."""
        log_odds = np.empty((2, len(self)))
        score_tracks(self.state, self._classes.models, *log_odds)
        return log_odds

    @property
    def reportable(self) -> BoolArray:
        """(N,) whether a track is confirmed and matched, or coasts: likely to return, at a well-known position."""
        reported = np.empty(len(self), np.bool_)
        find_reportable(
            self.state,
            self._classes.models,
            self.filters.position_std_m(),
            self._returns,
            self._step_s,
            *self._coasting,
            reported,
        )
        return reported

    def predict(self, seconds: float) -> None:
        """Predict all tracks by a time step; they are unmatched until `update`."""
        # The shortest interval so far is that of the recording: left-out frames change nothing.
        if seconds < self._step_s:
            self._set_step(seconds)
        moving_s, psd_m2ps3 = np.empty(len(self)), np.empty((len(self), 2, 2))
        advance(
            self.state,
            self._classes.models,
            self.filters.mean,
            seconds,
            float(self._config.lost_s),
            float(self._config.heading_smoothing_s),
            moving_s,
            psd_m2ps3,
        )
        self.filters.predict(moving_s, psd_m2ps3)

    def _set_step(self, seconds: float) -> None:
        """Set the frame interval: by how much earlier evidence decays, the weight of a frame, and what confirms."""
        self._step_s, config = seconds, self._config
        self._decay = float(np.exp(-seconds / config.memory_s))
        self._weight = float(-np.expm1(-seconds / config.correlation_s))
        first_log_odds = config.confirm_first_log_odds if seconds == _NO_STEP_S else np.inf
        # As floats, because each type is compiled anew.
        self._confirmation = (
            float(min(config.confirm_log_odds, first_log_odds)),
            float(config.confirm_s),
            float(config.heading_smoothing_s),
            float(config.front_from_motion_mps),
        )

    def count_misses(self, blind: BoolArray, hidden: FloatArray, seconds: float) -> BoolArray:
        """Count the last time step as a miss of unmatched tracks, except for tracks in blind spots.

        Args:
            blind: (N,) tracks in blind spots.
            hidden: (N,) shares that nearer boxes hide.
            seconds: the time step.

        Returns:
            (N,) tracks that expire: missed for too long, or unconfirmed and missed once. Tracks with negative
            log-odds expire once lost. Time in a blind spot is no miss, but `forget_s` and `forget_stationary_s` apply
            there too.
        """
        expired = np.empty(len(self), np.bool_)
        count_misses(
            self.state,
            self._classes.models,
            blind,
            hidden,
            self._returns,
            self._step_s,
            seconds,
            self._decay,
            self._weight,
            *self._limits,
            expired,
        )
        return expired

    def predictions(self) -> Records:
        """Return what association needs to know, N records of `PREDICTION`."""
        predictions, medians = np.empty(len(self), PREDICTION), self._medians
        write_predictions(
            predictions,
            self.state,
            self._classes.models,
            self.filters.mean,
            self.filters.cov,
            medians.median,
            medians.squared_deviation,
            medians.known,
            *self._lab_prior,
        )
        return predictions

    def update(
        self, rows: IntArray, found: Records, columns: IntArray, noise_m2: FloatArray, turn_rad: FloatArray
    ) -> None:
        """Update tracks with their matched detections.

        Args:
            rows: (M,) track indices.
            found: all detections of the frame, `DETECTION`.
            columns: (M,) detection indices.
            noise_m2: (M, 2, 2) covariances of the positions.
            turn_rad: (M,) turns since the last detection; 0 for straight motion.
        """
        state, medians = self.state, self._medians
        (turns,) = turn_rad.nonzero()
        if len(turns):
            self.filters.turn(rows[turns], turn_rad[turns], state["moved_s"][rows[turns]])
        xy_m, values = np.empty((len(rows), 2)), np.empty((len(rows), LAB.stop))
        steady = np.empty(len(rows), np.bool_)
        known = medians.count, medians.median
        measure(state, found, rows, columns, turn_rad, self._step_s, *known, xy_m, values, steady)
        innovation_m = xy_m - self.filters.mean.take(rows, axis=0)[:, :2]
        # Noise differs from detection to detection; what repeats itself is the lag of a track in a bend.
        noise_m = (innovation_m - state["innovation_m"].take(rows, axis=0)) / np.sqrt(2)
        state["innovation_m"][rows] = innovation_m
        steady &= np.isfinite(noise_m[:, 0])
        self._classes.learn_noise(found, columns, noise_m, self.filters.cov.take(rows, axis=0), steady)
        self.filters.update(rows, xy_m, noise_m2 - found["surplus_noise_m2"].take(columns, axis=0))
        medians.update(rows, values)
        state["moving"] = self.filters.is_moving()
        state["stationary"][rows] = self.filters.is_stationary(self._config.stationary_mps)[rows]
        self._follow(rows, found, columns)

    def add(self, found: Records, columns: IntArray, ids: IntArray) -> None:
        """Add a track for each of the detections at indices (M,), with ids (M,)."""
        n, new = len(self), found.take(columns)
        self.filters.add(
            new["position_world_m"][:, :2],
            new["noise_m2"] - new["surplus_noise_m2"],
            new["velocity_world_mps"],
            new["velocity_m2ps2"],
        )
        self._medians.add(np.concatenate([new["size_m"], new["rgb"], new["lab"]], axis=1))
        born = np.zeros(len(ids), TRACK)
        born["id"], born["kind"], born["yaw_rad"], born["axis"] = ids, new["kind"], new["yaw_world_rad"], new["axis"]
        born["earlier_axis"], born["innovation_m"] = new["axis"], np.nan
        self.state = append(self.state, born)
        self._follow(np.arange(n, n + len(ids)), found, columns)

    def keep(self, mask: BoolArray) -> None:
        """Keep the tracks of a mask (N,)."""
        if mask.all():
            return
        self.filters.keep(mask)
        self._medians.keep(mask)
        self.state = compress(self.state, mask)

    def _follow(self, rows: IntArray, found: Records, columns: IntArray) -> None:
        """Update times, evidence and headings of tracks (M,) with the detections at indices (M,)."""
        follow(
            self.state,
            self._classes.models,
            found,
            rows,
            columns,
            self.filters.mean,
            self._returns,
            self._step_s,
            self._decay,
            self._weight,
            *self._confirmation,
        )

    def tracks(self, mask: BoolArray) -> Tracks:
        """Return the tracks of a mask (N,)."""
        kinds, state = self._classes.names, compress(self.state, mask)
        median, mean = self._medians.median.compress(mask, axis=0), self.filters.mean.compress(mask, axis=0)
        return Tracks(
            id=state["id"],
            position_world_m=self.position_world_m.compress(mask, axis=0),
            velocity_world_mps=mean[:, 2:],
            yaw_world_rad=state["yaw_rad"],
            heading_known=state["front_known"],
            size_m=median[:, SIZE],
            rgb=median[:, RGB],
            score=self.score.compress(mask),
            kind=tuple([kinds[index] for index in state["kind"].tolist()]),
            detection=state["detection"],
            moving=state["moving"],
            velocity_known=state["moving"] | state["stationary"],
        )
