"""Speed limits in curves; SUMO slows down for junctions only."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d

from appocc.checks import FloatArray
from appocc.simulation.network import Lane, RoadNetwork

CELL_M = 2.0
_ACROSS_MPS2, _BRAKING_MPS2 = 2.4, 1.8
_SLOWEST_MPS = 2.5
_SMOOTH_CELLS = 1.2


def curve_speeds(network: RoadNetwork) -> dict[str, FloatArray]:
    """Return, for lanes with slow curves, the speed every two metres, including braking distances."""
    found = {}
    for name, lane in network.lanes.items():
        if lane.kind == "driving" and len(lane.centre_m) > 2:
            speeds = _speeds(lane)
            if speeds.min() < lane.speed_mps:
                found[name] = speeds
    return found


def _speeds(lane: Lane) -> FloatArray:
    step = np.hypot(*np.diff(lane.centre_m, axis=0).T)
    keep = np.concatenate([[True], step > 1e-6])
    along = np.concatenate([[0.0], np.cumsum(step)])[keep]
    count = max(int(along[-1] / CELL_M), 1) + 1
    at = np.linspace(0, along[-1], count)
    line = np.stack([np.interp(at, along, lane.centre_m[keep, axis]) for axis in (0, 1)], axis=1)
    course = np.unwrap(np.arctan2(*np.diff(line, axis=0).T[::-1]))
    bend = np.zeros(count)
    bend[1:-1] = np.abs(np.diff(course)) / max(along[-1] / (count - 1), 0.1)
    bend = gaussian_filter1d(bend, _SMOOTH_CELLS, mode="nearest")
    speeds = np.maximum(np.sqrt(_ACROSS_MPS2 / np.maximum(bend, 1e-4)), _SLOWEST_MPS)
    for k in range(count - 2, -1, -1):
        speeds[k] = min(speeds[k], np.sqrt(speeds[k + 1] ** 2 + 2 * _BRAKING_MPS2 * CELL_M))
    return np.asarray(speeds)
