"""A track made by hand."""

from __future__ import annotations

from typing import Any

import numpy as np

from tracking.tracks import Track


def track(number: int = 1, **changes: Any) -> Track:
    """A car, with some attributes changed."""
    values: dict[str, Any] = {
        "position_world_m": np.array([100.0, 50.0, 2.0]),
        "velocity_world_mps": np.array([3.0, 4.0]),
        "yaw_world_rad": np.pi / 2,
        "heading_known": True,
        "length_m": 4.5,
        "width_m": 1.8,
        "rgb": np.array([10.0, 20.04, 30.0]),
        "score": 0.9,
        "seen": True,
    }
    return Track(id=number, **(values | changes))
