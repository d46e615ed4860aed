"""Offline (Rauch-Tung-Striebel) smoothing of tracks, for labelling: paths are smoothed and gaps are filled.

The states of the tracker are the forward pass of a Kalman filter. The smoother runs the backward pass over these
states with the same motion model, so that each state uses all detections. Filtering the tracker's positions a second
time would be wrong: their errors are correlated.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.ndimage import gaussian_filter1d

from appocc.checks import BoolArray, FloatArray, IntArray
from appocc.errors import ShapeError
from appocc.geometry import wrap_angle
from appocc.motion_state import MOVING_MPS
from tracking.filtering.kalman import KalmanFilters, MotionConfig, acceleration_psd, oriented_covariance
from tracking.tracks import Track, check_times, group_by_track

ComplexArray = NDArray[np.complex128]
# Step along the path for averages of headings and heights, as a fraction of `window_m`.
_STEP = 0.25
# Headings that differ by more from the local mean get a negligible weight.
_OUTLIER_RAD, _NEGLIGIBLE_WEIGHT = np.radians(15.0), 1e-6


@dataclass(frozen=True)
class SmoothingConfig:
    """Configuration of the smoother.

    Attributes:
        max_gap_s: longer gaps without a detection are not filled; the default fills one missed key frame at 2 Hz.
        window_m: standard deviation of the average of headings and heights along the path; a stationary vehicle has
            one heading and one height.
        heading_from_motion_mps: speed above which the heading is the direction of motion.
        motion: motion model of the tracker that produced the tracks.
    """

    max_gap_s: float = 1.1
    window_m: float = 1.0
    heading_from_motion_mps: float = 3.0
    motion: MotionConfig = field(default_factory=MotionConfig)


def smooth(
    times_us: Sequence[int], tracks: Sequence[Sequence[Track]], config: SmoothingConfig | None = None
) -> tuple[tuple[Track, ...], ...]:
    """Smooth the tracks of T frames; ids do not change.

    A track is kept from its first to its last detection, except for gaps longer than `max_gap_s`; predictions after
    the last detection are dropped. Size and colour are medians over all detections; score and front are the final
    ones.

    Args:
        times_us: T increasing times.
        tracks: T sequences of tracks.
        config: by default, for a tracker with the default motion model.

    Returns:
        T tuples of tracks, ordered by id.

    Raises:
        ShapeError: if the numbers of times and frames differ, or time does not increase.
    """
    config = config or SmoothingConfig()
    check_times("smoothing", times_us, tracks)
    since_us = np.array([time_us - times_us[0] for time_us in times_us], dtype=np.float64)
    times_s = np.asarray(since_us * 1e-6)
    if (np.diff(times_s) <= 0).any():
        raise ShapeError("smoothing: expected times that rise")
    result: list[list[Track]] = [[] for _ in tracks]
    for path in group_by_track(tracks).values():
        detected = [(frame, track) for frame, track in path if track.seen]
        if detected:
            first, last = detected[0][0], detected[-1][0]
            rows = np.array([frame - first for frame, _ in detected])
            one = _TrackPath(times_s[first : last + 1], rows, tuple(track for _, track in detected))
            for row, track in _smooth_path(one, config):
                result[first + row].append(track)
    return tuple(map(tuple, result))


class _TrackPath(NamedTuple):
    """States of one track from its first to its last detection.

    Attributes:
        times_s: (N,) times of all frames.
        rows: (S,) frames with a detection, including the first and the last one.
        states: S track states.
    """

    times_s: FloatArray
    rows: IntArray
    states: tuple[Track, ...]

    def values(self, name: str) -> FloatArray:
        """Return an attribute of the states (S, ...)."""
        return np.array([getattr(track, name) for track in self.states], dtype=np.float64)

    def median(self, name: str) -> FloatArray:
        """Return the median of an attribute over its known values; NaN if there are none."""
        values = self.values(name)
        known = values[np.isfinite(values.reshape(len(values), -1)).all(axis=1)]
        return np.asarray(np.median(known, axis=0) if len(known) else np.full(values.shape[1:], np.nan))

    @property
    def latest(self) -> IntArray:
        """(N,) index of the latest state at each frame."""
        return np.searchsorted(self.rows, np.arange(len(self.times_s)), side="right") - 1


def _smooth_path(path: _TrackPath, config: SmoothingConfig) -> Iterator[tuple[int, Track]]:
    """Yield the smoothed tracks with their frames, counted from the first detection, except in long gaps."""
    times_s, rows, states = path
    smoothed = _smooth_states(path, config.motion)
    moving = smoothed.is_moving()
    velocity_known = moving | smoothed.is_stationary(MOVING_MPS)
    yaw_rad, ground_m = _headings_and_heights(path, smoothed.mean[:, 2:], moving, config)
    rgb, length_m, width_m, height_m = map(path.median, ("rgb", "length_m", "width_m", "height_m"))
    gap_s = np.append(np.diff(times_s[rows]), 0.0)
    for row, index in enumerate(path.latest.tolist()):
        seen = bool(rows[index] == row)
        if not seen and gap_s[index] > config.max_gap_s:
            continue
        yield (
            row,
            Track(
                id=states[index].id,
                position_world_m=np.append(smoothed.mean[row, :2], ground_m[row]),
                velocity_world_mps=smoothed.mean[row, 2:],
                yaw_world_rad=float(yaw_rad[row]),
                heading_known=states[-1].heading_known,
                length_m=float(length_m),
                width_m=float(width_m),
                rgb=rgb,
                score=states[-1].score,
                seen=seen,
                height_m=float(height_m),
                kind=states[index].kind,
                detection=states[index].detection if seen else None,
                moving=bool(moving[row]),
                velocity_known=bool(velocity_known[row]),
            ),
        )


def _smooth_states(path: _TrackPath, config: MotionConfig) -> KalmanFilters:
    """Smooth positions and velocities at the N frames.

    The covariances of the forward pass depend on the times of the detections, not on their values: a second filter
    reproduces them.
    """
    from filterpy.kalman import KalmanFilter  # slow import, only needed here

    times_s, rows, _ = path
    latest = path.latest
    yaw = path.values("yaw_world_rad")[latest]
    position, velocity = path.values("position_world_m")[latest, :2], path.values("velocity_world_mps")[latest]
    origin = np.append(position[0], [0.0, 0.0])
    extrapolated = position + (times_s - times_s[rows[latest]])[:, None] * velocity
    forward = np.hstack([extrapolated, velocity]) - origin

    step_s = np.diff(times_s, prepend=times_s[0])
    transitions = np.eye(4) + step_s[:, None, None] * np.eye(4, k=2)
    walk = np.array([[step_s**3 / 3, step_s**2 / 2], [step_s**2 / 2, step_s]])
    previous_yaw = np.append(yaw[:1], yaw[:-1])
    previous_velocity = np.concatenate([velocity[:1], velocity[:-1]])
    along, across = config.along_accel_psd_m2ps3, config.across_accel_psd_m2ps3
    psd = acceleration_psd(previous_yaw, previous_velocity, along, across, config.heading_psd_rad2ps)
    process_noise = np.einsum("ijn,nkl->nikjl", walk, psd).reshape(-1, 4, 4)
    noise_m2 = oriented_covariance(yaw, config.along_std_m**2, config.across_std_m**2)

    speed_m2ps2 = oriented_covariance(yaw[:1], config.along_speed_std_mps**2, config.across_speed_std_mps**2)
    kalman = KalmanFilter(dim_x=4, dim_z=2)
    kalman.x, kalman.P, kalman.H = np.zeros(4), block_diag(noise_m2[0], speed_m2ps2[0]), np.eye(2, 4)
    updated = set(rows[1:].tolist())
    measured = [xy if row in updated else None for row, xy in enumerate(forward[:, :2])]
    _, cov, _, _ = kalman.batch_filter(measured, Fs=transitions, Qs=process_noise, Rs=noise_m2)
    result = KalmanFilters()
    result.mean, result.cov, _, _ = kalman.rts_smoother(forward, cov, transitions, process_noise)
    result.mean += origin
    return result


def _headings_and_heights(
    path: _TrackPath, velocity_mps: FloatArray, moving: BoolArray, config: SmoothingConfig
) -> tuple[FloatArray, FloatArray]:
    """Return headings (N,) in [-pi, pi) and ground heights (N,), given velocities (N, 2) and moving flags (N,).

    They are averaged over the path, not over time: headings and heights only change while a vehicle moves.
    """
    times_s, rows, states = path
    speed_mps = np.hypot(*velocity_mps.T)
    yaw = np.full(len(times_s), np.nan)
    yaw[rows] = path.values("yaw_world_rad")
    is_fast = speed_mps >= config.heading_from_motion_mps
    axis = np.where(is_fast, np.arctan2(velocity_mps[:, 1], velocity_mps[:, 0]), yaw)
    known = np.flatnonzero(np.isfinite(axis))
    # Six standard deviations separate two parts of the path completely.
    step_m = np.minimum(np.diff(times_s) * (speed_mps * moving)[1:], 6 * config.window_m)
    step = (np.append(0.0, np.cumsum(step_m)) / (_STEP * config.window_m)).astype(np.int64)

    twice = np.exp(2j * axis[known])
    mean = _mean_axis(twice, step[known], np.ones(len(known)))
    inlier = np.abs(np.sin(axis[known] - mean)) < np.sin(_OUTLIER_RAD)
    mean = np.unwrap(_mean_axis(twice, step[known], np.where(inlier, 1.0, _NEGLIGIBLE_WEIGHT)), period=np.pi)
    smoothed = np.interp(times_s, times_s[known], mean)
    if np.cos(smoothed[-1] - states[-1].yaw_world_rad) < 0:
        smoothed += np.pi

    heights = path.values("position_world_m")[:, 2]
    mean = _local_sums(heights, step[rows]) / _local_sums(np.ones(len(rows)), step[rows])
    return wrap_angle(smoothed), np.interp(times_s, times_s[rows], mean)


def _mean_axis(twice: ComplexArray, step: IntArray, weight: FloatArray) -> FloatArray:
    """(S,) local mean angles of unit numbers at twice the angle (S,)."""
    return np.asarray(np.arctan2(_local_sums(twice.imag * weight, step), _local_sums(twice.real * weight, step)) / 2)


def _local_sums(values: FloatArray, step: IntArray) -> FloatArray:
    """(S,) sums of values with Gaussian weights along the path; `step` (S,) are ascending positions from 0."""
    return np.asarray(gaussian_filter1d(np.bincount(step, values), 1 / _STEP, mode="constant")[step])
