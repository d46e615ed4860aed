"""Track table: the state of all tracks as arrays: motion, heading, size, colour and life cycle."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from appocc.checks import BoolArray, FloatArray, IntArray
from tracking.association.costs import TrackFeatures
from tracking.class_models import ClassTable
from tracking.compiled import compiled
from tracking.detections import probability_from_log_odds
from tracking.filtering.kalman import KalmanFilters, MotionConfig, acceleration_psd, oriented_covariance
from tracking.filtering.running_median import RunningMedian
from tracking.tracks import Tracks
from tracking.world_detections import LAB, RGB, SIZE, WorldDetections

# Weight, in detections, of the configured colour spread against the spread over all tracks.
_LAB_STD_WEIGHT = 10.0
# Variance of a median relative to that of a mean: pi / 2 for large Gaussian samples, plus an allowance for lighting.
_MEDIAN_VARIANCE = 2.0
# Frame interval before the second frame: its detections are independent of earlier ones.
_NO_STEP_S = 1e9
# Number of detections after which a track's velocity is known.
_STEADY_DETECTIONS = 5
# Standard deviation of a detection's velocity, with which its track starts.
_VELOCITY_STD_MPS = 1.5


@dataclass(frozen=True, kw_only=True)
class LifecycleConfig:
    """Track life cycle and smoothing; times are in seconds, so that frame rates and gaps do not matter.

    Attributes:
        confirm_log_odds: a detection with these log-odds confirms its track immediately.
        confirm_s: otherwise a track is confirmed after this time without a miss.
        coast_s: maximum time an unmatched track is reported at its predicted position.
        coast_std_m: maximum standard deviation of that position.
        coast_log_odds: minimum score of a track that coasts, as log-odds: it falls with each miss. Tracks of objects
            that were always sure go on, those of unsure ones end where their detections do.
        lost_s: time without a detection after which a track is lost; only the lost stage can match it again.
        forget_s: time without a detection after which a track is deleted.
        forget_stationary_s: the same for stationary tracks, which may be occluded for long.
        stationary_mps: speed below which a track is stationary; it keeps its position while unmatched.
        stationary_psd: factor on the spectral density of the acceleration of stationary tracks: most are parked.
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
    confirm_s: float = 0.0
    coast_s: float = 0.6
    coast_std_m: float = 1.2
    coast_log_odds: float = -1.0
    lost_s: float = 1.2
    forget_s: float = 8.0
    forget_stationary_s: float = 30.0
    stationary_mps: float = 1.0
    stationary_psd: float = 0.2
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
    """State of N tracks, ordered by id.

    Attributes:
        id: (N,) track ids.
        kind: (N,) category indices.
        detection: (N,) index of the detection matched in this frame; -1 if none.
        confirmed: (N,) whether the track is confirmed.
        lost: (N,) whether the track was lost before this frame.
        stationary: (N,) whether the track is stationary.
        yaw_rad: (N,) headings in the world frame.
        unseen_s: (N,) time since the last detection.
        missed_s: (N,) the same without the time in blind spots.
        filters: N Kalman filters.
    """

    def __init__(self, config: LifecycleConfig, classes: ClassTable) -> None:
        """Start with no tracks."""
        self._config, self._classes = config, classes
        self._set_step(_NO_STEP_S)
        self.filters = KalmanFilters()
        self._medians = RunningMedian(config.median_window, 9)
        self._set_tables(np.zeros((3, 0), np.int64), np.zeros((4, 0), np.bool_), np.zeros((13, 0)))

    def _set_tables(self, integers: IntArray, flags: BoolArray, floats: FloatArray) -> None:
        """Replace the state by tables (..., N): few arrays grow and shrink faster than many.

        Each attribute is a view of a row, to be written into, never replaced.
        """
        self._tables = integers, flags, floats
        self.id, self.kind, self.detection = integers
        self.confirmed, self.lost, self.stationary, self._moving = flags
        self.yaw_rad, self.unseen_s, self._moved_s, self._tracked_s, self._ground_m = floats[:5]
        self._front_votes, self.missed_s = floats[5:7]
        # Sum and weight of the evidence, without and with misses.
        self._axis, self._evidence, self._detected, self._with_misses = floats[7:9], floats[9:], floats[9:11], floats[11:]
        self._models = self._classes.parameters(self.kind)

    def __len__(self) -> int:
        """Number of tracks."""
        return len(self.id)

    @property
    def position_world_m(self) -> FloatArray:
        """(N, 3) positions on the ground."""
        return np.concatenate([self.filters.mean[:, :2], self._ground_m[:, None]], axis=1)

    @property
    def score(self) -> FloatArray:
        """(N,) probability of being an object of the category, from detections, misses and the prior.

        Later frames count more: the weights decay with `memory_s`.
        """
        return probability_from_log_odds(self._score_log_odds)

    @property
    def _score_log_odds(self) -> FloatArray:
        return self._mean_log_odds(self._with_misses)

    @property
    def log_odds(self) -> FloatArray:
        """(N,) the same as log-odds, without misses: an occluded object is missed, too, and is remembered."""
        return self._mean_log_odds(self._detected)

    def _mean_log_odds(self, evidence: FloatArray) -> FloatArray:
        """(N,) weighted mean of evidence (2, N), its sum and weight, and the prior."""
        model, (total, weight) = self._models, evidence
        return np.asarray((total + model.prior_log_odds * model.prior_weight) / (weight + model.prior_weight))

    @property
    def established(self) -> BoolArray:
        """(N,) whether a track is confirmed and has positive log-odds."""
        return np.asarray(self.confirmed & (self.log_odds > 0))

    @property
    def reportable(self) -> BoolArray:
        """(N,) whether a track is confirmed and matched, or coasts: likely there, at a well-known position."""
        config = self._config
        likely = self._score_log_odds >= config.coast_log_odds
        coasting = (self.unseen_s <= config.coast_s) & (self.filters.position_std_m() <= config.coast_std_m) & likely
        return np.asarray(self.confirmed & ((self.unseen_s == 0) | coasting))

    def predict(self, seconds: float) -> None:
        """Predict all tracks by a time step; they are unmatched until `update`."""
        # The shortest interval so far is that of the recording: left-out frames change nothing.
        self._set_step(min(self._step_s, seconds))
        self.lost[:] = self.unseen_s > self._config.lost_s
        moving_s = np.where(self.stationary & (self.unseen_s > 0), 0.0, seconds)
        model = self._models
        calm = np.where(self.stationary, self._config.stationary_psd, 1.0)
        psd = acceleration_psd(
            self.yaw_rad,
            self.filters.mean[:, 2:],
            calm * model.along_accel_psd_m2ps3,
            calm * model.across_accel_psd_m2ps3,
            model.heading_psd_rad2ps,
        )
        self.filters.predict(moving_s, psd)
        self._moved_s += moving_s
        self.unseen_s += seconds
        self.missed_s += seconds
        self.detection[:] = -1

    def _set_step(self, seconds: float) -> None:
        """Set the frame interval: by how much earlier evidence decays, and the weight of a frame."""
        self._step_s = seconds
        self._decay = float(np.exp(-seconds / self._config.memory_s))
        self._weight = float(-np.expm1(-seconds / self._config.correlation_s))

    def count_misses(self, blind: BoolArray, seconds: float) -> BoolArray:
        """Count the last time step as a miss of unmatched tracks, except for tracks in blind spots (N,).

        Returns:
            (N,) tracks that expire: missed for too long, or unconfirmed and missed once. Tracks with negative log-odds
            expire once lost. Time in a blind spot is no miss, but `forget_s` and `forget_stationary_s` apply there
            too.
        """
        config, expired = self._config, np.empty(len(self), np.bool_)
        flags = self.detection, self.confirmed, self.stationary, blind
        weights = self._decay, self._weight, config.miss_log_odds
        limits = config.lost_s, config.forget_s, config.forget_stationary_s
        times = self.unseen_s, self.missed_s
        _count_misses(expired, *flags, *times, self._with_misses, self.log_odds, seconds, weights, limits)
        return expired

    def features(self) -> TrackFeatures:
        """Return the predicted features for association."""
        median, mean, cov, model = self._medians.median, self.filters.mean, self.filters.cov, self._models
        return TrackFeatures(
            xy_m=mean[:, :2].copy(),
            cov_m2=cov[:, :2, :2].copy(),
            yaw_rad=self.yaw_rad,
            size_m=median[:, :2].copy(),
            lab=median[:, LAB].copy(),
            lab_variance=self._lab_variance(),
            kind=self.kind,
            unseen_s=self.unseen_s,
            displacement_m=mean[:, 2:] * self._moved_s[:, None],
            gate_scale=model.gate_scale,
            heading_weight=model.heading_weight,
        )

    def _lab_variance(self) -> FloatArray:
        """(N, 3) variance of the next detection's colour about the median, shrunk to that of all tracks.

        This is empirical Bayes: the prior is the variance pooled over all tracks.
        """
        config, medians = self._config, self._medians
        deviation, known = medians.squared_deviation[:, LAB], medians.known[:, LAB]
        return _shrunk_variance(deviation.copy(), known.copy(), config.lab_std, config.lab_prior_weight)

    def update(
        self, rows: IntArray, found: WorldDetections, detection: IntArray, noise_m2: FloatArray, turn_rad: FloatArray
    ) -> None:
        """Update tracks with their matched detections.

        Args:
            rows: (M,) track indices.
            found: M detections.
            detection: (M,) detection indices.
            noise_m2: (M, 2, 2) covariances of the positions.
            turn_rad: (M,) turns since the last detection; 0 for straight motion.
        """
        (turns,) = turn_rad.nonzero()
        if len(turns):
            self.filters.turn(rows[turns], turn_rad[turns], self._moved_s[rows[turns]])
        self._learn_noise(rows, found, turn_rad)
        self.filters.update(rows, found.position_world_m[:, :2], noise_m2 - found.surplus_noise_m2)
        seconds = self.unseen_s[rows]
        self._tracked_s[rows] += seconds
        self.unseen_s[rows] = self._moved_s[rows] = self.missed_s[rows] = 0.0
        self.detection[rows] = detection
        self._add_detections(rows, found)
        self._ground_m[rows] = found.position_world_m[:, 2]
        # A truncated vehicle is at least as large as its visible part.
        values = found.values
        if found.truncated.any():
            known_m = np.where(found.truncated[:, None], self._medians.median[rows, SIZE], np.nan)
            values = np.concatenate([np.fmax(values[:, SIZE], known_m), values[:, SIZE.stop :]], axis=1)
        self._medians.update(rows, values)
        self._moving[:] = self.filters.is_moving()
        self.stationary[rows] = self.filters.is_stationary(self._config.stationary_mps)[rows]
        self._update_heading(rows, found, seconds)

    def _learn_noise(self, rows: IntArray, found: WorldDetections, turn_rad: FloatArray) -> None:
        """Learn the measurement noise from tracks with a known velocity that went straight on."""
        steady = (self._medians.count[rows] >= _STEADY_DETECTIONS) & (self.unseen_s[rows] <= 2 * self._step_s)
        (use,) = (steady & (turn_rad == 0) & ~found.truncated).nonzero()
        mean, cov = self.filters.mean[rows[use]], self.filters.cov[rows[use]]
        self._classes.learn_noise(
            found.kind[use],
            found.log_odds[use],
            found.position_world_m[use, :2] - mean[:, :2],
            cov[:, :2, :2],
            (found.noise_m2 - found.surplus_noise_m2)[use],
        )

    def add(self, found: WorldDetections, ids: IntArray, detection: IntArray) -> None:
        """Add a track for each of M detections, with ids and detection indices (M,)."""
        n, m = len(self), len(ids)
        if not m:
            return
        self._add_filters(found)
        self._medians.add(found.values)
        integers, flags, floats = (np.concatenate([t, np.zeros((len(t), m), t.dtype)], axis=1) for t in self._tables)
        integers[:, n:] = ids, found.kind, detection
        self._set_tables(integers, flags, floats)
        self.yaw_rad[n:], self._axis[:, n:] = found.yaw_world_rad, found.axis.T
        self._front_votes[n:] = found.heading_known
        self._ground_m[n:] = found.position_world_m[:, 2]
        self._add_detections(np.arange(n, n + m), found)

    def _add_filters(self, found: WorldDetections) -> None:
        model, measured_mps = self._classes.parameters(found.kind), found.velocity_world_mps
        # The heading of a truncated box says little about the direction of motion.
        across_mps = np.where(found.truncated, model.along_speed_std_mps, model.across_speed_std_mps)
        speed_m2ps2 = oriented_covariance(found.yaw_world_rad, model.along_speed_std_mps**2, across_mps**2)
        known = np.isfinite(measured_mps[:, :1])
        speed_m2ps2 = np.where(known[..., None], _VELOCITY_STD_MPS**2 * np.eye(2), speed_m2ps2)
        noise_m2 = found.noise_m2 - found.surplus_noise_m2
        self.filters.add(found.position_world_m[:, :2], noise_m2, np.where(known, measured_mps, 0.0), speed_m2ps2)

    def keep(self, mask: BoolArray) -> None:
        """Keep the tracks of a mask (N,)."""
        if mask.all():
            return
        self.filters.keep(mask)
        self._medians.keep(mask)
        self._set_tables(*(table.compress(mask, axis=1) for table in self._tables))

    def _add_detections(self, rows: IntArray, found: WorldDetections) -> None:
        """Add the evidence of M detections to tracks (M,), and confirm tracks."""
        evidence = self._decay * self._evidence.take(rows, axis=1)
        evidence[::2] += self._weight * found.evidence
        evidence[1::2] += self._weight
        self._evidence[:, rows] = evidence
        confirmed = found.log_odds >= self._config.confirm_log_odds
        self.confirmed[rows] |= confirmed | (self._tracked_s[rows] >= self._config.confirm_s)

    def _update_heading(self, rows: IntArray, found: WorldDetections, seconds: FloatArray) -> None:
        """Smooth the axis as a vector at twice its angle, and vote on which end is the front."""
        keep = np.exp(-seconds / self._config.heading_smoothing_s)
        drives = self._moving & (self.filters.speed_mps() >= self._config.front_from_motion_mps)
        _vote(
            rows,
            self.yaw_rad,
            self._axis,
            self._front_votes,
            drives,
            self.filters.mean,
            keep,
            found.axis,
            found.yaw_world_rad,
            found.heading_known,
        )

    def tracks(self, mask: BoolArray) -> Tracks:
        """Return the tracks of a mask (N,)."""
        kinds = self._classes.names
        (rows,) = mask.nonzero()
        median, mean = self._medians.median.take(rows, axis=0), self.filters.mean.take(rows, axis=0)
        return Tracks(
            id=self.id[rows],
            position_world_m=self.position_world_m.take(rows, axis=0),
            velocity_world_mps=mean[:, 2:],
            yaw_world_rad=self.yaw_rad[rows],
            heading_known=self._front_votes[rows] > 0,
            size_m=median[:, SIZE],
            rgb=median[:, RGB],
            score=self.score[rows],
            kind=tuple(kinds[index] for index in self.kind[rows].tolist()),
            detection=self.detection[rows],
            moving=self._moving[rows],
        )


