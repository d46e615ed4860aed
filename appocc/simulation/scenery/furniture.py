"""Templates of street furniture around their own origins; the front faces -y, the carriageway."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from appocc.checks import FloatArray
from appocc.simulation.mesh import Material, Mesh, join_meshes
from appocc.simulation.scenery.builder import Builder, LocalFrame, Tint, tapered_rod
from appocc.simulation.scenery.palette import CONCRETE

ORIGIN = LocalFrame(np.zeros(2), np.array([1.0, 0.0]))
_STEEL: Tint = (104, 108, 110)
_DARK: Tint = (48, 52, 52)
_RED: Tint = (168, 30, 34)
_WHITE: Tint = (236, 236, 232)
_BLUE: Tint = (28, 74, 150)
_WOOD: Tint = (128, 88, 58)


def post(height_m: float, radius_m: float = 0.045, tint: Tint = _STEEL, top_m: float | None = None) -> Mesh:
    """Return a round post at the origin with a closed top."""
    ends = np.zeros(3), np.array([0.0, 0.0, height_m])
    return tapered_rod(*ends, (radius_m, radius_m if top_m is None else top_m), 6, Material.METAL, tint, capped=True)


def street_lamp(old: bool) -> tuple[Mesh, FloatArray]:
    """Return a street lamp and the position of its light: a lantern on a post, or a long arm over the street."""
    builder = Builder()
    if old:
        light = np.array([0.0, 0.0, 4.72])
        builder.add_boxes(ORIGIN, [-0.13, -0.13, 0.0], [0.13, 0.13, 0.7], Material.METAL, _DARK)
        builder.add_boxes(ORIGIN, [-0.1, -0.1, 4.35], [0.1, 0.1, 4.5], Material.METAL, _DARK, sides="lrfbd")
        low, high = np.array([-0.14, -0.14, 4.5]), np.array([0.14, 0.14, 4.95])
        builder.add_boxes(ORIGIN, low, high, Material.STREET_LAMP, (250, 236, 206), sides="lrfb")
        builder.add_boxes(ORIGIN, [-0.2, -0.2, 4.95], [0.2, 0.2, 5.02], Material.METAL, _DARK, sides="lrfbdt")
        builder.add_boxes(ORIGIN, [-0.1, -0.1, 5.02], [0.1, 0.1, 5.16], Material.METAL, _DARK)
        return join_meshes([post(4.4, 0.075, _DARK, 0.05), builder.mesh()]), light
    light = np.array([0.0, -1.75, 7.42])
    top = np.array([0.0, 0.0, 7.2])
    arm = tapered_rod(top, np.array([0.0, -1.4, 7.56]), (0.05, 0.04), 4, Material.METAL, _STEEL)
    builder.add_boxes(ORIGIN, [-0.13, -2.1, 7.47], [0.13, -1.35, 7.6], Material.METAL, _STEEL, sides="lrfbt")
    below = [[-0.13, -1.35, 7.47], [0.13, -1.35, 7.47], [0.13, -2.1, 7.47], [-0.13, -2.1, 7.47]]
    builder.add_quads(ORIGIN, below, Material.STREET_LAMP, (250, 240, 218))
    builder.add_boxes(ORIGIN, [-0.14, -0.14, 0.0], [0.14, 0.14, 0.5], Material.METAL, _STEEL)
    return join_meshes([post(7.25, 0.09, _STEEL, 0.05), arm, builder.mesh()]), light


def sign_plate(
    corners: FloatArray, z_m: float, tint: Tint, front_m: float, material: Material, back: bool = True
) -> Mesh:
    """Return a flat sign that faces -y: outline (K, 2) of x and height, counter-clockwise from the front."""
    builder = Builder()
    count = len(corners)
    at = np.stack([corners[:, 0], np.full(count, front_m), corners[:, 1] + z_m], axis=1)
    fan = [[at[0], at[i], at[i + 1]] for i in range(1, count - 1)]
    builder.add_triangles(ORIGIN, fan, material, tint)
    if back:
        behind = at + np.array([0.0, 0.02, 0.0])
        rear = [[behind[0], behind[i + 1], behind[i]] for i in range(1, count - 1)]
        builder.add_triangles(ORIGIN, rear, Material.METAL, _STEEL)
    return builder.mesh()


def regular_polygon(count: int, radius_m: float, turn: float = 0.5) -> FloatArray:
    """Return the (K, 2) corners of a regular polygon, counter-clockwise."""
    angle = 2 * np.pi * (np.arange(count) + turn) / count - np.pi / 2
    return np.stack([np.cos(angle), np.sin(angle)], axis=1) * radius_m


def _square(width_m: float, height_m: float, x: float = 0.0, z: float = 0.0) -> FloatArray:
    return np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]) * [width_m, height_m] + [x, z]


def _on_post(*plates: tuple[FloatArray, Tint, float], height_m: float = 2.5) -> Mesh:
    """Return plates in front of each other on a post: outline, colour, distance in front of the first."""
    parts = [post(height_m + 0.25, 0.035)]
    for number, (outline, tint, before) in enumerate(plates):
        parts.append(sign_plate(outline, height_m, tint, -0.05 - before, Material.SIGN, back=number == 0))
    return join_meshes(parts)


def stop_sign() -> Mesh:
    """Return a red octagon with a white rim and a bar for its text."""
    word = _square(0.5, 0.14)
    return _on_post(
        (regular_polygon(8, 0.42), _WHITE, 0.0), (regular_polygon(8, 0.385), _RED, 0.006), (word, _WHITE, 0.012)
    )


def yield_sign() -> Mesh:
    """Return a white triangle with a red rim, point down."""
    down = np.array([[0.0, -0.5], [0.45, 0.28], [-0.45, 0.28]])
    return _on_post((down, _RED, 0.0), (down * 0.62, _WHITE, 0.006))


def limit_sign(number: int) -> Mesh:
    """Return a white disc with a red rim and two digits, for a limit of 30, 50 or 60."""
    left = {3: "acdgb", 5: "afgcd", 6: "afgecd"}.get(number // 10, "acdgb")
    bars = [(bar, _DARK, 0.012) for bar in (*_figure(left, -0.1), *_figure("abcdef", 0.1))]
    return _on_post((regular_polygon(16, 0.33), _RED, 0.0), (regular_polygon(16, 0.26), _WHITE, 0.006), *bars)


def _figure(bars: str, x: float) -> list[FloatArray]:
    """Return the outlines of a seven-segment digit: a at the top, then clockwise to f; g in the middle."""
    wide, thick, half = 0.12, 0.035, 0.1
    places = {
        "a": _square(wide, thick, x, 2 * half - thick),
        "b": _square(thick, 2 * half - thick, x + wide / 2, half - thick / 2),
        "c": _square(thick, 2 * half - thick, x + wide / 2, -half + thick / 2),
        "d": _square(wide, thick, x, -2 * half + thick),
        "e": _square(thick, 2 * half - thick, x - wide / 2, -half + thick / 2),
        "f": _square(thick, 2 * half - thick, x - wide / 2, half - thick / 2),
        "g": _square(wide, thick, x, 0.0),
    }
    return [places[bar] for bar in bars]


def parking_sign() -> Mesh:
    """Return a parking sign: a white P on blue."""
    letter = [_square(0.07, 0.4, -0.09), _square(0.2, 0.06, 0.01, 0.17), _square(0.2, 0.06, 0.01, -0.01)]
    letter.append(_square(0.06, 0.2, 0.1, 0.08))
    return _on_post((_square(0.56, 0.62), _BLUE, 0.0), *((bar, _WHITE, 0.006) for bar in letter))


def crossing_sign() -> Mesh:
    """Return a crossing sign: a white triangle on blue with a dark figure."""
    up = np.array([[-0.24, -0.2], [0.24, -0.2], [0.0, 0.24]])
    return _on_post(
        (_square(0.62, 0.62), _BLUE, 0.0), (up, _WHITE, 0.006), (_square(0.06, 0.24, 0, -0.05), _DARK, 0.012)
    )


def name_sign() -> Mesh:
    """Return a street name sign."""
    board = _square(1.0, 0.24)
    return _on_post((board, (30, 92, 64), 0.0), (_square(0.78, 0.07), _WHITE, 0.006), height_m=2.9)


def litter_bin() -> Mesh:
    """Return a litter bin."""
    drum = tapered_rod(
        np.zeros(3), np.array([0, 0, 0.85]), (0.22, 0.25), 8, Material.METAL, (58, 72, 62), capped=True
    )
    lid = tapered_rod(
        np.array([0, 0, 0.85]), np.array([0, 0, 0.97]), (0.26, 0.18), 8, Material.METAL, _DARK, capped=True
    )
    return join_meshes([drum, lid])


def bench() -> Mesh:
    """Return a wooden bench that faces the street."""
    builder = Builder()
    seat = np.array([[-0.9, -0.22, 0.42], [-0.9, -0.06, 0.42], [-0.9, 0.10, 0.42]])
    builder.add_boxes(ORIGIN, seat, seat + np.array([1.8, 0.13, 0.04]), Material.PLAIN, _WOOD, sides="lrfbdt")
    rest = np.array([[-0.9, 0.25, 0.56], [-0.9, 0.28, 0.72]])
    builder.add_boxes(ORIGIN, rest, rest + np.array([1.8, 0.035, 0.12]), Material.PLAIN, _WOOD, sides="lrfbdt")
    legs = np.array([[-0.7, -0.18, 0.0], [0.64, -0.18, 0.0], [-0.7, 0.2, 0.0], [0.64, 0.2, 0.0]])
    tall = np.array([[0.06, 0.06, 0.42], [0.06, 0.06, 0.42], [0.06, 0.06, 0.85], [0.06, 0.06, 0.85]])
    builder.add_boxes(ORIGIN, legs, legs + tall, Material.METAL, _DARK)
    return builder.mesh()


def shelter() -> Mesh:
    """Return a bus shelter, four metres long, with a stop sign."""
    builder = Builder()
    posts = np.array([[-2.0, 0.55, 0.0], [1.92, 0.55, 0.0], [-2.0, -0.55, 0.0], [1.92, -0.55, 0.0]])
    builder.add_boxes(ORIGIN, posts, posts + np.array([0.08, 0.08, 2.35]), Material.METAL, _DARK)
    builder.add_boxes(ORIGIN, [-2.15, -0.85, 2.35], [2.15, 0.75, 2.47], Material.METAL, (84, 88, 90), sides="lrfbdt")
    builder.add_boxes(ORIGIN, [-1.9, 0.58, 0.25], [1.9, 0.61, 2.15], Material.GLASS, (150, 170, 172), sides="lrfbdt")
    builder.add_boxes(
        ORIGIN, [-1.98, -0.45, 0.25], [-1.95, 0.5, 2.15], Material.GLASS, (150, 170, 172), sides="lrfbdt"
    )
    builder.add_boxes(ORIGIN, [1.93, -0.5, 0.2], [2.03, 0.55, 2.1], Material.PLAIN, (196, 120, 58), sides="lrfbdt")
    builder.add_boxes(ORIGIN, [-1.5, 0.2, 0.43], [1.2, 0.5, 0.49], Material.PLAIN, _WOOD, sides="lrfbdt")
    legs = np.array([[-1.3, 0.3, 0.0], [0.95, 0.3, 0.0]])
    builder.add_boxes(ORIGIN, legs, legs + np.array([0.08, 0.1, 0.43]), Material.METAL, _DARK)
    builder.add_boxes(ORIGIN, [2.9, -0.35, 0.0], [2.97, -0.28, 2.9], Material.METAL, _STEEL)
    builder.add_boxes(ORIGIN, [2.68, -0.33, 2.35], [3.19, -0.3, 2.85], Material.SIGN, (226, 186, 40), sides="lrfbdt")
    return builder.mesh()


def power_box() -> Mesh:
    """Return a utility cabinet."""
    builder = Builder()
    builder.add_boxes(ORIGIN, [-0.45, -0.02, 0.0], [0.45, 0.36, 0.1], Material.CONCRETE, CONCRETE)
    builder.add_boxes(ORIGIN, [-0.42, 0.0, 0.1], [0.42, 0.34, 1.25], Material.PLAIN, (142, 150, 140))
    builder.add_boxes(ORIGIN, [-0.01, -0.012, 0.15], [0.01, 0.0, 1.2], Material.PLAIN, (96, 104, 96), sides="f")
    return builder.mesh()


def bollard() -> Mesh:
    """Return a bollard with a bright band."""
    low = post(0.78, 0.065, _DARK)
    band = np.array([0, 0, 0.78]), np.array([0, 0, 0.86])
    bright = tapered_rod(*band, (0.067, 0.067), 6, Material.SIGN, _WHITE)
    return join_meshes(
        [
            low,
            bright,
            tapered_rod(band[1], band[1] + [0, 0, 0.1], (0.067, 0.045), 6, Material.METAL, tint=_DARK, capped=True),
        ]
    )


def hydrant() -> Mesh:
    """Return a fire hydrant."""
    body = tapered_rod(np.zeros(3), np.array([0, 0, 0.6]), (0.12, 0.1), 6, Material.PLAIN, _RED, capped=True)
    builder = Builder()
    builder.add_boxes(ORIGIN, [-0.17, -0.06, 0.38], [0.17, 0.06, 0.5], Material.PLAIN, _RED, sides="lrfbdt")
    return join_meshes([body, builder.mesh()])


def letter_box() -> Mesh:
    """Return a letter box on a post."""
    builder = Builder()
    builder.add_boxes(ORIGIN, [-0.06, -0.06, 0.0], [0.06, 0.06, 0.75], Material.METAL, _DARK)
    builder.add_boxes(
        ORIGIN, [-0.24, -0.18, 0.75], [0.24, 0.18, 1.35], Material.PLAIN, (196, 150, 30), sides="lrfbdt"
    )
    return builder.mesh()


def planter() -> Mesh:
    """Return a planter."""
    builder = Builder()
    builder.add_boxes(ORIGIN, [-0.6, -0.3, 0.0], [0.6, 0.3, 0.5], Material.CONCRETE, CONCRETE)
    builder.add_boxes(ORIGIN, [-0.52, -0.22, 0.5], [0.52, 0.22, 0.85], Material.HEDGE, (84, 108, 56))
    return builder.mesh()


def billboard() -> Mesh:
    """Return a billboard of three by six metres on two legs; its image is a few plain areas."""
    builder = Builder()
    legs = np.array([[-2.2, 0.1, 0.0], [2.0, 0.1, 0.0]])
    builder.add_boxes(ORIGIN, legs, legs + np.array([0.2, 0.2, 2.6]), Material.METAL, _STEEL)
    builder.add_boxes(ORIGIN, [-3.1, -0.05, 2.3], [3.1, 0.1, 5.5], Material.METAL, (70, 72, 74), sides="lrfbdt")
    areas: tuple[tuple[float, float, float, float, Tint], ...] = (
        (-3.0, 3.0, 2.4, 5.4, (214, 206, 188)),
        (-3.0, -0.4, 2.4, 5.4, (52, 92, 124)),
        (0.1, 2.6, 4.4, 4.9, (46, 48, 52)),
        (0.1, 1.9, 3.8, 4.1, (120, 112, 102)),
        (-2.3, -1.1, 2.9, 4.6, (214, 158, 62)),
    )
    for number, (x0, x1, z0, z1, tint) in enumerate(areas):
        y = -0.06 - 0.01 * number
        builder.add_quads(ORIGIN, [[x0, y, z0], [x1, y, z0], [x1, y, z1], [x0, y, z1]], Material.PLAIN, tint)
    return builder.mesh()


LIMITS: dict[int, Callable[[], Mesh]] = {number: lambda n=number: limit_sign(n) for number in (30, 50, 60)}  # type: ignore[misc]
