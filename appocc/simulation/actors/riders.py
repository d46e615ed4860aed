"""Motorcycles and bicycles with their riders."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from appocc.simulation.actors.materials import (
    CHROME,
    DARK_HUB,
    GREY_TRIM,
    HEAD_LAMP,
    INDICATOR,
    PAINT,
    PLATE,
    RUBBER,
    TAIL_LAMP,
    TRIM,
    Finish,
    cloth,
    plain,
)
from appocc.simulation.actors.modelling import Modeller
from appocc.simulation.actors.people import SKINS, add_helmet, add_limb

_JACKETS = (cloth(38, 39, 42), cloth(150, 46, 40), cloth(58, 84, 120))
_TROUSERS = (cloth(40, 48, 70), cloth(30, 30, 33), cloth(122, 108, 88))
_HELMETS = (plain(230, 230, 228), plain(34, 35, 38), plain(178, 40, 36))
# At a distance, spokes, gaps and tyre of a bicycle wheel merge into one grey.
_SPOKES = plain(92, 92, 92)
_SEGMENTS = (11, 8, 6)


def _wheel(model: Modeller, x: float, radius: float, wide: float, hub: Finish | None, detail: int) -> None:
    """Add a wheel in the middle plane; a wheel without a hub has spokes."""
    segments = _SEGMENTS[detail]
    turn = np.arange(segments + 1) * (2 * np.pi / segments)
    ring = np.stack([np.cos(turn), np.zeros(segments + 1), np.sin(turn)], axis=1)
    middle = np.array([x, 0.0, radius])
    left = np.array([x, wide / 2, radius])
    if detail == 2:
        model.add_fan((left + radius * ring)[:-1], RUBBER if hub else _SPOKES, middle, None, mirror=True)
        return
    tread = np.stack([middle + radius * ring - [0.0, wide / 2, 0.0], left + radius * ring], axis=1)
    model.add_sheet(tread, RUBBER, middle, mirror=False)
    inner = left + (0.62 if hub else 0.88) * radius * ring
    model.add_sheet(np.stack([left + radius * ring, inner], axis=1), RUBBER, middle)
    if hub:
        model.add_fan(inner[:-1], hub, middle, None, mirror=True)
    elif detail < 2:
        rim = np.stack([inner, inner * [1.0, -1.0, 1.0]], axis=1)
        model.add_sheet(rim, CHROME, middle, mirror=False, hollow=True)
        for k in range(0, segments // 2, 2):
            hub_side = np.array([x, 0.001, radius])
            a, b = radius * ring[k] * 0.9, np.array([-ring[k][2], 0.0, ring[k][0]]) * 0.008
            spoke = [[hub_side + a + b, hub_side - a + b], [hub_side + a - b, hub_side - a - b]]
            model.add_sheet(spoke, CHROME, middle)


class _Seat(NamedTuple):
    """Pose of a rider: x, z of hip and shoulder, the left hand, and the lateral spread of knees and feet."""

    hip: tuple[float, float]
    shoulder: tuple[float, float]
    hand: tuple[float, float, float]
    spread: tuple[float, float]


def _rider(model: Modeller, seat: _Seat, legs: Sequence[tuple[float, ...]], variant: int, detail: int) -> None:
    """Add legs, torso and arms; `legs` holds x and z of knee and foot, left and right."""
    sides = (6, 4, 3)[detail]
    closed = detail == 0
    (hip_x, hip_z), (shoulder_x, shoulder_z) = seat.hip, seat.shoulder
    hand = np.array(seat.hand)
    for side, (knee_x, knee_z, foot_x, foot_z) in zip((1.0, -1.0), legs, strict=True):
        thigh = [[hip_x, side * 0.10, hip_z], [knee_x, side * seat.spread[0], knee_z]]
        foot = [foot_x, side * seat.spread[1], foot_z]
        if detail:
            model.add_tube([*thigh, foot], (0.09, 0.07, 0.05), _TROUSERS[variant], 3, closed=closed)
        else:
            model.add_tube(thigh, (0.085, 0.065), _TROUSERS[variant], sides)
            model.add_tube([thigh[1], foot], (0.062, 0.042), _TROUSERS[variant], sides)
        if detail == 0:
            low = [foot[0] - 0.08, foot[1] - 0.045, foot[2] - 0.08]
            model.add_box(low, [foot[0] + 0.17, foot[1] + 0.045, foot[2] + 0.01], TRIM)
        shoulder = np.array([shoulder_x, side * 0.19, shoulder_z - 0.03])
        end = hand * [1.0, side, 1.0]
        elbow = (shoulder + end) / 2 + [-0.06, side * 0.05, -0.06]
        if detail:
            model.add_tube(
                [shoulder, elbow, end][::detail], (0.062, 0.055, 0.04)[::detail], _JACKETS[variant], 3, closed=closed
            )
        else:
            model.add_tube([shoulder, elbow], (0.058, 0.05), _JACKETS[variant], sides - 1)
            model.add_tube([elbow, end], (0.05, 0.036), _JACKETS[variant], sides - 1)
    torso = [[hip_x - 0.03, 0.0, hip_z - 0.06], [(hip_x + shoulder_x) / 2 - 0.03, 0.0, (hip_z + shoulder_z) / 2]]
    torso += [[shoulder_x - 0.01, 0.0, shoulder_z - 0.06], [shoulder_x, 0.0, shoulder_z + 0.03]]
    add_limb(model, torso, (0.17, 0.18, 0.21, 0.10), _JACKETS[variant], sides + 1, (0.72, 1.0))


def model_motorcycle(variant: int, detail: int) -> Modeller:
    """Model a motorcycle with its rider; tank, fairing and tail take the actor's paint."""
    model = Modeller((2.15, 0.80, 1.62))
    sides = (6, 5, 3)[detail]
    for x in (0.765, -0.765):
        _wheel(model, x, 0.31, 0.14, (CHROME, DARK_HUB, DARK_HUB)[variant], detail)
    model.add_box([-0.35, -0.15, 0.22], [0.32, 0.15, 0.58], GREY_TRIM, skip="" if detail < 2 else "b")
    model.add_tube([[-0.28, 0.0, 0.76], [0.02, 0.0, 0.86], [0.36, 0.0, 0.80]], (0.13, 0.19, 0.12), PAINT, sides)
    model.add_tube([[-0.88, 0.0, 0.86], [-0.55, 0.0, 0.78], [-0.2, 0.0, 0.72]], (0.06, 0.13, 0.13), PAINT, sides)
    fairing = [[0.36, 0.0, 0.72], [0.52, 0.0, 0.88], [0.48, 0.0, 1.10]]
    add_limb(model, fairing, (0.15, 0.22, 0.10), PAINT, sides, (0.8, 1.0))
    model.add_box([0.60, -0.11, 0.82], [0.70, 0.11, 0.96], HEAD_LAMP, skip="r")
    model.add_box([-0.945, -0.07, 0.80], [-0.85, 0.07, 0.88], TAIL_LAMP, skip="f")
    if detail < 2:
        model.add_tube([[0.46, 0.10, 0.80], [0.765, 0.10, 0.31]], (0.035, 0.03), CHROME, 4, mirror=True)
        model.add_tube([[-0.2, 0.13, 0.35], [-0.9, 0.17, 0.42]], (0.035, 0.055), CHROME, 5)
        model.add_tube([[0.40, 0.0, 1.0], [0.34, 0.39, 1.04]], (0.022, 0.022), TRIM, 4, mirror=True)
    if detail == 0:
        for x, finish in ((-0.95, PLATE), (-0.948, TRIM)):
            plate = [[[x, y, z] for z in (0.58, 0.72)] for y in (-0.1, 0.1)]
            model.add_sheet(plate, finish, mirror=False, hollow=finish is TRIM)
        model.add_box([-0.945, -0.02, 0.6], [-0.8, 0.02, 0.8], TRIM)
        for x in (0.66, -0.91):
            model.add_tube([[x - 0.03, 0.17, 0.83], [x + 0.03, 0.17, 0.83]], (0.03, 0.03), INDICATOR, 3, mirror=True)
            model.add_tube([[0.42, 0.2, 1.06], [0.40, 0.28, 1.16]], (0.012, 0.04), TRIM, 4, mirror=True)
    seat = _Seat((-0.28, 0.92), (-0.02, 1.36), (0.32, 0.36, 1.05), (0.24, 0.25))
    _rider(model, seat, [(0.16, 0.74, -0.12, 0.34)] * 2, variant, detail)
    add_helmet(model, [0.05, 0.0, 1.485], 0.135, _HELMETS[variant], sides + 1, full=True)
    return model


