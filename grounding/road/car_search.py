"""Search over the poses of a car, compiled: states are cells of poses, arcs lead from one to the next."""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from appocc.checks import FloatArray
from grounding.road.reeds_shepp import words_between

# A state is this many cells wide and one of this many headings. Arcs are longer than its diagonal.
STATE_CELLS, HEADINGS = 2, 40
# States beyond each border of the map: the car may begin there.
OUTSIDE = 8
_ARC_M = 1.2
# Cost of a metre backwards, of a change of gear, and of a metre at full lock, beyond its length.
_BACKWARDS, _GEAR, _LOCK = 1.5, 5.0, 0.1
# Queue of the search: width of a bucket, greatest cost, and entries per state.
_BUCKET, _MOST_COST, _ENTRIES = 0.25, 200.0, 6
# Radii of connecting curves relative to that of full lock: wider ones are more comfortable.
_RADII = (4.0, 2.0, 1.0)
# States around a goal: distance, and how many are tried.
_AROUND_M, _TRIED = 9.0, 1000
# A way that costs at most this much more than the cheapest will do.
_CLOSE_ENOUGH = 1.0
_STEP_M = 0.4
# States that one curve may replace.
_SHORTCUT = 24


class CarModel(NamedTuple):
    """A car and its surroundings.

    Attributes:
        clearance: (X, Y) distance of each cell to the nearest one that is not free.
        extra: (X, Y) cost of a metre in a cell, beyond one.
        low_m: (2,) centre of the first cell.
        cell_m: size of a cell.
        discs_m: (D,) distances of the discs that cover the body, forward from the rear axle.
        disc_m: their radius.
        radius_m: least radius of the rear axle's way.
        most_back_m: greatest distance backwards.
        body: (6,) where the car stands now: its centre, unit heading, and half of length and width.
    """

    clearance: NDArray[np.float32]
    extra: NDArray[np.float32]
    low_m: FloatArray
    cell_m: float
    discs_m: FloatArray
    disc_m: float
    radius_m: float
    most_back_m: float
    body: FloatArray


@numba.njit(cache=True, nogil=True)
def _room_m(car: CarModel, x: float, y: float) -> float:
    """Return the clearance at a point, between the cells; 0 off the map."""
    a, b = (x - car.low_m[0]) / car.cell_m, (y - car.low_m[1]) / car.cell_m
    i, j = int(np.floor(a)), int(np.floor(b))
    if i < 0 or j < 0 or i + 1 >= car.clearance.shape[0] or j + 1 >= car.clearance.shape[1]:
        return 0.0
    u, v = a - i, b - j
    low = car.clearance[i, j] * (1 - v) + car.clearance[i, j + 1] * v
    high = car.clearance[i + 1, j] * (1 - v) + car.clearance[i + 1, j + 1] * v
    return float(low * (1 - u) + high * u)


@numba.njit(cache=True, nogil=True)
def _fits(car: CarModel, x: float, y: float, yaw: float) -> bool:
    cos, sin = np.cos(yaw), np.sin(yaw)
    for along in car.discs_m:
        px, py = x + along * cos, y + along * sin
        if _room_m(car, px, py) < car.disc_m:
            # What is below the body now is no obstacle, on the map or not.
            dx, dy = px - car.body[0], py - car.body[1]
            ahead, left = dx * car.body[2] + dy * car.body[3], dy * car.body[2] - dx * car.body[3]
            if abs(ahead) > car.body[4] or abs(left) > car.body[5]:
                return False
    return True


@numba.njit(cache=True, nogil=True)
def _extra(car: CarModel, x: float, y: float) -> float:
    i, j = int((x - car.low_m[0]) / car.cell_m + 0.5), int((y - car.low_m[1]) / car.cell_m + 0.5)
    if i < 0 or j < 0 or i >= car.extra.shape[0] or j >= car.extra.shape[1]:
        return 0.0
    return float(car.extra[i, j])


@numba.njit(cache=True, nogil=True)
def _advance(x: float, y: float, yaw: float, length: float, bend: float) -> tuple[float, float, float]:
    """Return the pose after a signed length at a curvature."""
    if abs(bend) < 1e-9:
        return x + length * np.cos(yaw), y + length * np.sin(yaw), yaw
    turned = yaw + length * bend
    return x + (np.sin(turned) - np.sin(yaw)) / bend, y - (np.cos(turned) - np.cos(yaw)) / bend, turned


