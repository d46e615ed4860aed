"""Vehicle motion from front bumpers: smooth paths, and rear axles that trail without sideslip."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d, median_filter

from appocc.checks import FloatArray, IntArray

# Distance of the rear axle behind the front bumper, as a share of the length.
AXLE_SHARE = 0.8
_SPACING_M, _ALONG_M, _TIME_STEPS = 0.2, 1.3, 4.0
_JUMP_M = 0.8  # displacement in 0.1 s beyond the usual one that marks a teleport of SUMO


def vehicle_motion(
    front_m: FloatArray, yaw_rad: FloatArray, length_m: FloatArray
) -> tuple[FloatArray, FloatArray, IntArray]:
    """Return the motion of vehicles from SUMO's front bumpers (T, A, 2), headings (T, A) and the lengths (A,).

    SUMO's vehicles turn on the spot where lanes meet at an angle; here the bumper's path is smoothed and the rear
    axle follows it like a trailer (tractrix), so that bodies turn like real cars.

    Returns:
        Centres (T, A, 2), headings (T, A), and the index (T, A) of the uninterrupted presence, counted per
        vehicle from 0; -1 while absent.
    """
    front, part = np.full_like(front_m, np.nan), np.full(yaw_rad.shape, -1)
    for k in range(front_m.shape[1]):
        for number, (start, end) in enumerate(_presences(front_m[:, k])):
            front[start:end, k] = _smooth_path(front_m[start:end, k])
            part[start:end, k] = number
    yaw = _trailing_headings(front, yaw_rad, AXLE_SHARE * length_m, part)
    ahead = np.stack([np.cos(yaw), np.sin(yaw)], axis=-1)
    return front - ahead * length_m[:, None] / 2, yaw, part


def _presences(xy_m: FloatArray) -> list[tuple[int, int]]:
    """Return the ranges of steps in which a bumper (T, 2) is present without a gap or a jump."""
    there = np.isfinite(xy_m[:, 0])
    step = np.nan_to_num(np.hypot(*np.diff(xy_m, axis=0).T))
    usual = median_filter(step, 9, mode="nearest")
    joined = there[1:] & there[:-1] & (step < usual * 1.5 + _JUMP_M)
    starts = np.flatnonzero(there & ~np.concatenate([[False], joined]))
    ends = np.flatnonzero(there & ~np.concatenate([joined, [False]])) + 1
    return [(int(a), int(b)) for a, b in zip(starts, ends, strict=True)]


def _smooth_path(xy_m: FloatArray) -> FloatArray:
    """Round the corners of a path (N, 2), and smooth its speed."""
    step = np.hypot(*np.diff(xy_m, axis=0).T)
    along = np.concatenate([[0.0], np.cumsum(step)])
    if along[-1] < 0.5:
        return np.tile(xy_m[len(xy_m) // 2], (len(xy_m), 1))
    keep = np.concatenate([[True], step > 1e-6])
    at = np.arange(0.0, along[-1] + _SPACING_M, _SPACING_M)
    path = np.stack([np.interp(at, along[keep], xy_m[keep, axis]) for axis in (0, 1)], axis=1)
    path = np.stack([_smooth_values(path[:, axis], _ALONG_M / _SPACING_M) for axis in (0, 1)], axis=1)
    even = np.clip(_smooth_values(along, _TIME_STEPS), 0.0, along[-1])
    return np.stack([np.interp(even, at, path[:, axis]) for axis in (0, 1)], axis=1)


def _smooth_values(values: FloatArray, sigma: float) -> FloatArray:
    """Smooth by a Gaussian; values are extrapolated beyond the ends by point reflection."""
    pad = min(int(4 * sigma), len(values) - 1)
    before, after = 2 * values[0] - values[pad:0:-1], 2 * values[-1] - values[-2 : -pad - 2 : -1]
    smooth = gaussian_filter1d(np.concatenate([before, values, after]), sigma, mode="nearest")
    return np.asarray(smooth[pad : pad + len(values)])


def _trailing_headings(front: FloatArray, yaw_rad: FloatArray, axle_m: FloatArray, part: IntArray) -> FloatArray:
    """Return headings (T, A) of bodies whose rear axle follows the bumper at a fixed distance."""
    yaw = np.full(yaw_rad.shape, np.nan)
    rear = np.full(front.shape[1:], np.nan)
    begins = np.concatenate([part[:1] >= 0, (part[1:] >= 0) & (part[1:] != part[:-1])])
    for t in range(len(front)):
        first = np.stack([np.cos(yaw_rad[t]), np.sin(yaw_rad[t])], axis=1)
        rear = np.where(begins[t, :, None], front[t] - axle_m[:, None] * first, rear)
        ahead = front[t] - rear
        yaw[t] = np.arctan2(ahead[:, 1], ahead[:, 0])
        rear = front[t] - axle_m[:, None] * ahead / np.maximum(np.hypot(*ahead.T), 1e-9)[:, None]
    return yaw
