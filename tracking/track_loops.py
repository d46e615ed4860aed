"""Compiled loops over the tracks of a table."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from appocc.checks import BoolArray, FloatArray, IntArray
from tracking.class_models import ClassParameters
from tracking.compiled import compiled

# Weight, in detections, of the configured colour spread against the spread over all tracks.
_LAB_STD_WEIGHT = 10.0
# Limits between levels of a track's score, as log-odds: sure tracks are detected again more often. Each level has two
# groups, because hidden tracks return more often than visible ones.
_LEVELS = (0.0, 1.0, 2.0)
# Share of a track that nearer boxes hide from which it counts as hidden.
_HIDDEN = 0.3
# Largest number of missed frames that is told apart.
_MOST_MISSED = 40
# Prior rate of returns in a frame, and its weight in frames.
_RETURN_RATE, _RETURN_WEIGHT = 0.2, 4.0
# Variance of a median relative to that of a mean: pi / 2 for large Gaussian samples, plus an allowance for lighting.
_MEDIAN_VARIANCE = 2.0


class TrackState(NamedTuple):
    """State of N tracks but for their filters and medians; written into, never replaced.

    Attributes:
        id: (N,) track ids.
        kind: (N,) category indices.
        detection: (N,) index of the detection matched in this frame; -1 if none.
        confirmed: (N,) whether the track is confirmed.
        lost: (N,) whether the track was lost before this frame.
        stationary: (N,) whether the track is stationary.
        moving: (N,) whether the velocity differs from zero.
        yaw_rad: (N,) headings in the world frame.
        unseen_s: (N,) time since the last detection.
        missed_s: (N,) the same without the time in blind spots.
        moved_s: (N,) the same without the time a stationary track keeps its position.
        tracked_s: (N,) time from the first to the last detection.
        ground_m: (N,) heights of the ground.
        front_votes: (N,) evidence for the end that is taken as front.
        hidden: (N,) share that nearer boxes hid in the last frame with a miss.
        axis: (2, N) smoothed vectors at twice the heading.
        detected: (2, N) sum and weight of the evidence of detections.
        with_misses: (2, N) the same with misses.
    """

    id: IntArray
    kind: IntArray
    detection: IntArray
    confirmed: BoolArray
    lost: BoolArray
    stationary: BoolArray
    moving: BoolArray
    yaw_rad: FloatArray
    unseen_s: FloatArray
    missed_s: FloatArray
    moved_s: FloatArray
    tracked_s: FloatArray
    ground_m: FloatArray
    front_votes: FloatArray
    hidden: FloatArray
    axis: FloatArray
    detected: FloatArray
    with_misses: FloatArray


class MatchedDetections(NamedTuple):
    """M detections and their tracks, see `WorldDetections`.

    Attributes:
        rows: (M,) track indices.
        detection: (M,) detection indices.
    """

    rows: IntArray
    detection: IntArray
    position_world_m: FloatArray
    yaw_world_rad: FloatArray
    heading_known: BoolArray
    axis: FloatArray
    log_odds: FloatArray
    evidence: FloatArray


def prior_returns() -> FloatArray:
    """Return (2, G, K) the prior on returns and frames at risk, by group and number of missed frames."""
    counts = np.full((2, 2 * (len(_LEVELS) + 1), _MOST_MISSED + 1), _RETURN_WEIGHT)
    counts[0] *= _RETURN_RATE
    return counts


@compiled
def advance(
    state: TrackState,
    model: ClassParameters,
    mean: FloatArray,
    seconds: float,
    lost_s: float,
    moving_s: FloatArray,
    psd_m2ps3: FloatArray,
) -> None:
    """Advance the times of tracks with states (N, 4); all are unmatched.

    The times for which they move (N,), and the spectral densities (N, 2, 2) of their acceleration, see
    `acceleration_psd`, are written to the last arguments.
    """
    for n in range(len(mean)):
        state.lost[n] = state.unseen_s[n] > lost_s
        moving_s[n] = 0.0 if state.stationary[n] and state.unseen_s[n] > 0 else seconds
        calm = model.stationary_psd[n] if state.stationary[n] else 1.0
        along = calm * model.along_accel_psd_m2ps3[n]
        across = calm * model.across_accel_psd_m2ps3[n]
        across += model.heading_psd_rad2ps[n] * (mean[n, 2] ** 2 + mean[n, 3] ** 2)
        cos, sin = np.cos(state.yaw_rad[n]), np.sin(state.yaw_rad[n])
        psd_m2ps3[n, 0, 0] = across + (along - across) * cos * cos
        psd_m2ps3[n, 1, 1] = across + (along - across) * sin * sin
        psd_m2ps3[n, 0, 1] = psd_m2ps3[n, 1, 0] = (along - across) * cos * sin
        state.moved_s[n] += moving_s[n]
        state.unseen_s[n] += seconds
        state.missed_s[n] += seconds
        state.detection[n] = -1


@compiled
def follow(
    state: TrackState,
    model: ClassParameters,
    found: MatchedDetections,
    mean: FloatArray,
    returns: FloatArray,
    step_s: float,
    decay: float,
    weight: float,
    confirm_log_odds: float,
    confirm_s: float,
    heading_smoothing_s: float,
    front_from_motion_mps: float,
) -> None:
    """Update times, evidence, height and heading of the tracks of detections.

    Args:
        state: changed in place.
        model: class parameters of the tracks.
        found: M detections and their tracks.
        mean: (N, 4) states of the filters.
        returns: see `prior_returns`; changed in place.
        step_s: frame interval.
        decay: decay of the evidence from frame to frame.
        weight: weight of a frame.
        confirm_log_odds: see `LifecycleConfig`.
        confirm_s: see `LifecycleConfig`.
        heading_smoothing_s: see `LifecycleConfig`.
        front_from_motion_mps: see `LifecycleConfig`.
    """
    for m, n in enumerate(found.rows):
        state.detection[n], state.ground_m[n] = found.detection[m], found.position_world_m[m, 2]
        seconds = state.unseen_s[n]
        _learn_return(state, model, returns, n, step_s, 1.0)
        state.tracked_s[n] += seconds
        state.unseen_s[n] = state.missed_s[n] = state.moved_s[n] = 0.0
        _add_evidence(state.detected, n, decay, weight, found.evidence[m])
        _add_evidence(state.with_misses, n, decay, weight, found.evidence[m])
        if found.log_odds[m] >= confirm_log_odds or state.tracked_s[n] >= confirm_s:
            state.confirmed[n] = True

        # The axis is smoothed as a vector at twice its angle; then the front is voted on.
        keep = np.exp(-seconds / heading_smoothing_s)
        for k in range(2):
            state.axis[k, n] = keep * state.axis[k, n] + (1 - keep) * found.axis[m, k]
        yaw = np.arctan2(state.axis[1, n], state.axis[0, n]) / 2
        if np.cos(yaw - state.yaw_rad[n]) < 0:
            yaw += np.pi
        votes = state.front_votes[n] + found.heading_known[m] * np.cos(found.yaw_world_rad[m] - yaw)
        drives = state.moving[n] and np.hypot(mean[n, 2], mean[n, 3]) >= front_from_motion_mps
        forward = mean[n, 2] * np.cos(yaw) + mean[n, 3] * np.sin(yaw) if drives else votes
        if forward < 0:
            yaw += np.pi
        state.yaw_rad[n] = (yaw + np.pi) % (2 * np.pi) - np.pi
        # Motion counts as one vote at least; the votes now refer to the end chosen as front.
        state.front_votes[n] = max(abs(votes), 1.0 * drives)


@compiled
def _add_evidence(evidence: FloatArray, track: int, decay: float, weight: float, log_odds: float) -> None:
    """Add one frame to the sum and the weight of the evidence (2, N) of a track."""
    evidence[0, track] = decay * evidence[0, track] + weight * log_odds
    evidence[1, track] = decay * evidence[1, track] + weight


@compiled
def _log_odds(state: TrackState, model: ClassParameters, track: int) -> float:
    """Return the mean evidence of the detections of a track, with the prior."""
    prior = model.prior_log_odds[track] * model.prior_weight[track]
    mean: float = (state.detected[0, track] + prior) / (state.detected[1, track] + model.prior_weight[track])
    return mean


@compiled
def _group(state: TrackState, model: ClassParameters, track: int) -> int:
    """Return the group of tracks with the same chance to return: by level of score, visible or hidden."""
    log_odds, group = _log_odds(state, model, track), 0
    for limit in _LEVELS:
        group += log_odds > limit
    return 2 * group + 1 if state.hidden[track] > _HIDDEN else 2 * group


@compiled
def _learn_return(
    state: TrackState, model: ClassParameters, returns: FloatArray, track: int, step_s: float, returned: float
) -> None:
    """Learn from a frame in which a confirmed track could return after missed frames."""
    missed = int(state.unseen_s[track] / step_s + 0.5) - 1  # before this frame
    if state.confirmed[track] and 0 < missed <= _MOST_MISSED:
        group = _group(state, model, track)
        returns[0, group, missed] += returned
        returns[1, group, missed] += 1.0


@compiled
def count_misses(
    state: TrackState,
    model: ClassParameters,
    blind: BoolArray,
    hidden: FloatArray,
    returns: FloatArray,
    step_s: float,
    seconds: float,
    decay: float,
    weight: float,
    miss_log_odds: float,
    lost_s: float,
    forget_s: float,
    forget_stationary_s: float,
    expired: BoolArray,
) -> None:
    """Count a time step as a miss of unmatched tracks, see `TrackTable.count_misses`; `expired` (N,) is written."""
    for n in range(len(blind)):
        if state.detection[n] < 0 and blind[n]:
            state.missed_s[n] = max(state.missed_s[n] - seconds, 0.0)
        elif state.detection[n] < 0:
            _add_evidence(state.with_misses, n, decay, weight, miss_log_odds)
            _learn_return(state, model, returns, n, step_s, 0.0)
            state.hidden[n] = hidden[n]
        remembered_s = forget_stationary_s if state.stationary[n] else forget_s
        missed_for_s = (remembered_s if _log_odds(state, model, n) > 0 else lost_s) if state.confirmed[n] else 0.0
        expired[n] = state.missed_s[n] > missed_for_s or state.unseen_s[n] > remembered_s


@compiled
def find_reportable(
    state: TrackState,
    model: ClassParameters,
    std_m: FloatArray,
    returns: FloatArray,
    step_s: float,
    lost_s: float,
    coast_chance: float,
    coast_std_m: float,
    coast_s: float,
    reported: BoolArray,
) -> None:
    """See `TrackTable.reportable`, with deviations of positions (N,); written to `reported` (N,)."""
    for n in range(len(reported)):
        reported[n] = state.confirmed[n] and state.unseen_s[n] == 0
        if state.confirmed[n] and 0 < state.unseen_s[n] <= coast_s and std_m[n] <= coast_std_m:
            group = _group(state, model, n)
            reported[n] = _chance_to_return(returns, group, state.unseen_s[n], step_s, lost_s) >= coast_chance


@compiled
def _chance_to_return(returns: FloatArray, group: int, unseen_s: float, step_s: float, lost_s: float) -> float:
    """Return the chance that a track is detected again before it is lost.

    It is the estimate of Kaplan and Meier (J. Am. Stat. Assoc. 53, 1958): one minus the product of the rates of
    staying away in each further frame.
    """
    stays_away, last = 1.0, min(int(lost_s / step_s + 1e-6), _MOST_MISSED)
    for missed in range(max(int(unseen_s / step_s + 0.5), 1), last + 1):
        stays_away *= 1.0 - returns[0, group, missed] / returns[1, group, missed]
    return 1.0 - stays_away


@compiled
def shrunk_variance(
    deviation: FloatArray, known: FloatArray, prior_std: FloatArray, prior_weight: float, variance: FloatArray
) -> None:
    """Compute the variance (N, 3) of the next detection's colour about the median, shrunk to that of all tracks.

    This is empirical Bayes: the prior is the variance pooled over all tracks.

    Args:
        deviation: (N, 3) sums of squared deviations from the median.
        known: (N, 3) numbers of known values.
        prior_std: standard deviations of the prior on the pooled variance.
        prior_weight: weight of the pooled variance, in detections.
        variance: (N, 3) the result.
    """
    for k in range(3):
        total, count = prior_std[k] ** 2 * _LAB_STD_WEIGHT, _LAB_STD_WEIGHT
        for n in range(len(deviation)):
            total += deviation[n, k]
            count += max(known[n, k], 1.0) - 1
        for n in range(len(deviation)):
            own = (total / count * prior_weight + deviation[n, k]) / (prior_weight + known[n, k])
            variance[n, k] = own * (1 + _MEDIAN_VARIANCE / max(known[n, k], 1.0))
