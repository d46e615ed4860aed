"""Made-up objects of maps: annotated boxes with noise, misses and false ones, as a network would predict them."""

from __future__ import annotations

from typing import Any

import numpy as np

from appocc.boxes import Boxes
from appocc.checks import FloatArray
from appocc.objects import KINDS, BEVObjects

# Kinds of annotated categories; the others are not predicted.
_KINDS = {
    "vehicle.car": "car",
    "vehicle.truck": "truck",
    "vehicle.bus.rigid": "bus",
    "vehicle.bus.bendy": "bus",
    "vehicle.motorcycle": "motorcycle",
    "vehicle.bicycle": "bicycle",
}
SIZE_WLH_M = {
    "car": (1.8, 4.5, 1.6),
    "truck": (2.4, 7.5, 2.8),
    "bus": (2.6, 11.0, 3.2),
    "motorcycle": (0.8, 2.2, 1.5),
    "bicycle": (0.6, 1.8, 1.7),
    "pedestrian": (0.6, 0.6, 1.7),
}


def made_object(kind: str, x_m: float, y_m: float, **changes: Any) -> BEVObjects:
    """One object of the usual size of its kind, ahead by default, grey and at rest."""
    values = {
        "centre_m": [x_m, y_m, SIZE_WLH_M[kind][2] / 2],
        "size_wlh_m": SIZE_WLH_M[kind],
        "yaw_rad": 0.0,
        "velocity_mps": (0.0, 0.0),
        "rgb": (128.0, 128.0, 128.0),
        "score": 0.9,
        **changes,
    }
    return BEVObjects(**{name: np.array([value], np.float64) for name, value in values.items()}, kind=(kind,))


def together(*parts: BEVObjects) -> BEVObjects:
    """Objects of several tables in one."""
    names = ("centre_m", "size_wlh_m", "yaw_rad", "velocity_mps", "rgb", "score")
    kind = tuple(name for part in parts for name in part.kind)
    return BEVObjects(**{n: np.concatenate([getattr(part, n) for part in parts]) for n in names}, kind=kind)


def kind_of(category: str) -> str | None:
    """The kind of an annotated category; None if no network predicts it."""
    if category.startswith("human.pedestrian") or category == "pedestrian":
        return "pedestrian"
    return category if category in KINDS else _KINDS.get(category)


def objects_of_boxes(boxes_ego: Boxes, rgb: FloatArray | None = None) -> BEVObjects:
    """Annotated boxes in the ego frame as perfect predictions, with paint (N, 3) where it is given."""
    kinds = [kind_of(category) for category in boxes_ego.category]
    keep = np.array([kind is not None for kind in kinds], np.bool_)
    paint = np.full((len(boxes_ego), 3), np.nan) if rgb is None else rgb
    return BEVObjects(
        centre_m=boxes_ego.centre_m[keep],
        size_wlh_m=boxes_ego.size_wlh_m[keep],
        yaw_rad=boxes_ego.yaw_rad[keep],
        velocity_mps=boxes_ego.velocity_mps[keep],
        kind=tuple(kind for kind in kinds if kind is not None),
        rgb=paint[keep],
        score=np.full(int(keep.sum()), 0.9),
    )


def noisy(objects: BEVObjects, random: np.random.Generator, share: float = 0.2, noise: float = 1.0) -> BEVObjects:
    """Objects with noise; a share of them missed, and as many false ones with lower scores."""
    kept = objects.select(random.random(len(objects)) >= share)
    false = objects.select(random.random(len(objects)) < share)
    both = together(kept, false)
    n, false_ones = len(both), np.arange(len(both)) >= len(kept)
    shift = random.normal(0, 0.3 * noise, (n, 3)) * [1, 1, 0.3] + false_ones[:, None] * random.normal(0, 8, (n, 3))
    score = np.where(false_ones, random.uniform(0.05, 0.6, n), random.uniform(0.3, 1.0, n))
    return BEVObjects(
        centre_m=both.centre_m + shift,
        size_wlh_m=both.size_wlh_m * np.exp(random.normal(0, 0.1 * noise, (n, 3))),
        yaw_rad=both.yaw_rad + random.normal(0, 0.2 * noise, n),
        velocity_mps=both.velocity_mps + random.normal(0, 0.5 * noise, (n, 2)),
        kind=both.kind,
        rgb=np.clip(both.rgb + random.normal(0, 12 * noise, (n, 3)), 0, 255),
        score=score,
    )
