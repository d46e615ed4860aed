"""Pedestrians, and the body parts of riders."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from appocc.simulation.actors.materials import JACKET, TRIM, Colour, Finish, cloth, skin
from appocc.simulation.actors.modelling import Modeller, Size

SKINS = (skin(206, 160, 132), skin(146, 100, 76), skin(94, 62, 46))
_TROUSERS = (cloth(42, 52, 78), cloth(34, 34, 37), cloth(140, 122, 96))
_SHOES = (cloth(30, 28, 27), cloth(196, 194, 188), cloth(84, 56, 38))
_HAIR = (cloth(92, 66, 42), cloth(24, 20, 18), cloth(34, 26, 22))
_BAG: Colour = (70, 76, 62)
_SIDES = (7, 5, 3)
# How far each leg is ahead in the four phases of a step; the arms swing the other way.
_SWING = (1.0, 0.25, -1.0, -0.25)


def add_limb(
    model: Modeller,
    points_m: ArrayLike,
    radii_m: ArrayLike,
    finish: Finish,
    sides: int,
    flat: tuple[float, float] = (1.0, 1.0),
    closed: bool = True,
) -> None:
    """Add a limb of horizontal rings around points (N, 3), scaled by `flat` along x and y."""
    points = np.asarray(points_m, np.float64)
    turn = np.arange(sides + 1) * (2 * np.pi / sides)
    # A circle of few corners is slightly larger, so that limbs look alike at all levels of detail.
    grown = ((7 * np.sin(2 * np.pi / 7)) / (sides * np.sin(2 * np.pi / sides))) ** 0.25
    circle = grown * np.stack([flat[0] * np.cos(turn), flat[1] * np.sin(turn), np.zeros(sides + 1)], axis=1)
    rings = points[:, None] + np.asarray(radii_m)[:, None, None] * circle
    middle = points.mean(axis=0)
    model.add_sheet(rings, finish, middle, mirror=False)
    if closed:
        for ring in (rings[0, :-1], rings[-1, :-1]):
            model.add_fan(ring, finish, middle, None, mirror=False)


def model_pedestrian(child: bool, variant: int, detail: int, pose: int) -> Modeller:
    """Model a pedestrian in one phase of a step; the jacket takes the actor's paint."""
    size: Size = (0.50, 0.42, 1.20) if child else (0.75, 0.60, 1.75)
    model = Modeller(size)
    h, sides, swing = size[2], _SIDES[detail], _SWING[pose]
    head = 0.165 if child else 0.13
    shoulder_z, hip_z = h * (1 - head - 0.045), h * 0.50
    wide = h * 0.105
    for side, ahead in ((1.0, swing), (-1.0, -swing)):
        _leg(model, h, hip_z, side, ahead, variant=variant, detail=detail)
        _arm(model, (wide * 1.25, shoulder_z, size), side, -ahead, SKINS[variant], detail)
    torso = [(0.0, 0.0, hip_z - 0.035 * h), (0.0, 0.0, 0.60 * h), (0.01, 0.0, shoulder_z - 0.05 * h)]
    torso.append((0.0, 0.0, shoulder_z + 0.012 * h))
    add_limb(model, torso, [wide * k for k in (1.08, 0.92, 1.10, 0.50)], JACKET, max(sides, 4), (0.72, 1.0))
    _head(model, h, head, variant, detail)
    if variant == 1 and detail < 2:
        back = [-0.19 * h, -0.075 * h, 0.55 * h], [-0.065 * h, 0.075 * h, shoulder_z - 0.01 * h]
        model.add_box(*back, cloth(*_BAG), skip="")
    return model


