"""Soft predicates: how well a vehicle fits one thing that is said of it, 0..1; what is unknown stays half open."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from appocc.colours import fit
from grounding.query import Referent
from grounding.scene import Scene, SceneObject
from tracking.formats import HEIGHT_M

# How well a class fits a noun; sizes add to it (vans are cars or trucks in nuScenes, pickups are trucks).
_CLASS_FIT: Mapping[str, Mapping[str, float]] = {
    "car": {"car": 1.0, "police": 0.9, "ambulance": 0.3, "truck": 0.1},
    "van": {"ambulance": 0.9, "police": 0.1},
    "truck": {"truck": 1.0, "construction vehicle": 0.4, "trailer": 0.4},
    "bus": {"bus": 1.0},
    "trailer": {"trailer": 1.0, "truck": 0.2},
    "motorcycle": {"motorcycle": 1.0},
    "construction_vehicle": {"construction vehicle": 1.0, "truck": 0.1},
}
# Length of a class in metres (mean, spread), for vehicles of which only the shape is known.
_LENGTH: Mapping[str, tuple[float, float]] = {
    "car": (4.6, 0.7),
    "van": (5.4, 0.7),
    "truck": (7.5, 2.0),
    "bus": (11.5, 2.0),
    "trailer": (10.0, 3.0),
    "motorcycle": (2.1, 0.4),
    "construction_vehicle": (7.0, 2.0),
}
_UNKNOWN = 0.5
_CAR_OF_ANY_LENGTH = 0.3


def _rises(value: float, middle: float, step: float) -> float:
    """0..1, a half at `middle`, almost all of it within three steps."""
    return float(1 / (1 + np.exp(-np.clip((value - middle) / step, -50, 50))))


def of_class(referent: Referent, item: SceneObject) -> float:
    """Whether a vehicle is what the noun says."""
    if referent.noun == "vehicle":
        return 1.0
    if not item.category:
        mean, spread = _LENGTH[referent.noun]
        likely = float(np.exp(-0.5 * ((item.length_m - mean) / spread) ** 2))
        # Parked cars run together on a predicted map, and far ones are cut: a car may have nearly any length.
        return max(likely, _CAR_OF_ANY_LENGTH) if referent.noun == "car" else likely
    base = _CLASS_FIT[referent.noun].get(item.noun, 0.0)
    if referent.noun == "van" and item.noun in ("car", "truck"):
        tall = _rises(item.height_m or HEIGHT_M["car"], 1.9, 0.06)
        base = 0.9 * tall * _rises(-item.length_m, -7.0, 0.3)
    if referent.head.startswith(("pickup", "pick")) and item.noun == "truck":
        base = _rises(-item.length_m, -6.6, 0.2)
    if referent.head in ("suv", "jeep", "4x4") and item.noun == "car":
        height = item.height_m or HEIGHT_M["car"]
        base = 0.3 + 0.7 * _rises(height, 1.6, 0.05) * _rises(-height, -2.05, 0.05)
    return base


def of_colour(colour: str, item: SceneObject, scene: Scene) -> float:
    """Whether a vehicle has a colour; one whose colour the map does not know has none."""
    return 0.0 if item.rgb is None else float(fit(colour, item.rgb, scene.exposure))


def _ahead(item: SceneObject) -> float:
    x, y = item.centre_m
    return _rises(x, 2.5, 0.6) * _rises(x - abs(y), 0.0, 1.5)


def _behind(item: SceneObject) -> float:
    x, y = item.centre_m
    return _rises(-x, 1.0, 0.6) * _rises(-x - abs(y), -1.0, 1.5)


def _standing(item: SceneObject) -> float:
    return _UNKNOWN if item.speed_mps is None else _rises(-item.speed_mps, -0.6, 0.12)


def _oncoming(item: SceneObject) -> float:
    facing = _rises(abs(item.yaw_rad), 2.3, 0.12) if item.front_known else _UNKNOWN
    return facing * (1 - _standing(item))


_QUALIFIERS: Mapping[str, Callable[[SceneObject], float]] = {
    "left_side": lambda item: _rises(item.centre_m[1], 1.0, 0.35),
    "right_side": lambda item: _rises(-item.centre_m[1], 1.0, 0.35),
    "ahead": _ahead,
    "behind_ego": _behind,
    "parked": _standing,
    "stopped": _standing,
    "moving": lambda item: 1 - _standing(item),
    "oncoming": _oncoming,
    "large": lambda item: _rises(item.length_m, 5.4, 0.3),
    "small": lambda item: _rises(-item.length_m, -4.5, 0.2),
}


def fits(referent: Referent, item: SceneObject, scene: Scene) -> dict[str, float]:
    """Every predicate of a referent but its ordinals and superlatives, and how well a vehicle fits it."""
    result = {referent.head: of_class(referent, item)}
    if referent.colour:
        result[referent.colour] = of_colour(referent.colour, item, scene)
    for qualifier in referent.qualifiers:
        if qualifier in _QUALIFIERS:
            result[qualifier.replace("_", " ")] = _QUALIFIERS[qualifier](item)
    return result
