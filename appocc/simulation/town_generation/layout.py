"""Street layout of a generated town: a jittered grid with arterials, curves, a roundabout, diagonal streets."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from appocc.checks import FloatArray

Cell = tuple[int, int]
_LINES = 6
_SPACING_M, _JITTER_M = (66.0, 92.0), 11.0
_DROPPED = 0.15
_RING_M = 15.0


@dataclass(frozen=True, eq=False)
class Crossing:
    """A crossing: position (2,), SUMO's junction type, and the radius of its corners."""

    name: str
    xy_m: FloatArray
    kind: str
    radius_m: float = 6.5


@dataclass(frozen=True, eq=False, kw_only=True)
class Street:
    """A street between two crossings.

    Attributes:
        name: unique name.
        start: name of the first crossing.
        end: name of the last crossing.
        line_m: (N, 2) centre line from start to end.
        lanes: driving lanes in both directions; one-way streets have 0 in the opposite direction.
        parking: whether cars park along the right and the left kerb.
        lane_m: width of a driving lane.
        speed_mps: speed limit.
        priority: higher has right of way.
    """

    name: str
    start: str
    end: str
    line_m: FloatArray
    lanes: tuple[int, int] = (1, 1)
    parking: tuple[bool, bool] = (False, False)
    lane_m: float = 3.2
    speed_mps: float = 8.3
    priority: int = 3


@dataclass(frozen=True)
class Layout:
    """All crossings and streets."""

    crossings: tuple[Crossing, ...]
    streets: tuple[Street, ...]


def draw_layout(seed: int, lines: int = _LINES) -> Layout:
    """Draw the streets of a town of (lines - 1) x (lines - 1) blocks; the same seed gives the same layout."""
    rng = np.random.default_rng([seed, 1])
    places = _places(rng, lines)
    arterials = _arterials(rng, lines)
    pairs = _remove_streets(rng, _grid_pairs(lines), arterials)
    pairs += _diagonals(rng, pairs, arterials, lines)
    arms = _arms(pairs)
    ring = _draw_roundabout(rng, arms, arterials)
    headings = _headings(rng, places, arms, arterials)
    chains = _chains(pairs, arms, arterials)
    streets = [_street(rng, chain, places, headings, arterials, ring) for chain in chains]
    kinds = _kinds(rng, arms, arterials)
    crossings = [Crossing(_name(c), places[c], kinds[c]) for c in sorted(arms) if len(arms[c]) > 2 and c != ring]
    if ring is not None:
        corners, arcs = _roundabout(places[ring], ring, streets)
        crossings, streets = crossings + corners, streets + arcs
    return Layout(tuple(crossings), tuple(_draw_one_ways(rng, streets)))


def _name(cell: Cell) -> str:
    return f"n{cell[0]}{cell[1]}"


def _places(rng: np.random.Generator, lines: int) -> dict[Cell, FloatArray]:
    columns = np.concatenate([[0.0], np.cumsum(rng.uniform(*_SPACING_M, lines - 1))])
    rows = np.concatenate([[0.0], np.cumsum(rng.uniform(*_SPACING_M, lines - 1))])
    shift = rng.uniform(-_JITTER_M, _JITTER_M, (lines, lines, 2))
    return {(i, j): np.array([columns[i], rows[j]]) + shift[i, j] for i in range(lines) for j in range(lines)}


def _arterials(rng: np.random.Generator, lines: int) -> tuple[int, int]:
    """Draw the arterial column and row; -1 for none."""
    column, row = (int(rng.integers(1, lines - 1)) for _ in range(2))
    only = rng.uniform()
    return (-1 if only < 0.2 else column), (-1 if only > 0.85 else row)


def _is_arterial(a: Cell, b: Cell, arterials: tuple[int, int]) -> bool:
    return a[0] == b[0] == arterials[0] or a[1] == b[1] == arterials[1]


def _grid_pairs(lines: int) -> list[tuple[Cell, Cell]]:
    along = [((i, j), (i + 1, j)) for i in range(lines - 1) for j in range(lines)]
    return along + [((i, j), (i, j + 1)) for i in range(lines) for j in range(lines - 1)]


def _arms(pairs: list[tuple[Cell, Cell]]) -> dict[Cell, list[Cell]]:
    arms: dict[Cell, list[Cell]] = defaultdict(list)
    for a, b in pairs:
        arms[a].append(b)
        arms[b].append(a)
    return arms


def _connected(pairs: list[tuple[Cell, Cell]], count: int) -> bool:
    arms = _arms(pairs)
    seen, todo = {pairs[0][0]}, [pairs[0][0]]
    while todo:
        fresh = [cell for cell in arms[todo.pop()] if cell not in seen]
        seen.update(fresh)
        todo += fresh
    return len(seen) == count


