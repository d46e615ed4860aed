"""Ego poses over time: from a file, straight ahead at a speed, or standing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from appocc.checks import FloatArray, IntArray
from appocc.errors import DataError
from appocc.geometry import interpolate_pose, inverse, transform

# A longer gap between two poses is not bridged.
_LONGEST_GAP_US = 2_000_000
# Way on which a heading is measured, well above the noise of satellite positions.
_HEADING_WAY_M = 3.0
# No vehicle moves more than this off its heading; no noise of satellite positions turns half of a way so far.
_SIDEWAYS_DEG = 30.0
# Satellite positions of a standing vehicle wander as far.
_WANDER_M = 10.0


class Motion(Protocol):
    """Ego poses over time."""

    def at(self, time_us: int) -> FloatArray | None:
        """Return the (4, 4) pose world_from_ego at a time; None if it is unknown."""
        ...


@dataclass(frozen=True)
class Straight:
    """Motion straight ahead, from the world's origin along x.

    Attributes:
        speed_mps: speed; 0: standing.
        start_us: time at the origin.
    """

    speed_mps: float
    start_us: int

    def at(self, time_us: int) -> FloatArray:
        """Return the (4, 4) pose world_from_ego at a time."""
        return transform(np.eye(3), [self.speed_mps * (time_us - self.start_us) * 1e-6, 0.0, 0.0])


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Measured poses, interpolated: linear translation, slerp rotation.

    Attributes:
        times_us: (N,) rising times.
        world_from_ego: (N, 4, 4) poses.
        note: a line for people about what the source does not measure; '' if nothing.
    """

    times_us: IntArray
    world_from_ego: FloatArray
    note: str = ""

    def at(self, time_us: int) -> FloatArray | None:
        """Return the (4, 4) pose world_from_ego at a time; None outside of the times and in gaps of over 2 s."""
        times = self.times_us
        after = int(np.searchsorted(times, time_us))
        if after < len(times) and times[after] == time_us:
            return np.array(self.world_from_ego[after])
        if after in (0, len(times)) or times[after] - times[after - 1] > _LONGEST_GAP_US:
            return None
        near = slice(after - 1, after + 1)
        return interpolate_pose((times[near] - time_us).astype(np.float64), self.world_from_ego[near], 0.0)

    def of_ego(self, ego_from_cam: FloatArray) -> Trajectory:
        """Return the trajectory of the ego frame if these are poses of a camera.

        The world is the ego frame of the first pose, because the world of a camera's poses often has no axis up.
        """
        poses = self.world_from_ego @ inverse(ego_from_cam)
        return Trajectory(self.times_us, inverse(poses[0]) @ poses, self.note)

    def check_upright(self, where: str) -> None:
        """Check that the ego's z axis points up in the world.

        Raises:
            DataError: if it is tilted by more than 45 degrees.
        """
        up = self.world_from_ego[:, 2, 2]
        if up.min() < np.cos(np.pi / 4):
            row = int(np.argmin(up))
            tilt = np.degrees(np.arccos(np.clip(up[row], -1, 1)))
            raise DataError(
                f"{where}: expected poses of the ego frame (z up), got one that is tilted by {tilt:.0f} degrees "
                f"(pose {row}); are they those of a camera (--poses-of CAMERA), or quaternions in another order?"
            )

    def check_ahead(self, where: str) -> None:
        """Check that the ego moves along its x axis, forwards or backwards, as vehicles do.

        Raises:
            DataError: if half of its way is more than 30 degrees off.
        """
        xy = self.world_from_ego[:, :2, 3]
        kept = _stations(xy)
        steps, middles = np.diff(xy[kept], axis=0), (np.array(kept[:-1]) + np.array(kept[1:])) // 2
        ahead = self.world_from_ego[middles, :2, 0]
        across = ahead[:, 0] * steps[:, 1] - ahead[:, 1] * steps[:, 0]
        off_deg = np.degrees(np.arctan2(np.abs(across), np.abs((ahead * steps).sum(axis=1))))
        far_m = np.hypot(*(xy - xy[0]).T).max()
        if far_m > _WANDER_M and np.median(off_deg) > _SIDEWAYS_DEG:
            raise DataError(
                f"{where}: expected headings along the way, counter-clockwise from x (yaw_deg in degrees, yaw_rad in "
                f"radians), got ones that are {np.median(off_deg):.0f} degrees off it; without headings, the way "
                "gives them"
            )


def headings_of_way(xy_m: FloatArray, where: str) -> FloatArray:
    """Return the headings (N,) in radians of places (N, 2) in order of time: the direction of motion.

    While standing, the heading stays about that of the way. Driving backwards cannot be told from driving forwards.

    Raises:
        DataError: if the whole way is too short.
    """
    kept = _stations(xy_m)
    if len(kept) < 2:
        raise DataError(f"{where}: no headings, and the way is too short for them: expected {_HEADING_WAY_M:g} m")
    steps = np.diff(xy_m[kept], axis=0)
    yaws = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    middles = (np.array(kept[:-1]) + np.array(kept[1:])) / 2
    return np.interp(np.arange(len(xy_m)), middles, yaws)


def _stations(xy_m: FloatArray) -> list[int]:
    """Return the indices of places (N, 2) in order of time between which a heading can be measured."""
    kept = [0]
    for i, place in enumerate(xy_m):
        if np.hypot(*(place - xy_m[kept[-1]])) >= _HEADING_WAY_M:
            kept.append(i)
    return kept
