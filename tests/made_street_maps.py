"""Maps of the tiny dataset: its parked car on a grey street; the rightmost column of cells is unknown."""

from __future__ import annotations

from typing import Any

import numpy as np
from tiny_dataset import TinyDataset, token

from appocc.bevmap import ROAD, VEHICLE, BEVMap, bev_path
from appocc.grid import BEVGrid

CAR_RGB, STREET_RGB = 240, 90


def write_street_maps(tiny: TinyDataset, source: str = "groundtruth", late_m: float = 0.0) -> TinyDataset:
    """Write maps of a source: the car is 10 m ahead of the ego's start, the ego drives 2.5 m a frame.

    In the last frame the car is `late_m` further ahead than it is. A source other than the true one is predicted.
    """
    grid = BEVGrid.surround()
    for i in range(3):
        offset = np.abs(grid.centres() - [10.0 - 2.5 * i + (late_m if i == 2 else 0.0), 0.0])
        car = (offset[..., 0] < 2.3) & (offset[..., 1] < 0.95)
        occupancy = np.zeros((3, *grid.shape), np.float32)
        occupancy[ROAD], occupancy[VEHICLE][car] = 1, 1
        appearance = np.where(car, CAR_RGB, STREET_RGB).astype(np.uint8)[None].repeat(3, axis=0)
        known = np.ones((3, *grid.shape), np.bool_)
        known[:, :, 0] = False
        meta: dict[str, Any] = {"sources": {"road": "made up"}}
        if source != "groundtruth":
            weights = {"name": "made-up weights", "sha256": "abc"}
            meta = {
                "source": "predicted",
                "thresholds": dict.fromkeys(("road", "vehicle", "lane"), 0.5),
                "weights": weights,
            }
        BEVMap(grid, occupancy, known, appearance, known[0].copy(), meta).save(
            bev_path(tiny.root, source, token("sample", i))
        )
    return tiny