@compiled
def _count_misses(
    expired: BoolArray,
    detection: IntArray,
    confirmed: BoolArray,
    stationary: BoolArray,
    blind: BoolArray,
    unseen_s: FloatArray,
    missed_s: FloatArray,
    evidence: FloatArray,
    log_odds: FloatArray,
    seconds: float,
    weights: tuple[float, float, float],
    limits: tuple[float, float, float],
) -> None:
    """See `TrackTable.count_misses`; `expired`, `missed_s` and `evidence` are changed in place."""
    (decay, weight, miss_log_odds), (lost_s, forget_s, forget_stationary_s) = weights, limits
    for n in range(len(expired)):
        if detection[n] < 0 and blind[n]:
            missed_s[n] = max(missed_s[n] - seconds, 0.0)
        elif detection[n] < 0:
            evidence[0, n] = decay * evidence[0, n] + weight * miss_log_odds
            evidence[1, n] = decay * evidence[1, n] + weight
        remembered_s = forget_stationary_s if stationary[n] else forget_s
        missed_for_s = (remembered_s if log_odds[n] > 0 else lost_s) if confirmed[n] else 0.0
        expired[n] = missed_s[n] > missed_for_s or unseen_s[n] > remembered_s


@compiled
def _shrunk_variance(
    deviation: FloatArray, known: FloatArray, prior_std: tuple[float, float, float], prior_weight: float
) -> FloatArray:
    """See `TrackTable._lab_variance`; sums of squared deviations and numbers of values are (N, 3)."""
    variance = np.empty_like(deviation)
    for k in range(3):
        total, count = prior_std[k] ** 2 * _LAB_STD_WEIGHT, _LAB_STD_WEIGHT
        for n in range(len(deviation)):
            total += deviation[n, k]
            count += max(known[n, k], 1.0) - 1
        for n in range(len(deviation)):
            own = (total / count * prior_weight + deviation[n, k]) / (prior_weight + known[n, k])
            variance[n, k] = own * (1 + _MEDIAN_VARIANCE / max(known[n, k], 1.0))
    return variance


