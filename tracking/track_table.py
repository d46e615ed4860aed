"""The vehicles that are followed, as arrays: motion, heading, size, colour, and where they stand in their lives."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from appocc.checks import BoolArray, FloatArray, IntArray
from appocc.geometry import apply, wrap_angle
from tracking.association.costs import Predicted, Seen
from tracking.association.paint import paint_density
from tracking.detections import Detections, probability_of
from tracking.filtering.kalman import MotionConfig, Motions, spread
from tracking.tracks import Memory, Tracks

# So many sightings the spread of colours that is believed at first weighs.
_AT_FIRST = 10.0
# Variance of a median of so many sightings as one, in theirs: pi / 2 for many (Gaussian), and what light adds.
_MEDIAN_VARIANCE = 2.0
# Columns of what is remembered of a sighting.
_SIZE, _RGB, _LAB = slice(0, 3), slice(3, 6), slice(6, 9)


@dataclass(frozen=True)
class LifeConfig:
    """Life cycle and smoothing; all times in seconds, so that frame rates and gaps do not matter.

    Attributes:
        sure: log-odds of a detection that makes a track known at once ...
        confirm_s: ... others are told of when they were seen, without a miss, over this span.
        coast_s: how long a track that is not seen may be told of, at its predicted place,
        coast_m: if that is known so well (standard deviation).
        lost_s: a track that is not seen for so long is lost: only by what no other track takes it may be found again,
        forget_s: and after so long it never is, ...
        forget_resting_s: ... or after so long if it stood where it was seen last: what hides it may stay for long.
        rest_mps: who is slower, stands; out of sight it stays where it is.
        heading_s: time constant of the heading.
        turn_mps: speed from which motion says where the front is.
        sightings: how many sightings size and colour are the median of.
        doubt: log-odds of a vehicle before anything was seen of it, ...
        doubts: ... which weigh as much as so many sightings.
        lab: standard deviations of a sighting's lightness and its two colour axes about the track's, before more was
            seen: light and shadow change the first.
        lab_sightings: how many sightings that expectation weighs.
    """

    sure: float = -np.inf
    confirm_s: float = 0.0
    coast_s: float = 0.4
    coast_m: float = 0.8
    lost_s: float = 1.2
    forget_s: float = 8.0
    forget_resting_s: float = 30.0
    rest_mps: float = 1.0
    heading_s: float = 0.3
    turn_mps: float = 1.0
    sightings: int = 11
    doubt: float = -2.0
    doubts: float = 4.0
    lab: tuple[float, float, float] = (10.0, 5.0, 5.0)
    lab_sightings: float = 4.0
    motion: MotionConfig = field(default_factory=MotionConfig)


class Sightings(NamedTuple):
    """Detections of one moment in the world frame.

    Attributes:
        place_world_m: (M, 3) points on the ground below their centres.
        yaw_world_rad: (M,) headings.
        heading_known: (M,) whether they tell front from rear.
        values: (M, 9) width, length, height, colour in sRGB, and in CIELAB.
        noise_m2: (M, 2, 2) how well the places are known.
        axis: (M, 2) vectors of twice the headings; long shapes show them better than square ones.
        log_odds: (M,).
        cut: (M,) whether a part may be missing.
        kind: (M,) numbers of categories.
    """

    place_world_m: FloatArray
    yaw_world_rad: FloatArray
    heading_known: BoolArray
    values: FloatArray
    noise_m2: FloatArray
    axis: FloatArray
    log_odds: FloatArray
    cut: BoolArray
    kind: IntArray

    def of(self, columns: IntArray) -> Sightings:
        """Some of them (K,)."""
        return type(self)._make([each.take(columns, axis=0) for each in self])


def sightings_of(
    detections: Detections, world_from_ego: FloatArray, kind: IntArray, config: MotionConfig
) -> Sightings:
    """The detections of an ego frame in the world frame, with the numbers of their categories (M,)."""
    x, y = world_from_ego[:2, :2] @ np.array([np.cos(detections.yaw_rad), np.sin(detections.yaw_rad)])
    yaw_rad = np.arctan2(y, x)
    cut_m2 = config.cut_m**2 * detections.cut.astype(np.float64)
    return Sightings(
        apply(world_from_ego, detections.ground_m),
        yaw_rad,
        detections.heading_known,
        np.concatenate([detections.size_m, detections.rgb, detections.lab], axis=1),
        spread(yaw_rad, config.along_m**2 + cut_m2, config.across_m**2 + cut_m2),
        _axis(yaw_rad, detections.size_m),
        detections.log_odds,
        detections.cut,
        kind,
    )


# Of the heading of a square shape.
_LEAST_WEIGHT = 0.01


def _axis(yaw_rad: FloatArray, size_m: FloatArray) -> FloatArray:
    """(M, 2) vectors of twice the headings (M,) of shapes (M, 3)."""
    width, length, _ = size_m.T
    weight = np.maximum(np.abs(length - width) / (length + width), _LEAST_WEIGHT)
    twice = 2 * yaw_rad
    return np.asarray((weight * np.array([np.cos(twice), np.sin(twice)])).T)


class Followed:
    """N vehicles, in order of their numbers."""

    def __init__(self, config: LifeConfig) -> None:
        """Start with none."""
        self._config = config
        self.motions = Motions(config.motion)
        self._memory = Memory(config.sightings, 9)
        self._hold(np.zeros((3, 0), np.int64), np.zeros((4, 0), np.bool_), np.zeros((10, 0)))

    def _hold(self, whole: IntArray, flags: BoolArray, real: FloatArray) -> None:
        """Go on with other states: tables (..., N), for few arrays grow and shrink faster than many.

        Each attribute is a row of one, to be written into, never replaced.
        """
        self._tables = whole, flags, real
        self.number, self.kind, self.detection = whole
        self.confirmed, self.lost, self.rests, self._moves = flags
        self.yaw_rad, self.unseen_s, self._gone_s, self._seen_s, self._ground_m = real[:5]
        self._evidence, self._front, self.missed_s, self._axis = real[5], real[6], real[7], real[8:]

    def __len__(self) -> int:
        """Number of vehicles."""
        return len(self.number)

    @property
    def place_world_m(self) -> FloatArray:
        """(N, 3) places on the ground."""
        return np.concatenate([self.motions.mean[:, :2], self._ground_m[:, None]], axis=1)

    @property
    def belief(self) -> FloatArray:
        """(N,) log-odds of being a vehicle at all: the mean over all sightings, and some doubt."""
        doubts = self._config.doubts
        return np.asarray((self._evidence + self._config.doubt * doubts) / (self._memory.sightings + doubts))

    @property
    def dead(self) -> BoolArray:
        """(N,) whether one was missed for too long; before it is confirmed, any miss is.

        Those that are rather no vehicles are not remembered once they are lost. In a blind spot nothing is missed,
        but there too a track is forgotten after `forget_s` or `forget_resting_s`.
        """
        config = self._config
        forget_s = np.where(self.rests, config.forget_resting_s, config.forget_s)
        kept_s = np.where(self.belief > 0, forget_s, config.lost_s)
        missed_too_long = self.missed_s > np.where(self.confirmed, kept_s, 0.0)
        return np.asarray(missed_too_long | (self.unseen_s > forget_s))

    @property
    def known(self) -> BoolArray:
        """(N,) whether one is rather a vehicle than none, and known."""
        return np.asarray(self.confirmed & (self.belief > 0))

    @property
    def told(self) -> BoolArray:
        """(N,) whether one is known well enough to be told of."""
        near = (self.unseen_s <= self._config.coast_s) & (self.motions.blur_m() <= self._config.coast_m)
        return np.asarray(self.confirmed & ((self.unseen_s == 0) | near))

    def predict(self, seconds: float) -> None:
        """Let time pass; it counts as unseen and as missed until `see` is called."""
        self.lost[:] = self.unseen_s > self._config.lost_s
        going_s = np.where(self.rests & (self.unseen_s > 0), 0.0, seconds)
        self.motions.predict(going_s, self.yaw_rad)
        self._gone_s += going_s
        self.unseen_s += seconds
        self.missed_s += seconds
        self.detection[:] = -1

    def excuse(self, rows: BoolArray, seconds: float) -> None:
        """Take back what was counted as missed of vehicles (N,) that could not be seen for the last seconds."""
        self.missed_s[rows] = np.maximum(self.missed_s[rows] - seconds, 0.0)

    def expected(self) -> Predicted:
        """What is expected to be seen."""
        median, mean, cov = self._memory.median, self.motions.mean, self.motions.cov
        return Predicted(
            mean[:, :2],
            cov[:, :2, :2],
            self.yaw_rad,
            median[:, :2],
            median[:, _LAB],
            self._lab_variance(),
            self.kind,
            self.unseen_s,
            mean[:, 2:] * self._gone_s[:, None],
        )

    def _lab_variance(self) -> FloatArray:
        """(N, 3) of the colour of the next sighting about the median of the last ones.

        What little is known of one vehicle is drawn towards what is known of all (empirical Bayes).
        """
        config = self._config
        about, known = self._memory.spread[:, _LAB].T.copy(), self._memory.known[:, _LAB].T.copy()
        some = np.maximum(known, 1)
        of_all = (np.square(config.lab) * _AT_FIRST + about.sum(axis=1)) / (_AT_FIRST + (some - 1).sum(axis=1))
        variance = (of_all[:, None] * config.lab_sightings + about) / (config.lab_sightings + known)
        return np.asarray(variance * (1 + _MEDIAN_VARIANCE / some)).T

    def shown(self, seen: Sightings) -> Seen:
        """Sightings as they are compared with what is expected."""
        return Seen(
            seen.place_world_m[:, :2],
            seen.noise_m2,
            seen.yaw_world_rad,
            seen.values[:, :2],
            seen.values[:, _LAB],
            paint_density(seen.values[:, _LAB]),
            seen.kind,
        )

    def see(
        self, rows: IntArray, seen: Sightings, detection: IntArray, noise_m2: FloatArray, turn_rad: FloatArray
    ) -> None:
        """Take in a sighting of now of each of some vehicles (M,), with the number of its detection.

        Args:
            rows: (M,) which vehicles.
            seen: M sightings.
            detection: (M,) their numbers.
            noise_m2: (M, 2, 2) covariances of their places.
            turn_rad: (M,) by how much the vehicles turned on the way; 0 if they went straight on.
        """
        (turns,) = turn_rad.nonzero()
        if len(turns):
            self.motions.turn(rows[turns], turn_rad[turns], self._gone_s[rows[turns]])
        self.motions.update(rows, seen.place_world_m[:, :2], noise_m2)
        seconds = self.unseen_s[rows]
        self._seen_s[rows] += seconds
        self.unseen_s[rows] = self._gone_s[rows] = self.missed_s[rows] = 0.0
        self.detection[rows] = detection
        self._evidence[rows] += seen.log_odds
        self._ground_m[rows] = seen.place_world_m[:, 2]
        # A vehicle that the view cuts off is at least as large as what shows of it.
        values = seen.values
        if seen.cut.any():
            known_m = np.where(seen.cut[:, None], self._memory.median[rows, _SIZE], np.nan)
            values = np.concatenate([np.fmax(values[:, _SIZE], known_m), values[:, _SIZE.stop :]], axis=1)
        self._memory.remember(rows, values)
        self._moves[:] = self.motions.moves()
        self.rests[rows] = self.motions.rest(self._config.rest_mps)[rows]
        self._turn(rows, seen, seconds)
        self._confirm(rows, seen.log_odds)

    def add(self, seen: Sightings, numbers: IntArray, detection: IntArray) -> None:
        """Begin to follow what was seen now (M,)."""
        n, m = len(self), len(numbers)
        if not m:
            return
        self.motions.add(seen.place_world_m[:, :2], seen.yaw_world_rad, seen.noise_m2)
        self._memory.add(seen.values)
        self._hold(*(np.concatenate([t, np.zeros((len(t), m), t.dtype)], axis=1) for t in self._tables))
        self.number[n:], self.kind[n:], self.detection[n:] = numbers, seen.kind, detection
        self.yaw_rad[n:], self._axis[:, n:], self._front[n:] = seen.yaw_world_rad, seen.axis.T, seen.heading_known
        self._ground_m[n:], self._evidence[n:] = seen.place_world_m[:, 2], seen.log_odds
        self._confirm(np.arange(n, n + m), seen.log_odds)

    def keep(self, chosen: BoolArray) -> None:
        """Go on with some (N,) only."""
        if chosen.all():
            return
        self.motions.keep(chosen)
        self._memory.keep(chosen)
        self._hold(*(table.compress(chosen, axis=1) for table in self._tables))

    def _confirm(self, rows: IntArray, log_odds: FloatArray) -> None:
        known = (log_odds >= self._config.sure) | (self._seen_s[rows] >= self._config.confirm_s)
        self.confirmed[rows] |= known

    def _turn(self, rows: IntArray, seen: Sightings, seconds: FloatArray) -> None:
        """Smooth the axis, as a vector of twice its angle, and vote for the end that is the front."""
        keep = np.exp(-seconds / self._config.heading_s)
        self._axis[:, rows] = axis = keep * self._axis.take(rows, axis=1) + (1 - keep) * seen.axis.T
        yaw = np.arctan2(axis[1], axis[0]) / 2
        yaw += np.pi * (np.cos(yaw - self.yaw_rad[rows]) < 0)
        front = self._front[rows] + seen.heading_known * np.cos(seen.yaw_world_rad - yaw)
        vx, vy = self.motions.mean.take(rows, axis=0)[:, 2:].T
        goes = self._moves[rows] & (np.hypot(vx, vy) >= self._config.turn_mps)
        wrong = np.where(goes, vx * np.cos(yaw) + vy * np.sin(yaw), front) < 0
        self.yaw_rad[rows] = wrap_angle(yaw + np.pi * wrong)
        # Who was seen to move stays known; a vote counts from now on for the end it was found to be.
        self._front[rows] = np.maximum(np.abs(front), goes)

    def tracks(self, chosen: BoolArray, kinds: tuple[str, ...]) -> Tracks:
        """What is known now of some (N,); `kinds` are the names of the categories."""
        (rows,) = chosen.nonzero()
        median, mean = self._memory.median.take(rows, axis=0), self.motions.mean.take(rows, axis=0)
        return Tracks(
            self.number[rows],
            self.place_world_m.take(rows, axis=0),
            mean[:, 2:],
            self.yaw_rad[rows],
            self._front[rows] > 0,
            median[:, _SIZE],
            median[:, _RGB],
            probability_of(self.belief[rows]),
            tuple(kinds[number] for number in self.kind[rows].tolist()),
            self.detection[rows],
            self._moves[rows],
        )
