"""Reeds-Shepp curves: short ways of a car between two poses, of arcs at full lock and straight lines, both ways.

Reeds and Shepp, "Optimal paths for a car that goes both forwards and backwards", 1990. Of their words those of three
segments are tried: arc, line, arc (8.1, 8.2) and three arcs (8.3, 8.4). Lengths are signed, negative for backwards,
and in units of the radius; a bend is 1 to the left, -1 to the right, 0 straight.
"""

from __future__ import annotations

import numba
import numpy as np

from appocc.checks import FloatArray


@numba.njit(cache=True, nogil=True)
def _wrap(angle: float) -> float:
    return (angle + np.pi) % (2 * np.pi) - np.pi


@numba.njit(cache=True, nogil=True)
def _lsl(x: float, y: float, turn: float) -> tuple[bool, float, float, float]:
    a, b = x - np.sin(turn), y - 1 + np.cos(turn)
    t = np.arctan2(b, a)
    v = _wrap(turn - t)
    return t >= 0 and v >= 0, t, np.hypot(a, b), v


@numba.njit(cache=True, nogil=True)
def _lsr(x: float, y: float, turn: float) -> tuple[bool, float, float, float]:
    a, b = x + np.sin(turn), y - 1 - np.cos(turn)
    squared = a * a + b * b
    if squared < 4:
        return False, 0.0, 0.0, 0.0
    u = np.sqrt(squared - 4)
    t = _wrap(np.arctan2(b, a) + np.arctan2(2.0, u))
    v = _wrap(t - turn)
    return t >= 0 and v >= 0, t, u, v


@numba.njit(cache=True, nogil=True)
def _lrl(x: float, y: float, turn: float) -> tuple[bool, float, float, float]:
    a, b = x - np.sin(turn), y - 1 + np.cos(turn)
    far = np.hypot(a, b)
    if far > 4:
        return False, 0.0, 0.0, 0.0
    u = -2 * np.arcsin(far / 4)
    t = _wrap(np.arctan2(b, a) + u / 2 + np.pi)
    v = _wrap(turn - t + u)
    return t >= 0, t, u, v


@numba.njit(cache=True, nogil=True)
def words_to(x: float, y: float, turn: float) -> FloatArray:
    """Return the curves (N, 6) to a relative pose in units of the radius: three signed lengths, three bends."""
    found = np.zeros((16, 6))
    count = 0
    for flip in (1.0, -1.0):  # time: the same curve driven the other way
        for mirror in (1.0, -1.0):
            px, py, pt = flip * x, mirror * y, flip * mirror * turn
            for word in range(4):
                if word == 0:
                    holds, t, u, v = _lsl(px, py, pt)
                    last = 1.0
                elif word == 1:
                    holds, t, u, v = _lsr(px, py, pt)
                    last = -1.0
                elif word == 2:
                    holds, t, u, v = _lrl(px, py, pt)
                    last = 1.0
                else:  # the other end first
                    bx, by = px * np.cos(pt) + py * np.sin(pt), px * np.sin(pt) - py * np.cos(pt)
                    holds, v, u, t = _lrl(bx, by, pt)
                    last = 1.0
                if holds:
                    found[count, 0], found[count, 1], found[count, 2] = flip * t, flip * u, flip * v
                    found[count, 3], found[count, 5] = mirror, mirror * last
                    found[count, 4] = 0.0 if word < 2 else -mirror
                    count += 1
    return found[:count]


@numba.njit(cache=True, nogil=True)
def words_between(pose: FloatArray, goal: FloatArray, radius: float) -> FloatArray:
    """Return the curves (N, 6) from a pose to another in units of the radius."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    dx, dy = goal[0] - pose[0], goal[1] - pose[1]
    turn = (goal[2] - pose[2] + np.pi) % (2 * np.pi) - np.pi
    return words_to((dx * cos + dy * sin) / radius, (dy * cos - dx * sin) / radius, turn)