def _remove_streets(
    rng: np.random.Generator, pairs: list[tuple[Cell, Cell]], arterials: tuple[int, int]
) -> list[tuple[Cell, Cell]]:
    """Remove some streets; all places stay connected, and no street winds along more than two blocks."""
    count, wanted = len(_arms(pairs)), round(len(pairs) * (1 - _DROPPED))
    for pair in [pairs[k] for k in rng.permutation(len(pairs))]:
        rest = [p for p in pairs if p != pair]
        arms = _arms(rest)
        bends = [c for c in pair if len(arms[c]) == 2]
        winding = any(len(arms[n]) == 2 for c in bends for n in arms[c])
        main = any(c[0] == arterials[0] or c[1] == arterials[1] for c in bends)
        lonely = min(len(arms[c]) for c in pair) < 2
        if len(rest) < wanted or lonely or winding or main or _is_arterial(pair[0], pair[1], arterials):
            continue
        if _connected(rest, count):
            pairs = rest
    return pairs


def _diagonals(
    rng: np.random.Generator, pairs: list[tuple[Cell, Cell]], arterials: tuple[int, int], lines: int
) -> list[tuple[Cell, Cell]]:
    """Draw up to two diagonal streets across a block; they create skewed and five-arm junctions."""
    arms, found = _arms(pairs), list[tuple[Cell, Cell]]()
    used: set[Cell] = set()
    for _ in range(int(rng.integers(1, 3)) if lines > 3 else 0):
        i, j = (int(v) for v in rng.integers(0, lines - 1, 2))
        a, b = ((i, j), (i + 1, j + 1)) if rng.uniform() < 0.5 else ((i + 1, j), (i, j + 1))
        signalled = any(c[0] == arterials[0] and c[1] == arterials[1] for c in (a, b))
        if not signalled and max(len(arms[a]), len(arms[b])) < 5 and not {a, b} & used:
            found.append((a, b))
            used |= {a, b}
    return found


def _draw_roundabout(
    rng: np.random.Generator, arms: dict[Cell, list[Cell]], arterials: tuple[int, int]
) -> Cell | None:
    """Draw the cell of the roundabout; about two thirds of the towns have one."""
    fit = [c for c in sorted(arms) if c[0] != arterials[0] and c[1] != arterials[1] and 3 <= len(arms[c]) <= 4]
    fit = [c for c in fit if all(abs(c[0] - n[0]) + abs(c[1] - n[1]) == 1 for n in arms[c])]
    return fit[int(rng.integers(len(fit)))] if fit and rng.uniform() < 0.7 else None


def _unit(vector: FloatArray) -> FloatArray:
    return np.asarray(vector / max(float(np.hypot(*vector)), 1e-9))


def _headings(
    rng: np.random.Generator, places: dict[Cell, FloatArray], arms: dict[Cell, list[Cell]], arterials: tuple[int, int]
) -> dict[tuple[Cell, Cell], FloatArray]:
    """Return the direction in which each street leaves each place; through streets have no kink."""
    found: dict[tuple[Cell, Cell], FloatArray] = {}
    for cell in sorted(arms):
        for other in arms[cell]:
            ahead = _unit(places[other] - places[cell])
            opposite = (2 * cell[0] - other[0], 2 * cell[1] - other[1])
            partner = next((n for n in arms[cell] if n != other), other) if len(arms[cell]) == 2 else opposite
            if partner in arms[cell]:
                ahead = _unit(places[other] - places[partner])
            elif not _is_arterial(cell, other, arterials):
                turn = rng.normal(0.0, 0.12)
                ahead = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]) @ ahead
            found[cell, other] = ahead
    return found


def _chains(
    pairs: list[tuple[Cell, Cell]], arms: dict[Cell, list[Cell]], arterials: tuple[int, int]
) -> list[list[Cell]]:
    """Return streets as lists of places: they continue through places with two arms."""
    left = {frozenset(pair) for pair in pairs}
    chains = []
    for start in [c for c in sorted(arms) if len(arms[c]) > 2]:
        for first in sorted(arms[start]):
            chain = [start, first]
            if frozenset(chain) not in left:
                continue
            while len(arms[chain[-1]]) == 2:
                chain.append(next(n for n in arms[chain[-1]] if n != chain[-2]))
            left -= {frozenset(pair) for pair in pairwise(chain)}
            chains.append(chain)
    return chains


def _curve(start: FloatArray, out: FloatArray, end: FloatArray, back: FloatArray) -> FloatArray:
    """Return (N, 2) of a cubic Bezier curve with end tangents `out` and `back`, a point every 3 m."""
    length = float(np.hypot(*(end - start)))
    t = np.linspace(0, 1, max(int(length / 3), 4))[:, None]
    a, b = start + out * length / 3, end + back * length / 3
    return np.asarray((1 - t) ** 3 * start + 3 * t * (1 - t) ** 2 * a + 3 * t**2 * (1 - t) * b + t**3 * end)


