"""Membership of objects in the class that a noun names: by their own class where it is known, and by their size."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from appocc.checks import FloatArray
from grounding.referent.fuzzy import falling, fill_unknown, rising
from grounding.referent.object_table import ObjectTable
from grounding.vocabulary import PERSON_NOUNS, VEHICLE_NOUNS

# Membership of a class in a noun, before size (in nuScenes vans are cars or trucks, and pickups are trucks).
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


class _Body(NamedTuple):
    """A body style: its frequency among vehicles, and the mean and standard deviation of its size in metres."""

    noun: str
    style: str
    frequency: float
    length_m: tuple[float, float]
    height_m: tuple[float, float]


# Body styles, for vehicles of unknown class.
_BODIES = (
    _Body("car", "low", 0.54, (4.45, 0.4), (1.47, 0.06)),
    _Body("car", "suv", 0.20, (4.6, 0.3), (1.68, 0.07)),
    _Body("van", "minivan", 0.03, (4.9, 0.25), (1.79, 0.06)),
    _Body("van", "panel van", 0.06, (5.4, 0.4), (2.2, 0.25)),
    _Body("truck", "pickup", 0.08, (5.4, 0.25), (1.86, 0.08)),
    _Body("truck", "heavy", 0.03, (7.5, 1.5), (3.2, 0.5)),
    _Body("bus", "", 0.03, (11.0, 1.3), (3.1, 0.3)),
    _Body("trailer", "", 0.005, (10.0, 3.0), (3.5, 0.5)),
    _Body("motorcycle", "", 0.03, (2.05, 0.2), (1.3, 0.25)),
    _Body("bicycle", "", 0.01, (1.75, 0.15), (1.4, 0.3)),
    _Body("construction_vehicle", "", 0.005, (7.0, 2.0), (3.0, 0.6)),
)
# Standard deviation of predicted heights.
_HEIGHT_STD_M = 0.12
# Exponent below 1: a class that is named is less improbable than its frequency.
_NAMED_EXPONENT = 0.7
# On predicted maps parked cars merge and distant cars are truncated, so any length may be a car.
_LEAST_CAR_FIT = 0.3
# Least fit of a car or a truck with another body style than the one named.
_OTHER_BODY_FIT = 0.15
# Head words that name a second class: a "wagon" is an estate car, or a lorry.
_SECOND_CLASSES = {"bike": "bicycle", "wagon": "truck", "wagons": "truck"}
# Head words of kinds that a map may hold as classes of their own: that class, and the noun of their lookalikes.
_OWN_CLASSES = {
    **dict.fromkeys(("ambulance", "ambulances"), ("ambulance", "van")),
    **dict.fromkeys(("police car", "police cars", "cop car", "patrol car", "squad car"), ("police", "car")),
    **dict.fromkeys(("tram", "trams", "streetcar", "streetcars", "trolley car"), ("tram", "bus")),
}
# Fit of lookalikes.
_LOOKALIKE_FIT = 0.2
# Head words that are more specific than "car" and "truck".
_SUVS = ("suv", "jeep", "4x4", "four by four", "crossover")
_LOW_BODIES = (
    *("sedan", "saloon", "coupe", "convertible", "sports car", "hatchback"),
    *("estate", "estate car", "station wagon"),
)
_SHORT_BODIES = ("hatchback", "compact", "compact car")
_PICKUPS = ("pickup", "pick-up", "pick up")
_HEAVY_TRUCKS = (
    *("lorry", "semi", "big rig", "box truck", "semi truck", "18 wheeler"),
    *("dump truck", "garbage truck", "hgv"),
)


def fit_noun(noun: str, head: str, table: ObjectTable) -> FloatArray:
    """Return the membership (N,) of objects in a noun.

    Args:
        noun: noun of a query.
        head: word used for it in the command, which may name a body style.
        table: objects.
    """
    if noun in PERSON_NOUNS:
        return np.array([_CLASS_FIT["person"].get(name, 0.0) for name in table.class_names])
    if noun not in VEHICLE_NOUNS:
        return np.zeros(len(table))
    if head in _OWN_CLASSES:
        own, alike = _OWN_CLASSES[head]
        like = fit_noun(alike, alike, table)
        fit = np.array([{own: 1.0, "vehicle": 2.0}.get(name, 0.0) for name in table.class_names])
        return np.where(fit > 1, like, np.maximum(fit, _LOOKALIKE_FIT * like))
    if noun == "vehicle":
        return np.array([{"person": 0.0, "bicycle": 0.2}.get(name, 1.0) for name in table.class_names])
    fit = np.array([_CLASS_FIT[noun].get(name, 0.0) for name in table.class_names])
    if second := _SECOND_CLASSES.get(head):
        fit = np.maximum(fit, [float(name == second) for name in table.class_names])
    fit = _adjust_by_size(noun, head, fit, table)
    shape_only = np.array([name == "vehicle" for name in table.class_names], np.bool_)
    return np.where(shape_only, _fit_size(noun, head, table), fit)


def _adjust_by_size(noun: str, head: str, fit: FloatArray, table: ObjectTable) -> FloatArray:
    """Adjust the fit of cars and trucks by their size."""
    length, height = table.size_m[:, 0], table.size_m[:, 2]
    car, truck = (np.array([one == name for one in table.class_names], np.bool_) for name in ("car", "truck"))
    # Minivans are as tall as the tallest SUVs, and count as vans.
    mini = rising(height, 1.685, 0.02)
    tall = fill_unknown(mini if "mini" in head else 0.45 * mini + 0.55 * rising(height, 1.9, 0.06))
    if noun == "van":
        # Pickups are tall too; vans that are annotated as trucks are taller.
        tall = np.where(truck, fill_unknown(rising(height, 2.1, 0.06)), tall)
        return np.where(car | truck, 0.9 * tall * falling(length, 7.0, 0.3), fit)
    if noun == "truck":
        # "Truck" may mean a van.
        fit = np.where(car, 0.2 * np.where(np.isnan(height), 0, tall), fit)
        if head.startswith(_PICKUPS):
            return np.where(truck, falling(length, 6.3, 0.2) * fill_unknown(falling(height, 2.3, 0.1)), 0.3 * fit)
        heavy = _OTHER_BODY_FIT + (1 - _OTHER_BODY_FIT) * rising(length, 5.9, 0.1)
        return np.where(truck, heavy, fit) if head in _HEAVY_TRUCKS else fit
    if noun == "car":
        fit = np.where(car, fit * (1 - 0.6 * np.where(np.isnan(height), 0, rising(height, 2.0, 0.05))), fit)
        if head in _SUVS:
            high = fill_unknown(rising(height, 1.58, 0.02) * falling(height, 1.95, 0.05))
            return np.where(car, _OTHER_BODY_FIT + (1 - _OTHER_BODY_FIT) * high, 0)
        if head in _LOW_BODIES:
            low = fill_unknown(falling(height, 1.6, 0.03))
            fit = np.where(car, fit * (_OTHER_BODY_FIT + (1 - _OTHER_BODY_FIT) * low), 0)
        if head in _SHORT_BODIES:
            fit = fit * (_OTHER_BODY_FIT + (1 - _OTHER_BODY_FIT) * falling(length, 4.45, 0.06))
    return fit


def _fit_size(noun: str, head: str, table: ObjectTable) -> FloatArray:
    """Return the probability (N,) of a class given length and, where known, height, tempered by `_NAMED_EXPONENT`."""
    length_m = np.array([body.length_m for body in _BODIES])
    height_m = np.array([body.height_m for body in _BODIES])
    likelihood = np.array([body.frequency for body in _BODIES]) * (
        _density(table.size_m[:, :1], length_m, table.length_std_m)
        * np.nan_to_num(_density(table.size_m[:, 2:], height_m, _HEIGHT_STD_M), nan=1.0)
    )
    style = _style_of(head)
    share = [(body.noun == noun) * (1 if style in ("", body.style) else _OTHER_BODY_FIT) for body in _BODIES]
    fit = (likelihood @ share / (likelihood.sum(axis=1) + 1e-12)) ** _NAMED_EXPONENT
    return np.asarray(np.maximum(fit, _LEAST_CAR_FIT) if noun == "car" else fit)


def _density(value: FloatArray, normal: FloatArray, noise: float) -> FloatArray:
    """Return the densities (N, B) of values (N, 1) with noise, of normal distributions (B, 2)."""
    std = np.hypot(normal[:, 1], noise)
    return np.asarray(np.exp(-0.5 * ((value - normal[:, 0]) / std) ** 2) / std)


def _style_of(head: str) -> str:
    """Return the body style that a head word names, '' for any."""
    if head in _SUVS:
        return "suv"
    if head in _LOW_BODIES or head in _SHORT_BODIES:
        return "low"
    if head.startswith(_PICKUPS):
        return "pickup"
    if head in _HEAVY_TRUCKS:
        return "heavy"
    return "minivan" if "mini" in head else ""
