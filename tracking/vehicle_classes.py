"""Vehicle classes by size, and the usual height of each class: a bird's-eye view shows neither."""

from __future__ import annotations

# Heights of vehicles whose height is unknown.
HEIGHT_M = {"motorcycle": 1.5, "car": 1.6, "truck": 2.8, "bus": 3.2}


def class_from_size(length_m: float, width_m: float) -> str:
    """Return the nuScenes tracking class: bus from 9.5 m, truck from 6.2 m, motorcycle if small, otherwise car."""
    if length_m >= 9.5:
        return "bus"
    if length_m >= 6.2:
        return "truck"
    return "motorcycle" if length_m < 2.8 and width_m < 1.2 else "car"
