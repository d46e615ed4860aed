"""Made-up objects of a street: as annotated boxes, and as the rows that training reads."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch import Tensor

from appocc.boxes import Boxes
from appocc.geometry import quaternion_from_yaw, rotation_from_quaternion
from appocc.objects import KINDS
from appocc.training.batches.packed_objects import COLUMNS, KIND, RGB, VELOCITY, WLH, XY, YAW, Z

SIZE_WLH_M = (2.0, 4.4, 1.6)


def boxes_of(*objects: tuple[str, float, float], **changes: Any) -> Boxes:
    """Boxes of (category, x, y) at rest and straight ahead; changes are arrays of all of them."""
    n = len(objects)
    yaw_rad = np.broadcast_to(changes.pop("yaw_rad", 0.0), n)
    names = tuple(str(i) for i in range(n))
    values = {
        "centre_m": np.array([[x, y, 0.8] for _, x, y in objects]).reshape(n, 3),
        "size_wlh_m": np.tile(SIZE_WLH_M, (n, 1)),
        "rotation": rotation_from_quaternion(np.array([quaternion_from_yaw(float(yaw)) for yaw in yaw_rad])),
        "velocity_mps": np.zeros((n, 2)),
        "lidar_points": np.zeros(n, np.int64),
        **changes,
    }
    return Boxes(**values, category=tuple(name for name, _, _ in objects), instance=names, token=names)


def row(kind: str, x_m: float, y_m: float, **changes: Any) -> list[float]:
    """One object as a row: at rest, straight ahead and of no known paint by default."""
    values: dict[str, Any] = {"z": 0.8, "wlh": SIZE_WLH_M, "yaw": 0.0, "velocity": (0.0, 0.0), "rgb": [np.nan] * 3}
    values |= changes
    found = np.full(COLUMNS, np.nan)
    found[KIND], found[XY], found[Z], found[WLH] = KINDS.index(kind), (x_m, y_m), values["z"], values["wlh"]
    found[YAW], found[VELOCITY], found[RGB] = values["yaw"], values["velocity"], values["rgb"]
    return [float(value) for value in found]


def batch_of(*samples: list[list[float]]) -> Tensor:
    """Rows of some samples (B, K, 13), filled up with rows of NaN."""
    most = max(1, *map(len, samples))
    objects = torch.full((len(samples), most, COLUMNS), torch.nan)
    for objects_of_sample, rows in zip(objects, samples, strict=True):
        objects_of_sample[: len(rows)] = torch.tensor(rows).reshape(-1, COLUMNS)
    return objects
