"""How well things fit a noun: by their class where it is known, and by their size."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from appocc.checks import FloatArray
from grounding.referent.fuzzy import falls, half_open, rises
from grounding.referent.object_table import Crowd

VEHICLES = frozenset(
    ("car", "van", "truck", "bus", "trailer", "motorcycle", "bicycle", "construction_vehicle", "vehicle")
)
PEOPLE = frozenset(("person", "people", "pedestrian", "man", "woman", "child"))
# All others are no things that a scene could hold.
KNOWN = VEHICLES | PEOPLE
# How well a class fits a noun; sizes add to it (vans are cars or trucks in nuScenes, pickups are trucks).
_CLASS_FIT: Mapping[str, Mapping[str, float]] = {
    "car": {"car": 1.0, "police": 0.9, "ambulance": 0.3, "truck": 0.1},
    "van": {"ambulance": 0.9, "police": 0.1, "bus": 0.1},
    "truck": {"truck": 1.0, "construction vehicle": 0.4, "trailer": 0.4, "ambulance": 0.2},
    "bus": {"bus": 1.0},
    "trailer": {"trailer": 1.0, "truck": 0.2},
    "motorcycle": {"motorcycle": 1.0, "bicycle": 0.1},
    "bicycle": {"bicycle": 1.0, "motorcycle": 0.1},
    "construction_vehicle": {"construction vehicle": 1.0, "truck": 0.1},
    "person": {"person": 1.0},
}
# For vehicles of which only the shape is known: how frequent kinds are, and their lengths (mean, spread), metres.
# Trucks are pickups and large ones.
_SHAPES: tuple[tuple[str, float, float, float], ...] = (
    ("car", 0.74, 4.5, 0.4),
    ("van", 0.09, 5.35, 0.3),
    ("truck", 0.08, 5.4, 0.25),
    ("truck", 0.03, 7.5, 1.5),
    ("bus", 0.03, 11.0, 1.3),
    ("trailer", 0.005, 10.0, 3.0),
    ("motorcycle", 0.03, 2.05, 0.2),
    ("bicycle", 0.01, 1.75, 0.15),
    ("construction_vehicle", 0.005, 7.0, 2.0),
)
# A kind that is rare among vehicles of a length is less unlikely where somebody names it.
_NAMED = 0.7
# Parked cars run together on a predicted map, and far ones are cut: a car may have nearly any length.
_CAR_OF_ANY_LENGTH = 0.3
# A car of another body than the one that is named.
_NOT_QUITE = 0.15
# Heads of car and truck that say more than their noun.
_OFF_ROAD = ("suv", "jeep", "4x4", "four by four", "crossover")
_LOW = ("sedan", "saloon", "coupe", "convertible", "sports car", "hatchback", "estate", "estate car", "station wagon")
_SHORT = ("hatchback", "compact", "compact car")
_PICKUP = ("pickup", "pick-up", "pick up")
_HEAVY = ("lorry", "semi", "big rig", "box truck", "semi truck", "18 wheeler", "dump truck", "garbage truck", "hgv")


def of_noun(noun: str, head: str, crowd: Crowd) -> FloatArray:
    """(N,) how well things are what a noun says; `head` is the word that was used for it."""
    if noun in PEOPLE:
        return np.array([_CLASS_FIT["person"].get(kind, 0.0) for kind in crowd.kind])
    if noun not in VEHICLES:
        return np.zeros(len(crowd))
    if noun == "vehicle":
        return np.array([{"person": 0.0, "bicycle": 0.2}.get(kind, 1.0) for kind in crowd.kind])
    fit = np.array([_CLASS_FIT[noun].get(kind, 0.0) for kind in crowd.kind])
    if head == "bike":
        fit = np.maximum(fit, [float(kind == "bicycle") for kind in crowd.kind])
    fit = _with_size(noun, head, fit, crowd)
    shape_only = np.array([kind == "vehicle" for kind in crowd.kind], np.bool_)
    return np.where(shape_only, _by_length(noun, crowd), fit)


def _with_size(noun: str, head: str, fit: FloatArray, crowd: Crowd) -> FloatArray:
    """What the size of cars and trucks adds to their class."""
    length, height = crowd.size_m[:, 0], crowd.size_m[:, 2]
    car, truck = (np.array([one == kind for one in crowd.kind], np.bool_) for kind in ("car", "truck"))
    # Minivans are as high as the highest off-road cars, and vans by name.
    mini = rises(height, 1.71, 0.015)
    tall = half_open(mini if "mini" in head else 0.45 * mini + 0.55 * rises(height, 1.9, 0.06))
    if noun == "van":
        # Pickups are high too; what is a truck to annotators and yet a van is higher.
        tall = np.where(truck, half_open(rises(height, 2.1, 0.06)), tall)
        return np.where(car | truck, 0.9 * tall * falls(length, 7.0, 0.3), fit)
    if noun == "truck":
        # Some say truck for a van.
        fit = np.where(car, 0.2 * np.where(np.isnan(height), 0, tall), fit)
        if head.startswith(_PICKUP):
            return np.where(truck, falls(length, 6.3, 0.2) * half_open(falls(height, 2.3, 0.1)), 0.3 * fit)
        return np.where(truck, 0.1 + 0.9 * rises(length, 5.9, 0.1), fit) if head in _HEAVY else fit
    if noun == "car":
        fit = np.where(car, fit * (1 - 0.6 * np.where(np.isnan(height), 0, rises(height, 2.0, 0.05))), fit)
        if head in _OFF_ROAD:
            high = half_open(rises(height, 1.58, 0.02) * falls(height, 1.95, 0.05))
            return np.where(car, _NOT_QUITE + (1 - _NOT_QUITE) * high, 0)
        if head in _LOW:
            low = half_open(falls(height, 1.6, 0.03))
            fit = np.where(car, fit * (_NOT_QUITE + (1 - _NOT_QUITE) * low), 0)
        if head in _SHORT:
            fit = fit * (_NOT_QUITE + (1 - _NOT_QUITE) * falls(length, 4.45, 0.06))
    return fit


def _by_length(noun: str, crowd: Crowd) -> FloatArray:
    """Probability of a kind given the length of a shape, raised because somebody named it."""
    _, frequency, mean, spread = (np.array(each) for each in zip(*_SHAPES, strict=True))
    spread = np.hypot(spread, crowd.size_doubt_m)
    likely = frequency / spread * np.exp(-0.5 * ((crowd.size_m[:, :1] - mean) / spread) ** 2) + 1e-12
    own = likely[:, [kind == noun for kind, *_ in _SHAPES]].sum(axis=1)
    fit = (own / likely.sum(axis=1)) ** _NAMED
    return np.asarray(np.maximum(fit, _CAR_OF_ANY_LENGTH) if noun == "car" else fit)
