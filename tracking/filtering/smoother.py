"""Tracks in hindsight, for who labels data: whole paths are smoothed, gaps filled, and false ends left out.

The tracker's own states are what a Kalman filter says at each sighting. The backward pass of Rauch, Tung and Striebel
over those states, with the filter's own model of motion, is what all sightings together say. To filter the tracker's
places a second time would say less: their errors are no longer independent.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from appocc.checks import BoolArray, FloatArray, IntArray
from appocc.errors import ShapeError
from appocc.geometry import wrap_angle
from tracking.filtering.kalman import MotionConfig, Motions, spread
from tracking.tracks import Track, check_times

ComplexArray = NDArray[np.complex128]
# Headings and heights are averaged over the way in steps of this share of `way_m`.
_STEP = 0.25
# A sighting whose axis is farther off counts for next to nothing.
_OUTLIER_RAD, _NEXT_TO_NOTHING = np.radians(15.0), 1e-6


@dataclass(frozen=True)
class SmoothingConfig:
    """How tracks are smoothed.

    Attributes:
        gap_s: a longer span without a sighting is not filled; at two key frames a second, one that misses is.
        way_m: headings and heights are means over so much of the way (standard deviation), however long it takes: a
            vehicle that stands has one of either.
        fast_mps: from this speed on the heading is the direction of motion.
        motion: that of the tracker that made the tracks.
    """

    gap_s: float = 1.1
    way_m: float = 1.0
    fast_mps: float = 3.0
    motion: MotionConfig = field(default_factory=MotionConfig)


def paths_of(tracks: Sequence[Sequence[Track]]) -> dict[int, list[tuple[int, Track]]]:
    """Each vehicle by its id, in order of ids: the numbers of the moments that tell of it, and what they tell."""
    paths: dict[int, list[tuple[int, Track]]] = {}
    for moment, told in enumerate(tracks):
        for track in told:
            paths.setdefault(track.id, []).append((moment, track))
    return dict(sorted(paths.items()))


def smooth(
    times_us: Sequence[int], tracks: Sequence[Sequence[Track]], config: SmoothingConfig | None = None
) -> tuple[tuple[Track, ...], ...]:
    """The tracks of T moments as all moments together show them; ids stay.

    A vehicle is told of from its first to its last sighting, but for gaps longer than `gap_s`; predictions beyond the
    last are left out, for nothing confirms them. Its size and colour are medians over its sightings, its score is the
    last one, which all sightings have gone into, and its front is where it was found to be in the end.

    Args:
        times_us: T times, rising.
        tracks: T sequences of a tracker's tracks.
        config: by default for a tracker with the default motion.

    Returns:
        T tuples of tracks in order of id.

    Raises:
        ShapeError: if there are not as many times as moments, or time does not move forward.
    """
    config = config or SmoothingConfig()
    check_times("smoothing", times_us, tracks)
    since_us = np.array([time_us - times_us[0] for time_us in times_us], dtype=np.float64)
    times_s = np.asarray(since_us * 1e-6)
    if (np.diff(times_s) <= 0).any():
        raise ShapeError("smoothing: expected times that rise")
    told: list[list[Track]] = [[] for _ in tracks]
    for path in paths_of(tracks).values():
        seen = [(moment, track) for moment, track in path if track.seen]
        if seen:
            first, last = seen[0][0], seen[-1][0]
            rows = np.array([moment - first for moment, _ in seen])
            vehicle = _Vehicle(times_s[first : last + 1], rows, tuple(track for _, track in seen))
            for row, track in _smoothed(vehicle, config):
                told[first + row].append(track)
    return tuple(map(tuple, told))


class _Vehicle(NamedTuple):
    """One vehicle from its first to its last sighting.

    Attributes:
        times_s: (N,) times of all moments.
        rows: (S,) at which of them it was seen, the first and the last among them.
        sights: S tracks.
    """

    times_s: FloatArray
    rows: IntArray
    sights: tuple[Track, ...]

    def all(self, name: str) -> FloatArray:
        """(S, ...) an attribute of the sightings."""
        return np.array([getattr(track, name) for track in self.sights], dtype=np.float64)

    def median(self, name: str) -> FloatArray:
        """Median of an attribute over the sightings that show it; NaN if none does."""
        values = self.all(name)
        known = values[np.isfinite(values.reshape(len(values), -1)).all(axis=1)]
        return np.asarray(np.median(known, axis=0) if len(known) else np.full(values.shape[1:], np.nan))

    @property
    def latest(self) -> IntArray:
        """(N,) number of the latest sighting at each moment."""
        return np.searchsorted(self.rows, np.arange(len(self.times_s)), side="right") - 1


def _smoothed(vehicle: _Vehicle, config: SmoothingConfig) -> Iterator[tuple[int, Track]]:
    """Its moments, counted from its first sighting, but for those in long gaps."""
    times_s, rows, sights = vehicle
    states = _states(vehicle, config.motion)
    moves = states.moves()
    yaw_rad, ground_m = _headings_and_heights(vehicle, states.mean[:, 2:], moves, config)
    rgb, length_m, width_m, height_m = map(vehicle.median, ("rgb", "length_m", "width_m", "height_m"))
    gap_s = np.append(np.diff(times_s[rows]), 0.0)
    for row, number in enumerate(vehicle.latest.tolist()):
        here = bool(rows[number] == row)
        if not here and gap_s[number] > config.gap_s:
            continue
        yield (
            row,
            Track(
                id=sights[number].id,
                position_world_m=np.append(states.mean[row, :2], ground_m[row]),
                velocity_world_mps=states.mean[row, 2:].copy(),
                yaw_world_rad=float(yaw_rad[row]),
                heading_known=sights[-1].heading_known,
                length_m=float(length_m),
                width_m=float(width_m),
                rgb=rgb.copy(),
                score=sights[-1].score,
                seen=here,
                height_m=float(height_m),
                kind=sights[number].kind,
                detection=sights[number].detection if here else None,
                moving=bool(moves[row]),
            ),
        )


def _states(vehicle: _Vehicle, config: MotionConfig) -> Motions:
    """Places and velocities at the N moments.

    How uncertain the tracker's states are does not depend on what was seen, only on when: a filter beside it finds it
    out anew.
    """
    from filterpy.kalman import KalmanFilter  # takes a second, and few need it

    times_s, rows, _ = vehicle
    latest = vehicle.latest
    yaw = vehicle.all("yaw_world_rad")[latest]
    place, velocity = vehicle.all("position_world_m")[latest, :2], vehicle.all("velocity_world_mps")[latest]
    origin = np.append(place[0], [0.0, 0.0])
    told = np.hstack([place + (times_s - times_s[rows[latest]])[:, None] * velocity, velocity]) - origin

    step_s = np.diff(times_s, prepend=times_s[0])
    moved = np.eye(4) + step_s[:, None, None] * np.eye(4, k=2)
    walk = np.array([[step_s**3 / 3, step_s**2 / 2], [step_s**2 / 2, step_s]])
    push = spread(np.append(yaw[:1], yaw[:-1]), config.push_m2ps3, config.swerve_m2ps3)
    pushed = np.einsum("ijn,nkl->nikjl", walk, push).reshape(-1, 4, 4)
    noise_m2 = spread(yaw, config.along_m**2, config.across_m**2)

    begun = Motions(config)
    begun.add(told[:1, :2], yaw[:1], noise_m2[:1])
    kalman = KalmanFilter(dim_x=4, dim_z=2)
    kalman.x, kalman.P, kalman.H = begun.mean[0], begun.cov[0], np.eye(2, 4)
    later = set(rows[1:].tolist())
    shown = [place if row in later else None for row, place in enumerate(told[:, :2])]
    _, cov, _, _ = kalman.batch_filter(shown, Fs=moved, Qs=pushed, Rs=noise_m2)
    result = Motions(config)
    result.mean, result.cov, _, _ = kalman.rts_smoother(told, cov, moved, pushed)
    result.mean += origin
    return result


def _headings_and_heights(
    vehicle: _Vehicle, velocity_mps: FloatArray, moves: BoolArray, config: SmoothingConfig
) -> tuple[FloatArray, FloatArray]:
    """Headings (N,) in [-pi, pi) and heights of the ground (N,), given velocities (N, 2) and whether it moves (N,).

    They are means over the way, not over time: a vehicle turns and climbs only as it drives.
    """
    times_s, rows, sights = vehicle
    speed_mps = np.hypot(*velocity_mps.T)
    yaw = np.full(len(times_s), np.nan)
    yaw[rows] = vehicle.all("yaw_world_rad")
    axis = np.where(speed_mps >= config.fast_mps, np.arctan2(velocity_mps[:, 1], velocity_mps[:, 0]), yaw)
    known = np.flatnonzero(np.isfinite(axis))
    # Nothing counts across six standard deviations of the way.
    way_m = np.minimum(np.diff(times_s) * (speed_mps * moves)[1:], 6 * config.way_m)
    step = (np.append(0.0, np.cumsum(way_m)) / (_STEP * config.way_m)).astype(np.int64)

    twice = np.exp(2j * axis[known])
    mean = _mean_axis(twice, step[known], np.ones(len(known)))
    near = np.abs(np.sin(axis[known] - mean)) < np.sin(_OUTLIER_RAD)
    mean = np.unwrap(_mean_axis(twice, step[known], np.where(near, 1.0, _NEXT_TO_NOTHING)), period=np.pi)
    smoothed = np.interp(times_s, times_s[known], mean)
    if np.cos(smoothed[-1] - sights[-1].yaw_world_rad) < 0:
        smoothed += np.pi

    heights = vehicle.all("position_world_m")[:, 2]
    mean = _sums(heights, step[rows]) / _sums(np.ones(len(rows)), step[rows])
    return wrap_angle(smoothed), np.interp(times_s, times_s[rows], mean)


def _mean_axis(twice: ComplexArray, step: IntArray, weight: FloatArray) -> FloatArray:
    """(S,) angles of the local means of unit numbers of twice the angle (S,)."""
    return np.asarray(np.arctan2(_sums(twice.imag * weight, step), _sums(twice.real * weight, step)) / 2)


def _sums(values: FloatArray, step: IntArray) -> FloatArray:
    """(S,) sums of values, weighted by how near they are along the way, which is given in steps from 0, rising."""
    return np.asarray(gaussian_filter1d(np.bincount(step, values), 1 / _STEP, mode="constant")[step])
