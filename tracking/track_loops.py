"""Compiled loops over the tracks of a table.

Arguments: `state` are N records of `TRACK`, changed in place, `models` the parameters of the categories by number,
`found` records of `DETECTION`, and `rows` and `columns` (M,) the indices of matched tracks and their detections.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from appocc.checks import BoolArray, FloatArray, IntArray
from tracking.compiled import compiled
from tracking.records import LAB, RGB, SIZE, Records

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
# Number of detections after which a track's velocity is known.
_STEADY_DETECTIONS = 5
# A vehicle reverses below this speed, if so many votes of its detections agree on its front.
_REVERSING_MPS, _AGREED_VOTES = 4.0, 5.0
# Variance of a median relative to that of a mean: pi / 2 for large Gaussian samples, plus an allowance for lighting.
_MEDIAN_VARIANCE = 2.0


def prior_returns() -> FloatArray:
    """Return (2, G, K) the prior on returns and frames at risk, by group and number of missed frames."""
    counts = np.full((2, 2 * (len(_LEVELS) + 1), _MOST_MISSED + 1), _RETURN_WEIGHT)
    counts[0] *= _RETURN_RATE
    return counts


@compiled
def advance(
    state: Records,
    models: Records,
    mean: FloatArray,
    seconds: float,
    lost_s: float,
    heading_smoothing_s: float,
    moving_s: FloatArray,
    psd_m2ps3: FloatArray,
) -> None:
    """Advance the times of tracks with states (N, 4), and turn their velocities in bends; all are unmatched.

    The times for which they move (N,), and the spectral densities (N, 2, 2) of their acceleration, see
    `acceleration_psd`, are written to the last arguments.
    """
    share = 1 - np.exp(-seconds / heading_smoothing_s)
    for n in range(len(state)):
        track, model = state[n], models[state[n].kind]
        track.lost = track.unseen_s > lost_s
        moving_s[n] = 0.0 if track.stationary and track.unseen_s > 0 else seconds
        calm = model.stationary_psd if track.stationary else 1.0
        along, across = calm * model.along_accel_psd_m2ps3, calm * model.across_accel_psd_m2ps3
        across += model.heading_psd_rad2ps * (mean[n, 2] ** 2 + mean[n, 3] ** 2)
        cos, sin = np.cos(track.yaw_rad), np.sin(track.yaw_rad)
        psd_m2ps3[n, 0, 0] = across + (along - across) * cos * cos
        psd_m2ps3[n, 1, 1] = across + (along - across) * sin * sin
        psd_m2ps3[n, 0, 1] = psd_m2ps3[n, 1, 0] = (along - across) * cos * sin
        turns = model.heading_weight > 0 and model.heading_psd_rad2ps > 0
        if turns and track.moving and track.unseen_s == 0:
            _turn_velocity(mean[n], track, share)
        track.moved_s += moving_s[n]
        track.unseen_s += seconds
        track.missed_s += seconds
        track.detection = -1


@compiled
def _turn_velocity(mean: FloatArray, track: Any, share: float) -> None:
    """Turn the velocity of a state (4,) as the heading turns: by a share of the lag of the axis smoothed twice."""
    (x, y), (earlier_x, earlier_y) = track.axis, track.earlier_axis
    turn = share * np.arctan2(earlier_x * y - earlier_y * x, earlier_x * x + earlier_y * y) / 2
    cos, sin = np.cos(turn), np.sin(turn)
    mean[2], mean[3] = cos * mean[2] - sin * mean[3], sin * mean[2] + cos * mean[3]


@compiled
def write_predictions(
    predictions: Records,
    state: Records,
    models: Records,
    mean: FloatArray,
    cov: FloatArray,
    median: FloatArray,
    squared_deviation: FloatArray,
    known: FloatArray,
    lab_std: FloatArray,
    lab_prior_weight: float,
) -> None:
    """Write `predictions` (N,) of tracks with filters (N, 4), (N, 4, 4) and statistics of their attributes (N, 9)."""
    for n in range(len(state)):
        track, model, prediction = state[n], models[state[n].kind], predictions[n]
        prediction.kind, prediction.yaw_rad, prediction.unseen_s = track.kind, track.yaw_rad, track.unseen_s
        prediction.gate_scale, prediction.heading_weight = model.gate_scale, model.heading_weight
        for i in range(2):
            prediction.xy_m[i], prediction.size_m[i] = mean[n, i], median[n, i]
            prediction.displacement_m[i] = mean[n, i + 2] * track.moved_s
            for j in range(2):
                prediction.cov_m2[i, j] = cov[n, i, j]
    # The variance of the next detection's colour about the median is shrunk to that of all tracks. This is empirical
    # Bayes: the prior is the variance pooled over all tracks.
    for i in range(3):
        k = LAB.start + i
        total, count = lab_std[i] ** 2 * _LAB_STD_WEIGHT, _LAB_STD_WEIGHT
        for n in range(len(state)):
            total += squared_deviation[n, k]
            count += max(known[n, k], 1.0) - 1
        for n in range(len(state)):
            own = (total / count * lab_prior_weight + squared_deviation[n, k]) / (lab_prior_weight + known[n, k])
            predictions[n].lab_variance[i] = own * (1 + _MEDIAN_VARIANCE / max(known[n, k], 1.0))
            predictions[n].lab[i] = median[n, k]


@compiled
def measure(
    state: Records,
    found: Records,
    rows: IntArray,
    columns: IntArray,
    turn_rad: FloatArray,
    step_s: float,
    count: IntArray,
    median: FloatArray,
    xy_m: FloatArray,
    values: FloatArray,
    steady: BoolArray,
) -> None:
    """Write positions (M, 2) and attributes (M, 9) of matched detections, and which of them are `steady` (M,).

    A truncated vehicle is at least as large as its visible part, and as the `median` (N, 9) of its track. Steady are
    whole detections of tracks with a known velocity, after a `count` (N,) of them, that went straight on.
    """
    for m in range(len(rows)):
        seen, n = found[columns[m]], rows[m]
        steady[m] = turn_rad[m] == 0 and not seen.truncated and state[n].unseen_s <= 2 * step_s
        steady[m] &= count[n] >= _STEADY_DETECTIONS
        for i in range(2):
            xy_m[m, i] = seen.position_world_m[i]
        for k in range(3):
            values[m, SIZE.start + k], values[m, RGB.start + k] = seen.size_m[k], seen.rgb[k]
            values[m, LAB.start + k] = seen.lab[k]
            if seen.truncated and (median[n, k] > seen.size_m[k] or np.isnan(seen.size_m[k])):
                values[m, k] = median[n, k]


@compiled
def follow(
    state: Records,
    models: Records,
    found: Records,
    rows: IntArray,
    columns: IntArray,
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
        models: parameters of the categories.
        found: detections.
        rows: (M,) track indices.
        columns: (M,) detection indices.
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
    for m, n in enumerate(rows):
        track, seen = state[n], found[columns[m]]
        track.detection, track.ground_m = columns[m], seen.position_world_m[2]
        seconds = track.unseen_s
        _learn_return(track, models, returns, step_s, 1.0)
        track.tracked_s += seconds
        track.unseen_s = track.missed_s = track.moved_s = 0.0
        _add_evidence(track.detected, decay, weight, seen.evidence)
        _add_evidence(track.with_misses, decay, weight, seen.evidence)
        if seen.log_odds >= confirm_log_odds or track.tracked_s >= confirm_s:
            track.confirmed = True

        # The axis is smoothed as a vector at twice its angle; then the front is voted on. Smoothing twice tells how
        # far the axis lags in a bend (double exponential smoothing, Brown 1956).
        keep = np.exp(-seconds / heading_smoothing_s)
        for k in range(2):
            track.axis[k] = keep * track.axis[k] + (1 - keep) * seen.axis[k]
            track.earlier_axis[k] = keep * track.earlier_axis[k] + (1 - keep) * track.axis[k]
        ahead_x, ahead_y = 2 * track.axis[0] - track.earlier_axis[0], 2 * track.axis[1] - track.earlier_axis[1]
        yaw = np.arctan2(ahead_y, ahead_x) / 2
        if np.cos(yaw - track.yaw_rad) < 0:
            yaw += np.pi
        votes = track.front_votes + seen.heading_known * np.cos(seen.yaw_world_rad - yaw)
        speed = np.hypot(mean[n, 2], mean[n, 3])
        drives = track.moving and speed >= front_from_motion_mps
        # A slow vehicle whose detections agree on its front may reverse.
        drives &= speed >= _REVERSING_MPS or abs(votes) < _AGREED_VOTES
        forward = mean[n, 2] * np.cos(yaw) + mean[n, 3] * np.sin(yaw) if drives else votes
        if forward < 0:
            yaw, votes = yaw + np.pi, -votes
        track.yaw_rad = (yaw + np.pi) % (2 * np.pi) - np.pi
        # The votes now refer to the end chosen as front; motion counts as one, and fast motion overrules all.
        proved = drives and (speed >= _REVERSING_MPS or votes >= 0)
        track.front_votes = max(votes, 1.0) if proved else votes
        track.front_known = drives or votes > 0


@compiled
def _add_evidence(evidence: FloatArray, decay: float, weight: float, log_odds: float) -> None:
    """Add one frame to the sum and the weight of the evidence (2,) of a track."""
    evidence[0] = decay * evidence[0] + weight * log_odds
    evidence[1] = decay * evidence[1] + weight


@compiled
def _mean_log_odds(evidence: FloatArray, model: Any) -> float:
    """Return the mean evidence, of its sum and weight (2,), with the prior of the category."""
    prior = model.prior_log_odds * model.prior_weight
    mean: float = (evidence[0] + prior) / (evidence[1] + model.prior_weight)
    return mean


@compiled
def score_tracks(state: Records, models: Records, log_odds: FloatArray, with_misses: FloatArray) -> None:
    """Write the log-odds (N,) of tracks, by their detections alone and with misses."""
    for n in range(len(state)):
        log_odds[n] = _mean_log_odds(state[n].detected, models[state[n].kind])
        with_misses[n] = _mean_log_odds(state[n].with_misses, models[state[n].kind])


@compiled
def _group(track: Any, models: Records) -> int:
    """Return the group of tracks with the same chance to return: by level of score, visible or hidden."""
    log_odds, group = _mean_log_odds(track.detected, models[track.kind]), 0
    for limit in _LEVELS:
        group += log_odds > limit
    return 2 * group + 1 if track.hidden > _HIDDEN else 2 * group


@compiled
def _learn_return(track: Any, models: Records, returns: FloatArray, step_s: float, returned: float) -> None:
    """Learn from a frame in which a confirmed track could return after missed frames."""
    missed = int(track.unseen_s / step_s + 0.5) - 1  # before this frame
    if track.confirmed and 0 < missed <= _MOST_MISSED:
        group = _group(track, models)
        returns[0, group, missed] += returned
        returns[1, group, missed] += 1.0


@compiled
def count_misses(
    state: Records,
    models: Records,
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
    for n in range(len(state)):
        track = state[n]
        if track.detection < 0 and blind[n]:
            track.missed_s = max(track.missed_s - seconds, 0.0)
        elif track.detection < 0:
            _add_evidence(track.with_misses, decay, weight, miss_log_odds)
            _learn_return(track, models, returns, step_s, 0.0)
            track.hidden = hidden[n]
        remembered_s = forget_stationary_s if track.stationary else forget_s
        likely = _mean_log_odds(track.detected, models[track.kind]) > 0
        missed_for_s = (remembered_s if likely else lost_s) if track.confirmed else 0.0
        expired[n] = track.missed_s > missed_for_s or track.unseen_s > remembered_s


@compiled
def find_reportable(
    state: Records,
    models: Records,
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
    for n in range(len(state)):
        track = state[n]
        reported[n] = track.confirmed and track.unseen_s == 0
        if track.confirmed and 0 < track.unseen_s <= coast_s and std_m[n] <= coast_std_m:
            chance = _chance_to_return(returns, _group(track, models), track.unseen_s, step_s, lost_s)
            reported[n] = chance >= coast_chance


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