def _street(
    rng: np.random.Generator,
    chain: list[Cell],
    places: dict[Cell, FloatArray],
    headings: dict[tuple[Cell, Cell], FloatArray],
    arterials: tuple[int, int],
    ring: Cell | None,
) -> Street:
    pieces: list[FloatArray] = []
    for a, b in pairwise(chain):
        out, back = headings[a, b], headings[b, a]
        start = places[a] + (out * _RING_M if a == ring else 0)
        end = places[b] + (back * _RING_M if b == ring else 0)
        pieces.append(_curve(start, out, end, back)[(1 if pieces else 0) :])
    names = [_name(c) for c in (chain[0], chain[-1])]
    if chain[0] == ring:
        names[0] = f"r{_name(chain[1])}"
    if chain[-1] == ring:
        names[1] = f"r{_name(chain[-2])}"
    name = f"s{_name(chain[0])}{_name(chain[1])}"
    street = Street(name=name, start=names[0], end=names[1], line_m=np.concatenate(pieces))
    if _is_arterial(chain[0], chain[1], arterials):
        return replace(street, lanes=(2, 2), lane_m=3.3, speed_mps=13.9, priority=9)
    parking = rng.uniform(size=2) < 0.72
    return replace(
        street,
        parking=(bool(parking[0]), bool(parking[1])),
        speed_mps=float(rng.choice([8.3, 9.7, 11.1])),
        priority=int(rng.integers(2, 5)),
    )


def _kinds(rng: np.random.Generator, arms: dict[Cell, list[Cell]], arterials: tuple[int, int]) -> dict[Cell, str]:
    kinds = {}
    for cell in sorted(arms):
        draw = rng.uniform()
        on = (cell[0] == arterials[0]) + (cell[1] == arterials[1])
        lit = on == 2 or (on == 1 and draw < 0.55)
        kinds[cell] = "traffic_light" if lit else "right_before_left" if not on and draw < 0.5 else "priority"
    return kinds


def _roundabout(centre: FloatArray, ring: Cell, streets: list[Street]) -> tuple[list[Crossing], list[Street]]:
    """Return the crossings of a roundabout where its arms arrive, and its arcs, counter-clockwise."""
    ends = [(s.start, s.line_m[0]) for s in streets] + [(s.end, s.line_m[-1]) for s in streets]
    corners = [(n, xy) for n, xy in ends if n.startswith("r") and abs(np.hypot(*(xy - centre)) - _RING_M) < 0.01]
    corners.sort(key=lambda corner: float(np.arctan2(*(corner[1] - centre)[::-1])))
    arcs = []
    for (a, a_xy), (b, b_xy) in zip(corners, corners[1:] + corners[:1], strict=True):
        first, last = (float(np.arctan2(*(xy - centre)[::-1])) for xy in (a_xy, b_xy))
        angle = np.linspace(first, first + (last - first) % (2 * np.pi), 16)
        line = centre + _RING_M * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        name = f"o{_name(ring)}{a}"
        arcs.append(
            Street(name=name, start=a, end=b, line_m=line, lanes=(1, 0), lane_m=4.6, speed_mps=6.5, priority=8)
        )
    return [Crossing(name, xy, "priority", 5.0) for name, xy in corners], arcs


def _draw_one_ways(rng: np.random.Generator, streets: list[Street]) -> list[Street]:
    """Turn some narrow streets into one-way streets while every street stays reachable from every other."""
    wanted = int(rng.integers(2, 5))
    for k in rng.permutation(len(streets)):
        street = streets[k]
        if not wanted or street.lanes != (1, 1) or {street.start[0], street.end[0]} & {"r"}:
            continue
        single = replace(street, lanes=(1, 0), lane_m=3.5, parking=(True, bool(rng.uniform() < 0.8)))
        trial = [single if s is street else s for s in streets]
        if _is_strongly_connected(trial):
            streets, wanted = trial, wanted - 1
    return streets


def _is_strongly_connected(streets: list[Street]) -> bool:
    """Return whether every street is reachable from every other without U-turns."""
    ways = [(s.start, s.end, s.name) for s in streets] + [(s.end, s.start, s.name) for s in streets if s.lanes[1]]
    return all(_count_reached(list(range(len(ways))), ways, step) == len(ways) for step in (1, -1))


def _count_reached(_: list[int], ways: list[tuple[str, str, str]], step: int) -> int:
    leaving: dict[str, list[int]] = defaultdict(list)
    for k, way in enumerate(ways):
        leaving[way[0] if step == 1 else way[1]].append(k)
    seen, todo = {0}, [0]
    while todo:
        k = todo.pop()
        end = ways[k][1] if step == 1 else ways[k][0]
        fresh = [n for n in leaving[end] if n not in seen and ways[n][2] != ways[k][2]]
        seen.update(fresh)
        todo += fresh
    return len(seen)