def _leg(model: Modeller, h: float, hip_z: float, side: float, ahead: float, variant: int, detail: int) -> None:
    y, step = side * 0.049 * h, 0.155 * h * ahead
    lift = 0.03 * h if ahead < 0 else 0.0  # the heel of the rear foot
    hip, knee = (0.0, y, hip_z), (0.55 * step + 0.02 * h, y, 0.27 * h)
    ankle = (step, y, 0.05 * h + lift)
    radii = (0.046 * h, 0.041 * h, 0.03 * h)
    sides = _SIDES[detail]
    if detail == 2:
        add_limb(model, [hip, ankle], radii[::2], _TROUSERS[variant], sides, closed=False)
    else:
        add_limb(model, [hip, knee, ankle], radii, _TROUSERS[variant], sides - 1, closed=False)
    foot = [step - 0.045 * h, y - 0.028 * h, 0.6 * lift], [step + 0.105 * h, y + 0.028 * h, 0.055 * h + lift]
    model.add_box(*foot, _SHOES[variant], skip=("", "b", "bfr")[detail])


def _arm(
    model: Modeller, frame: tuple[float, float, Size], side: float, ahead: float, hand: Finish, detail: int
) -> None:
    y, shoulder_z, (_, width, h) = frame
    swing = 0.13 * h * ahead
    outer = width / 2 - 0.026 * h
    shoulder = (0.0, side * y * 0.84, shoulder_z - 0.022 * h)
    elbow = (0.35 * swing - 0.015 * h, side * (y + outer) / 2, 0.62 * h)
    wrist = (swing + 0.02 * h, side * outer, 0.49 * h + 0.03 * h * abs(ahead))
    sides = max(_SIDES[detail] - 2, 3)
    if detail == 2:
        add_limb(model, [shoulder, wrist], [0.036 * h, 0.026 * h], JACKET, 3, closed=False)
        return
    add_limb(model, [shoulder, elbow, wrist], [0.031 * h, 0.031 * h, 0.024 * h], JACKET, sides, closed=detail == 0)
    if detail:
        return
    end = (wrist[0] + 0.015 * h, wrist[1], wrist[2] - 0.055 * h)
    add_limb(model, [wrist, end], [0.024 * h, 0.018 * h], hand, sides)


def _head(model: Modeller, h: float, head: float, variant: int, detail: int) -> None:
    low, high = h * (1 - head - 0.02), h
    z = low + (high - low) * np.array([-0.15, 0.22, 0.55, 0.85, 1.0])
    radii = (high - low) * np.array([0.27, 0.34, 0.40, 0.33, 0.10])
    x = 0.012 * h
    finish = SKINS[variant]
    if detail == 2:
        add_limb(model, [(x, 0.0, z[0]), (x, 0.0, h)], [radii[1], radii[3]], finish, 4)
        return
    points = np.stack([np.full(5, x), np.zeros(5), z], axis=1)
    sides = _SIDES[detail]
    add_limb(model, points[:3], radii[:3], finish, sides, (1.08, 0.9))
    add_limb(model, points[2:] - [0.008 * h, 0.0, 0.0], radii[2:] * 1.05, _HAIR[variant], sides, (1.08, 0.92))


def add_helmet(model: Modeller, centre_m: ArrayLike, radius_m: float, finish: Finish, sides: int, full: bool) -> None:
    """Add a helmet; a full-face helmet has a visor."""
    centre = np.asarray(centre_m, np.float64)
    heights, radii = np.array([-0.95, -0.4, 0.3, 0.8, 1.0]), np.array([0.62, 0.95, 1.0, 0.66, 0.15])
    if not full:
        heights, radii = heights[2:] - 0.1, radii[2:]
    elif sides < 5:
        heights, radii = heights[[0, 2, 3]], radii[[0, 2, 3]]
    points = centre + radius_m * heights[:, None] * [0.0, 0.0, 1.0]
    add_limb(model, points, radius_m * radii, finish, sides, (1.12, 0.92))
    if full and sides > 4:
        x = centre[0] + 1.13 * radius_m
        across = ((-0.1, 0.42), (0.0, 0.0), (0.1, 0.42))
        pane = [[[x - back * radius_m, centre[1] + y, centre[2] + z] for z in (-0.05, 0.05)] for y, back in across]
        model.add_sheet(pane, TRIM, centre, mirror=False)