@numba.njit(cache=True, nogil=True)
def _state(car: CarModel, shape: tuple[int, int, int], x: float, y: float, yaw: float) -> int:
    """Return the index of the state of a pose, -1 off the map."""
    span = car.cell_m * STATE_CELLS
    i = int(np.floor((x - car.low_m[0]) / span + 0.5)) + OUTSIDE
    j = int(np.floor((y - car.low_m[1]) / span + 0.5)) + OUTSIDE
    if i < 0 or j < 0 or i >= shape[0] or j >= shape[1]:
        return -1
    return (i * shape[1] + j) * HEADINGS + int(np.floor(yaw / (2 * np.pi) * HEADINGS + 0.5)) % HEADINGS


@numba.njit(cache=True, nogil=True)
def search_poses(car: CarModel, start: FloatArray) -> FloatArray:
    """Return the best pose of each state (I, J, HEADINGS, 8); its cost is infinite where none is reached.

    The columns: cost, x, y, heading, metres backwards, gear (1 or -1) and curvature of the arc that leads there,
    index of the state before.

    Args:
        car: the car and its surroundings.
        start: (3,) pose of the rear axle.
    """
    more = 1 + 2 * OUTSIDE
    shape = (car.clearance.shape[0] // STATE_CELLS + more, car.clearance.shape[1] // STATE_CELLS + more, HEADINGS)
    size = shape[0] * shape[1] * shape[2]
    states = np.empty((size, 8))
    states[:, 0] = np.inf
    done = np.zeros(size, np.bool_)
    # Buckets of states with about the same cost: linked lists in one pool.
    heads = np.full(int(_MOST_COST / _BUCKET) + 1, -1, np.int64)
    entry, after = np.empty(size * _ENTRIES, np.int32), np.empty(size * _ENTRIES, np.int64)
    first = _state(car, shape, start[0], start[1], start[2])
    if first < 0:
        return states.reshape(shape[0], shape[1], shape[2], 8)
    states[first] = np.array([0.0, start[0], start[1], start[2], 0.0, 1.0, 0.0, -1.0])
    entry[0], after[0], heads[0], used = first, -1, 0, 1
    bucket = 0
    while bucket < len(heads):
        at = heads[bucket]
        if at < 0:
            bucket += 1
            continue
        heads[bucket] = after[at]
        here = entry[at]
        if done[here]:
            continue
        done[here] = True
        cost, x, y, yaw, back, gear = states[here, :6]
        for way in (1.0, -1.0):
            back2 = back + (_ARC_M if way < 0 else 0.0)
            if back2 > car.most_back_m:
                continue
            for steer in (0.0, 0.5, -0.5, 1.0, -1.0):
                bend = steer / car.radius_m
                x2, y2, yaw2 = _advance(x, y, yaw, way * _ARC_M, bend)
                there = _state(car, shape, x2, y2, yaw2)
                if there < 0 or done[there]:
                    continue
                rate = 1.0 + _LOCK * abs(steer) + _extra(car, x2, y2) + (_BACKWARDS if way < 0 else 0.0)
                total = cost + _ARC_M * rate + (_GEAR if way != gear else 0.0)
                if total >= states[there, 0] or total >= _MOST_COST or used >= len(entry):
                    continue
                middle = _advance(x, y, yaw, way * _ARC_M / 2, bend)
                if not _fits(car, x2, y2, yaw2) or not _fits(car, middle[0], middle[1], middle[2]):
                    continue
                states[there, 0], states[there, 1], states[there, 2], states[there, 3] = total, x2, y2, yaw2
                states[there, 4], states[there, 5], states[there, 6], states[there, 7] = back2, way, bend, here
                slot = max(int(total / _BUCKET), bucket)
                entry[used], after[used], heads[slot] = there, heads[slot], used
                used += 1
    return states.reshape(shape[0], shape[1], shape[2], 8)


@numba.njit(cache=True, nogil=True)
def _curve_cost(
    car: CarModel, pose: FloatArray, word: FloatArray, radius: float, gear: float, most: float
) -> tuple[float, float]:
    """Return the cost of a curve from a pose, infinity if it does not fit or costs more, and metres backwards.

    It is tested from its end, where room is scarce: most curves that do not fit end too close to something.
    """
    x, y, yaw = pose[0], pose[1], pose[2]
    cost, back = 0.0, 0.0
    for k in range(3):
        length, bend = word[k] * radius, word[3 + k] / radius
        if abs(length) < 1e-6:
            continue
        way = 1.0 if length > 0 else -1.0
        cost += _GEAR if way != gear else 0.0
        cost += abs(length) * (1.0 + _LOCK * abs(bend) * car.radius_m + (_BACKWARDS if way < 0 else 0.0))
        back -= min(length, 0.0)
        gear = way
        x, y, yaw = _advance(x, y, yaw, length, bend)
    if cost > most:
        return np.inf, 0.0
    for k in (2, 1, 0):
        length, bend = word[k] * radius, word[3 + k] / radius
        if abs(length) < 1e-6:
            continue
        steps = int(abs(length) / _STEP_M) + 1
        for _ in range(steps):
            if not _fits(car, x, y, yaw):
                return np.inf, 0.0
            cost += abs(length) / steps * _extra(car, x, y)
            x, y, yaw = _advance(x, y, yaw, -length / steps, bend)
        if cost > most:
            return np.inf, 0.0
    return cost, back


@numba.njit(cache=True, nogil=True)
def _least_curve_cost(car: CarModel, pose: FloatArray, goal: FloatArray, gear: float) -> float:
    """Return a lower bound of the cost between two poses: that of the cheapest curve if nothing is in the way."""
    words = words_between(pose, goal, car.radius_m)
    least = np.inf
    for n in range(len(words)):
        cost, now = 0.0, gear
        for k in range(3):
            length = words[n, k] * car.radius_m
            if abs(length) < 1e-6:
                continue
            way = 1.0 if length > 0 else -1.0
            cost += (_GEAR if way != now else 0.0) + abs(length) * (1.0 if way > 0 else 1.0 + _BACKWARDS)
            now = way
        least = min(least, cost)
    return least


@numba.njit(cache=True, nogil=True)
def _best_curve(
    car: CarModel, pose: FloatArray, goal: FloatArray, gear: float, most: float, most_back: float
) -> tuple[float, FloatArray]:
    """Return the cost and the curve (7,) from a pose to a goal: word and radius; infinity if none fits."""
    best, chosen = most, np.zeros(7)
    found = False
    for factor in _RADII:
        radius = factor * car.radius_m
        words = words_between(pose, goal, radius)
        for n in range(len(words)):
            if np.abs(words[n, :3]).sum() * radius >= best:
                continue
            cost, back = _curve_cost(car, pose, words[n], radius, gear, best)
            if cost < best and back <= most_back:
                best, found = cost, True
                chosen[:6], chosen[6] = words[n], radius
    return (best if found else np.inf), chosen


@numba.njit(cache=True, nogil=True)
def connect(car: CarModel, reached: FloatArray, goal: FloatArray) -> FloatArray:
    """Return the states (K, 8) of about the cheapest way from the start to a pose; none if there is no way.

    Args:
        car: the car and its surroundings.
        reached: states of `search_poses`.
        goal: (3,) pose of the rear axle.
    """
    states = reached.reshape(-1, 8)
    _, wide, _, _ = reached.shape
    span = car.cell_m * STATE_CELLS
    around = int(_AROUND_M / span)
    mid_i = int(np.floor((goal[0] - car.low_m[0]) / span + 0.5)) + OUTSIDE
    mid_j = int(np.floor((goal[1] - car.low_m[1]) / span + 0.5)) + OUTSIDE
    near, least = [0], [np.inf]
    for i in range(max(mid_i - around, 0), min(mid_i + around + 1, reached.shape[0])):
        for j in range(max(mid_j - around, 0), min(mid_j + around + 1, wide)):
            for k in range(HEADINGS):
                n = (i * wide + j) * HEADINGS + k
                if states[n, 0] == np.inf:
                    continue
                turn = abs((states[n, 3] - goal[2] + np.pi) % (2 * np.pi) - np.pi)
                far = np.hypot(states[n, 1] - goal[0], states[n, 2] - goal[1])
                near.append(n)
                least.append(states[n, 0] + max(far, turn * car.radius_m))
    best, last, curve = np.inf, -1, np.zeros(7)
    if not _fits(car, goal[0], goal[1], goal[2]):
        return np.empty((0, 8))
    few = np.argsort(np.array(least))[:_TRIED]
    bounds = np.full(len(few), np.inf)
    for number in range(len(few)):
        n = near[few[number]]
        if least[few[number]] < np.inf:
            bounds[number] = states[n, 0] + _least_curve_cost(car, states[n, 1:4], goal, states[n, 5])
    for number in np.argsort(bounds):
        n = near[few[number]]
        if bounds[number] >= best - _CLOSE_ENOUGH or bounds[number] == np.inf:
            break
        spare = car.most_back_m - states[n, 4]
        cost, found = _best_curve(car, states[n, 1:4], goal, states[n, 5], best - states[n, 0], spare)
        if states[n, 0] + cost < best:
            best, last, curve = states[n, 0] + cost, n, found
    if last < 0:
        return np.empty((0, 8))
    chain = [last]
    while states[chain[-1], 7] >= 0:
        chain.append(int(states[chain[-1], 7]))
    out = np.empty((len(chain) + 3, 8))
    for row in range(len(chain)):
        out[row] = states[chain[len(chain) - 1 - row]]
    _append_curve(out, len(chain), curve)
    return out


@numba.njit(cache=True, nogil=True)
def _append_curve(out: FloatArray, row: int, curve: FloatArray) -> None:
    """Write the three segments of a curve as states, from the one before the row on."""
    for k in range(3):
        length, bend = curve[k] * curve[6], curve[3 + k] / curve[6]
        before = out[row + k - 1]
        x, y, yaw = _advance(before[1], before[2], before[3], length, bend)
        way = 1.0 if length > 0 else -1.0 if length < 0 else before[5]
        out[row + k] = np.array([np.abs(length), x, y, yaw, 0.0, way, bend, -1.0])


@numba.njit(cache=True, nogil=True)
def _chain_cost(car: CarModel, states: FloatArray) -> FloatArray:
    """Return the cost (K,) from the first state of a chain to each."""
    cost = np.zeros(len(states))
    gear = states[0, 5]
    for row in range(1, len(states)):
        length = _length_m(states[row - 1], states[row])
        way = states[row, 5]
        rate = 1.0 + _LOCK * abs(states[row, 6]) * car.radius_m + (_BACKWARDS if way < 0 else 0.0)
        rate += _extra(car, states[row, 1], states[row, 2])
        cost[row] = cost[row - 1] + length * rate + (_GEAR if way != gear and length > 0 else 0.0)
        gear = way
    return cost


@numba.njit(cache=True, nogil=True)
def _length_m(one: FloatArray, two: FloatArray) -> float:
    """Return the length of the arc from a state to the next."""
    bend = two[6]
    if abs(bend) < 1e-9:
        return float(np.hypot(two[1] - one[1], two[2] - one[2]))
    return float(abs((two[3] - one[3]) / bend))


@numba.njit(cache=True, nogil=True)
def shorten(car: CarModel, states: FloatArray) -> FloatArray:
    """Return the way along states (K, 8) as poses (N, 4): x, y, heading, gear; curves replace states if they can."""
    cost = _chain_cost(car, states)
    way = np.empty((4 * len(states) + 4, 8))
    way[0], used, at = states[0], 1, 0
    while at < len(states) - 1:
        to = min(at + _SHORTCUT, len(states) - 1)
        replaced = False
        while to > at + 1:
            most = cost[to] - cost[at] + 0.3
            pose = way[used - 1]
            found, curve = _best_curve(car, pose[1:4], states[to, 1:4], pose[5], most, car.most_back_m)
            if found < np.inf and _gear_after(curve) == states[to, 5]:
                _append_curve(way, used, curve)
                used += 3
                at, replaced = to, True
                break
            to -= 1 if to - at < 6 else 3
        if not replaced:
            at += 1
            way[used] = states[at]
            turned = (states[at, 3] - way[used - 1, 3] + np.pi) % (2 * np.pi) - np.pi
            way[used, 3] = way[used - 1, 3] + turned  # curves may have gone round once more
            used += 1
    return _sample(way[:used])


@numba.njit(cache=True, nogil=True)
def _gear_after(curve: FloatArray) -> float:
    for k in (2, 1, 0):
        if abs(curve[k]) > 1e-6:
            return 1.0 if curve[k] > 0 else -1.0
    return 1.0


@numba.njit(cache=True, nogil=True)
def _sample(states: FloatArray) -> FloatArray:
    """Return poses (N, 4) along states, at most a step apart."""
    out = [(states[0, 1], states[0, 2], states[0, 3], states[0, 5])]
    for row in range(1, len(states)):
        length, bend, way = _length_m(states[row - 1], states[row]), states[row, 6], states[row, 5]
        steps = int(length / _STEP_M) + 1
        x, y, yaw = states[row - 1, 1], states[row - 1, 2], states[row - 1, 3]
        if length < 1e-6:
            continue
        for _ in range(steps):
            x, y, yaw = _advance(x, y, yaw, way * length / steps, bend)
            out.append((x, y, yaw, way))
    found = np.empty((len(out), 4))
    for row in range(len(out)):
        found[row, 0], found[row, 1], found[row, 2], found[row, 3] = out[row]
    return found