@compiled
def _vote(
    rows: IntArray,
    yaw_rad: FloatArray,
    axis: FloatArray,
    front_votes: FloatArray,
    drives: BoolArray,
    mean: FloatArray,
    keep: FloatArray,
    seen_axis: FloatArray,
    seen_yaw_rad: FloatArray,
    heading_known: BoolArray,
) -> None:
    """See `TrackTable._update_heading`; headings, axes and votes are changed in place."""
    for m, n in enumerate(rows):
        for k in range(2):
            axis[k, n] = keep[m] * axis[k, n] + (1 - keep[m]) * seen_axis[m, k]
        yaw = np.arctan2(axis[1, n], axis[0, n]) / 2
        if np.cos(yaw - yaw_rad[n]) < 0:
            yaw += np.pi
        votes = front_votes[n] + heading_known[m] * np.cos(seen_yaw_rad[m] - yaw)
        forward = mean[n, 2] * np.cos(yaw) + mean[n, 3] * np.sin(yaw) if drives[n] else votes
        if forward < 0:
            yaw += np.pi
        yaw_rad[n] = (yaw + np.pi) % (2 * np.pi) - np.pi
        # Motion counts as one vote at least; the votes now refer to the end chosen as front.
        front_votes[n] = max(abs(votes), 1.0 * drives[n])
