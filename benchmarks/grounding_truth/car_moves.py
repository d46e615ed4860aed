"""Where a car can drive on a true map: all poses that short arcs at a few steering angles lead to.

A search over poses by increasing cost; it shares no code with the planner. The footprint is sampled by points and
must stay on free road; poses are told apart by cell and heading.
"""

from __future__ import annotations

import heapq
from typing import NamedTuple

import numba
import numpy as np

from appocc.checks import BoolArray, FloatArray
from appocc.ego_vehicle import EgoVehicle

# Poses of one cell and heading step count as one; length of an arc; cost of a metre backwards and of changing gear.
CELL_M, HEADINGS, ARC_M, BACKWARDS, GEAR = 0.5, 40, 1.0, 1.5, 2.0
# The footprint is smaller by this on all sides: the search is coarse, and gives the benefit of the doubt.
SHRUNK_M = 0.12
# Share of the length between the axles.
_WHEELBASE = 0.6
# A pose counts as reached within these.
NEAR_M, NEAR_RAD = 0.9, np.radians(14)


class Reached(NamedTuple):
    """The poses of the centre that a car reaches: position (N, 2), heading (N,), and metres backwards (N,)."""

    xy_m: FloatArray
    yaw_rad: FloatArray
    back_m: FloatArray

    def least_back_m(self, xy_m: FloatArray, yaw_rad: float) -> float:
        """Return the fewest metres backwards on a way to a pose, infinity if there is none."""
        off = np.abs((self.yaw_rad - yaw_rad + np.pi) % (2 * np.pi) - np.pi)
        close = (off < NEAR_RAD) & (np.hypot(*(self.xy_m - xy_m).T) < NEAR_M)
        return float(np.min(self.back_m[close], initial=np.inf))


def least_radius_m(ego: EgoVehicle) -> float:
    """Return the radius of the rear axle's centre in the turning circle of the outer front wheel."""
    wheelbase, half = _WHEELBASE * ego.length_m, ego.width_m / 2
    return float(np.sqrt((ego.turning_circle_m / 2) ** 2 - wheelbase**2) - half)


def reached_poses(free: BoolArray, cell_m: float, low_m: FloatArray, ego: EgoVehicle, most_back_m: float) -> Reached:
    """Return the poses that the ego reaches from the origin.

    Args:
        free: (X, Y) cells of free road, ego frame.
        cell_m: their size.
        low_m: (2,) lower corner of the first.
        ego: size of the ego vehicle.
        most_back_m: poses that need more metres backwards are left out.
    """
    x = np.linspace(-ego.rear_overhang_m + SHRUNK_M, ego.length_m - ego.rear_overhang_m - SHRUNK_M, 11)
    y = np.linspace(-ego.width_m / 2 + SHRUNK_M, ego.width_m / 2 - SHRUNK_M, 5)
    body = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    poses = _search(free, cell_m, low_m, body, 1 / least_radius_m(ego), most_back_m)
    ahead = np.stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])], axis=-1)
    return Reached(poses[:, :2] + ego.centre_m * ahead, poses[:, 2], poses[:, 3])


@numba.njit(cache=True)
def _fits(
    free: BoolArray, cell_m: float, low_m: FloatArray, body: FloatArray, x: float, y: float, yaw: float
) -> bool:
    cos, sin = np.cos(yaw), np.sin(yaw)
    for k in range(len(body)):
        i = int(np.floor((x + body[k, 0] * cos - body[k, 1] * sin - low_m[0]) / cell_m))
        j = int(np.floor((y + body[k, 0] * sin + body[k, 1] * cos - low_m[1]) / cell_m))
        if i < 0 or j < 0 or i >= free.shape[0] or j >= free.shape[1] or not free[i, j]:
            return False
    return True


@numba.njit(cache=True)
def _search(
    free: BoolArray, cell_m: float, low_m: FloatArray, body: FloatArray, bend: float, most_back_m: float
) -> FloatArray:
    """Return the rear-axle poses (N, 4) reached: x, y, heading, metres backwards."""
    shape = (int(free.shape[0] * cell_m / CELL_M) + 1, int(free.shape[1] * cell_m / CELL_M) + 1, HEADINGS)
    done = np.zeros(shape, np.bool_)
    poses = [(0.0, 0.0, 0.0, 0.0)]
    heap = [(0.0, 0, 1)]
    count = 0
    out = np.zeros((done.size // 4, 4))
    while heap:
        cost, number, gear = heapq.heappop(heap)
        x, y, yaw, back = poses[number]
        i, j = int((x - low_m[0]) / CELL_M), int((y - low_m[1]) / CELL_M)
        k = int(np.floor(yaw / (2 * np.pi) * HEADINGS + 0.5)) % HEADINGS
        if done[i, j, k] or count == len(out):
            continue
        done[i, j, k] = True
        out[count] = x, y, yaw, back
        count += 1
        for way in (1, -1):
            for steer in (-1.0, -0.5, 0.0, 0.5, 1.0):
                turned = way * ARC_M * steer * bend
                middle = yaw + turned / 2
                x2, y2, yaw2 = x + way * ARC_M * np.cos(middle), y + way * ARC_M * np.sin(middle), yaw + turned
                back2 = back + (ARC_M if way < 0 else 0.0)
                if back2 > most_back_m or not _fits(free, cell_m, low_m, body, x2, y2, yaw2):
                    continue
                i, j = int((x2 - low_m[0]) / CELL_M), int((y2 - low_m[1]) / CELL_M)
                k = int(np.floor(yaw2 / (2 * np.pi) * HEADINGS + 0.5)) % HEADINGS
                if not done[i, j, k]:
                    poses.append((x2, y2, yaw2, back2))
                    more = ARC_M * (BACKWARDS if way < 0 else 1.0) + (GEAR if way != gear else 0.0)
                    heapq.heappush(heap, (cost + more, len(poses) - 1, way))
    return out[:count]