def model_bicycle(variant: int, detail: int, pose: int) -> Modeller:
    """Model a bicycle with its rider in one phase of the pedals' turn; the frame takes the actor's paint."""
    model = Modeller((1.75, 0.60, 1.72))
    for x in (0.53, -0.53):
        _wheel(model, x, 0.345, 0.045, None, detail)
    crank, seat, head, rear = [-0.08, 0.29], [-0.24, 0.90], [0.36, 0.86], [-0.53, 0.345]
    frame = [(crank, seat), (crank, head), (seat, head), (rear, crank), (rear, seat), (head, [0.53, 0.345])]
    for a, b in frame if detail < 2 else frame[1:2]:
        model.add_tube([[a[0], 0.0, a[1]], [b[0], 0.0, b[1]]], (0.024, 0.024), PAINT, 4 if detail == 0 else 3)
    model.add_box([-0.38, -0.07, 0.90], [-0.12, 0.07, 0.96], TRIM, skip="b")
    if detail < 2:
        model.add_tube([[0.34, 0.0, 0.84], [0.30, 0.0, 1.06]], (0.02, 0.02), CHROME, 4)
        model.add_tube([[0.30, 0.0, 1.06], [0.24, 0.30, 1.06]], (0.018, 0.018), TRIM, 4, mirror=True)
    if detail == 0:
        model.add_box([0.34, -0.03, 0.90], [0.39, 0.03, 0.97], HEAD_LAMP)
        model.add_box([-0.40, -0.03, 0.82], [-0.36, 0.03, 0.88], TAIL_LAMP)
    place = _Seat((-0.22, 1.0), (0.06, 1.42), (0.25, 0.26, 1.09), (0.13, 0.12))
    turn = pose * np.pi / 2 + 0.4
    legs = []
    for angle in (turn, turn + np.pi):
        foot_x, foot_z = crank[0] + 0.17 * np.cos(angle), crank[1] + 0.09 - 0.17 * np.sin(angle)
        legs.append((0.5 * (foot_x - 0.22) + 0.28, 0.5 * (foot_z + 1.0) + 0.08, foot_x, foot_z))
    _rider(model, place, legs, variant, detail)
    sides = (6, 5, 3)[detail]
    add_limb(
        model, [(0.10, 0.0, 1.42), (0.12, 0.0, 1.54), (0.12, 0.0, 1.62)], (0.06, 0.095, 0.10), SKINS[variant], sides
    )
    add_helmet(model, [0.11, 0.0, 1.60], 0.125, _HELMETS[variant], sides + 1, full=False)
    return model
