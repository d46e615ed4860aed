"""Painted boxes: the solids that rays hit, with windows, lamps and wheels on their faces; and houses made of them."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from appocc.checks import FloatArray, IntArray

Colour = tuple[int, int, int]
# Faces of a box by number, in the order of the normals +x -x +y -y +z -z.
FRONT, REAR, LEFT, RIGHT, TOP, BOTTOM = range(6)
GLASS: Colour = (36, 44, 52)
RUBBER: Colour = (30, 30, 32)
_HUB, _PANE, _ROOF = (128, 128, 130), (74, 88, 102), (120, 116, 112)
_WHEEL_M, _HUB_M = 0.33, 0.17


class Solid(NamedTuple):
    """A box with a look.

    Attributes:
        street_from_body: (4, 4) pose of the whole body; its origin lies on the ground.
        low_m: (3,) lower corner of the box in the body's frame.
        high_m: (3,) upper corner.
        look: colours (N, 3) 0..255 of surface points (N, 3) in the body's frame on faces (N,).
    """

    street_from_body: FloatArray
    low_m: FloatArray
    high_m: FloatArray
    look: Callable[[FloatArray, IntArray], FloatArray]


class Patch(NamedTuple):
    """A rectangle of another colour on some faces: its range across (x on the sides, else y) and of height."""

    faces: tuple[int, ...]
    across_m: tuple[float, float]
    height_m: tuple[float, float]
    colour: Colour


def painted(
    points: FloatArray, face: IntArray, paint: Colour, patches: tuple[Patch, ...], axles_m: tuple[float, ...]
) -> FloatArray:
    """Colours (N, 3) of a vehicle's surface points (N, 3): paint, patches, and wheels below axles at these x."""
    rgb = np.tile(np.array(paint, dtype=np.float64), (len(points), 1))
    on_side = (face == LEFT) | (face == RIGHT)
    across = np.where(on_side, points[:, 0], points[:, 1])
    for patch in patches:
        here = np.isin(face, patch.faces) & (across >= patch.across_m[0]) & (across <= patch.across_m[1])
        rgb[here & (points[:, 2] >= patch.height_m[0]) & (points[:, 2] <= patch.height_m[1])] = patch.colour
    for axle in axles_m:
        from_hub = np.hypot(points[:, 0] - axle, points[:, 2] - _WHEEL_M)
        rgb[on_side & (from_hub < _WHEEL_M)] = RUBBER
        rgb[on_side & (from_hub < _HUB_M)] = _HUB
    return rgb


def house(x_m: tuple[float, float], y_m: tuple[float, float], height_m: float, wall: Colour) -> Solid:
    """A house along the street: walls with rows of windows, a grey roof."""
    low, high = np.array([x_m[0], y_m[0], 0.0]), np.array([x_m[1], y_m[1], height_m])
    return Solid(np.eye(4), low, high, partial(_facade, wall=wall, height_m=height_m))


def _facade(points: FloatArray, face: IntArray, wall: Colour, height_m: float) -> FloatArray:
    rgb = np.tile(np.array(wall, dtype=np.float64), (len(points), 1))
    across = np.where((face == LEFT) | (face == RIGHT), points[:, 0], points[:, 1])
    column, storey = np.mod(across, 2.6), np.mod(points[:, 2], 3.1)
    window = (column > 0.7) & (column < 1.9) & (storey > 1.0) & (storey < 2.5) & (points[:, 2] < height_m - 0.5)
    rgb[window] = _PANE
    rgb[face == TOP] = _ROOF
    return rgb
