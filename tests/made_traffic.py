"""Hand-made traffic."""

from __future__ import annotations

import numpy as np

from appocc.simulation.traffic import Actor, TrafficLog


def straight_traffic() -> TrafficLog:
    """A car that always drives, one that is stationary half of the time, a parked one, a pedestrian."""
    steps = np.arange(101)
    xy = np.zeros((101, 4, 2), np.float32)
    xy[:, 0, 0] = steps
    xy[:, 1, 0] = np.minimum(steps, 50)
    xy[:, 3, 1] = steps * 0.3
    actors = tuple(
        Actor(name, kind, body, (4.5, 1.8, 1.5))
        for name, kind, body in (
            ("a", "car", "sedan"),
            ("b", "car", "suv"),
            ("c", "car", "sedan"),
            ("d", "pedestrian", "adult"),
        )
    )
    none = np.zeros((101, 0), np.uint8)
    return TrafficLog(
        step_s=0.2,
        actors=actors,
        xy_m=xy,
        yaw_rad=np.zeros((101, 4), np.float32),
        lights=np.zeros((101, 4), np.uint8),
        signal_links=(),
        signals=none,
    )
