"""Buildings on their plots, by style."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from appocc.simulation.mesh import Material
from appocc.simulation.scenery import palette
from appocc.simulation.scenery.builder import UNIT_UV, Builder, Tint
from appocc.simulation.scenery.facade import (
    Look,
    balconies,
    band,
    columns,
    plain_wall,
    rectangles,
    shop_floor,
    window_rows,
    windows_wall,
)
from appocc.simulation.scenery.plots import Plot
from appocc.simulation.scenery.roofs import Span, chimney, dormers, flat, gable, hip, rooftop, saw_teeth

_SIDES = ("front", "right", "back", "left")


def build_houses(builder: Builder, plots: Sequence[Plot], style: str, rng: np.random.Generator) -> None:
    """Add a building to every plot; its faces are tagged with its number."""
    makers = {"old": _old, "modern": _modern, "suburb": _suburb, "industrial": _industrial}
    for tag, plot in enumerate(plots):
        makers[style](builder, plot, tag, rng)


def _pick(rng: np.random.Generator, tints: Sequence[Tint]) -> Tint:
    """One of the colours, a little lighter or darker."""
    tint = tints[int(rng.integers(len(tints)))]
    shade = float(rng.uniform(0.93, 1.06))
    red, green, blue = (min(255, round(c * shade)) for c in tint)
    return red, green, blue


def _old(builder: Builder, plot: Plot, tag: int, rng: np.random.Generator) -> None:
    if plot.width_m > 11 and rng.random() < 0.06 and not plot.backland:
        _modern(builder, plot, tag, rng)
        return
    _terrace(builder, plot, _old_look(plot, tag, rng), rng)


def _old_look(plot: Plot, tag: int, rng: np.random.Generator) -> Look:
    brick = rng.random() < 0.42
    tall = rng.random() < 0.75
    return Look(
        wall=Material.BRICK if brick else Material.PLASTER,
        wall_tint=_pick(rng, palette.BRICKS if brick else palette.PLASTERS),
        trim=_pick(rng, palette.TRIMS),
        frame=_pick(rng, palette.FRAMES),
        door=_pick(rng, palette.DOORS),
        bay_m=float(rng.uniform(2.3, 3.1)),
        window_m=(float(rng.uniform(1.0, 1.3)), float(rng.uniform(1.6, 1.95) if tall else rng.uniform(1.3, 1.5))),
        sill_m=0.72 if tall else 0.95,
        ground_m=float(rng.uniform(3.6, 4.2) if plot.arterial else rng.uniform(3.1, 3.6)),
        storey_m=float(rng.uniform(2.95, 3.3)),
        storeys=int(rng.choice((3, 4, 5), p=(0.35, 0.45, 0.2)) if plot.arterial else rng.choice((2, 3, 4), p=(0.3, 0.5, 0.2))),
        recess_m=0.16,
        sills=rng.random() < 0.75,
        tag=tag,
    )


def _terrace(builder: Builder, plot: Plot, look: Look, rng: np.random.Generator) -> None:
    wing = not plot.backland and plot.width_m > 7 and rng.random() < 0.4
    depth = plot.depth_m - (3.0 if wing else 0.0)
    main = Span(plot.place, 0.0, plot.width_m, 0.0, depth, look.eaves_m)
    shop = not plot.backland and rng.random() < (0.75 if plot.arterial else 0.07)
    _old_front(builder, plot, main, look, shop, rng)
    for name, closed in (("right", not plot.open_right), ("left", not plot.open_left), ("back", False)):
        _plain_side(builder, main, name, look, closed)
    if wing:
        low = replace(look, storeys=max(1, look.storeys - 1))
        start = rng.uniform(0.0, 0.45) * plot.width_m
        rear = Span(plot.place, start, start + 0.5 * plot.width_m, depth, plot.depth_m, low.eaves_m)
        for name in ("right", "back", "left"):
            _plain_side(builder, rear, name, low, name != "back")
        flat(builder, rear, 0.3, low, palette.STONE)
    _old_roof(builder, plot, main, look, rng)


def _old_front(
    builder: Builder, plot: Plot, main: Span, look: Look, shop: bool, rng: np.random.Generator
) -> None:
    place, length = main.side("front")
    s = columns(length, look)
    if shop:
        awning = _pick(rng, palette.AWNINGS) if rng.random() < 0.5 else None
        shop_floor(builder, place, length, look, _pick(rng, palette.FASCIAS), awning)
        upper = window_rows(look.floors_m(1), look, len(s))
        windows_wall(builder, place, length, (look.ground_m, look.eaves_m), s, upper, look, True)
    else:
        z = window_rows(look.floors_m(), look, len(s))
        doors = np.zeros(z.shape[:2], np.bool_)
        if len(s):
            door = int(rng.integers(len(s)))
            doors[0, door], z[0, door] = True, (0.04, 2.3)
        windows_wall(builder, place, length, (0.0, look.eaves_m), s, z, look, not plot.backland, doors)
        if look.wall == Material.PLASTER and not plot.backland:
            builder.boxes(place, [0, -0.04, 0], [length, 0.0, 0.4], Material.CONCRETE, palette.STONE, look.tag, "ft")
    if not plot.backland:
        band(builder, place, length, look.eaves_m - 0.3, 0.3, 0.22, look)
        if rng.random() < 0.6:
            band(builder, place, length, look.ground_m - 0.1, 0.2, 0.08, look)


def _plain_side(builder: Builder, span: Span, name: str, look: Look, closed: bool, first_floor: int = 0) -> None:
    """A wall with panes before it, or without if it is closed."""
    place, length = span.side(name)
    # Backs and sides are seen from afar, through gaps: fewer windows do.
    s = np.zeros((0, 2)) if closed else columns(length, replace(look, bay_m=1.35 * look.bay_m), 0.8)
    z = window_rows(look.floors_m(first_floor), look, len(s))
    windows_wall(builder, place, length, (0.0, span.eaves_m), s, z, look, False)


def _old_roof(builder: Builder, plot: Plot, main: Span, look: Look, rng: np.random.Generator) -> None:
    tint = _pick(rng, palette.TILES)
    if rng.random() < 0.12:
        flat(builder, main, 0.7, look, look.trim)
        return
    pitch = float(rng.uniform(0.62, 0.86))
    top = gable(builder, main, pitch, tint, look, 0.3)
    bricks = _pick(rng, palette.BRICKS)
    if rng.random() < 0.75:
        chimney(builder, main, main.s0 + 0.5, (main.d0 + main.d1) / 2 + rng.uniform(-1.5, 1.5), top + 0.9, bricks, look)
    if rng.random() < 0.45 and not plot.backland:
        dormers(builder, main, int(plot.width_m / 4.2), pitch, tint, look)


def _modern(builder: Builder, plot: Plot, tag: int, rng: np.random.Generator, highest: int = 12) -> None:
    office = rng.random() < (0.35 if plot.arterial else 0.12)
    wall = (Material.CONCRETE, Material.PLASTER, Material.BRICK, Material.PLAIN)[int(rng.choice(4, p=(0.2, 0.4, 0.2, 0.2)))]
    tints = {
        Material.CONCRETE: palette.CONCRETES,
        Material.PLASTER: palette.PLASTERS,
        Material.BRICK: palette.BRICKS,
        Material.PLAIN: palette.PANELS,
    }[wall]
    high = rng.choice((4, 5, 6, 8, 10, 12), p=(0.2, 0.25, 0.25, 0.15, 0.1, 0.05)) if plot.arterial else rng.choice((3, 4, 5, 6))
    look = Look(
        wall=wall,
        wall_tint=_pick(rng, tints),
        trim=_pick(rng, palette.CONCRETES),
        frame=_pick(rng, palette.DARK_FRAMES),
        door=(58, 60, 64),
        bay_m=float(rng.uniform(2.3, 2.8) if office else rng.uniform(3.3, 4.3)),
        window_m=(2.1, 2.1) if office else (float(rng.uniform(1.7, 2.7)), float(rng.uniform(1.5, 2.2))),
        sill_m=0.75 if office else 0.55,
        ground_m=float(rng.uniform(3.8, 4.6)),
        storey_m=3.5 if office else float(rng.uniform(2.95, 3.15)),
        storeys=min(int(high), highest, 4 if plot.width_m < 11 else 6 if plot.width_m < 15 else 12),
        recess_m=0.14 if office else 0.22,
        sills=False,
        tag=tag,
    )
    _apartments(builder, plot, look, office, rng)


def _apartments(builder: Builder, plot: Plot, look: Look, office: bool, rng: np.random.Generator) -> None:
    set_back = look.storeys >= 4 and rng.random() < 0.45
    top_floor = 3.0 if set_back else 0.0
    main = Span(plot.place, 0.0, plot.width_m, 0.0, plot.depth_m, look.eaves_m)
    place, length = main.side("front")
    s = columns(length, look)
    detailed = not plot.backland
    if detailed and rng.random() < (0.85 if plot.arterial or office else 0.4):
        shop_floor(builder, place, length, look, _pick(rng, palette.DARK_FRAMES), None, stall=False)
        upper = window_rows(look.floors_m(1), look, len(s))
        windows_wall(builder, place, length, (look.ground_m, look.eaves_m), s, upper, look, True)
    else:
        z = window_rows(look.floors_m(), look, len(s))
        doors = np.zeros(z.shape[:2], np.bool_)
        if len(s):
            doors[0, len(s) // 2], z[0, len(s) // 2] = True, (0.04, 2.6)
        windows_wall(builder, place, length, (0.0, look.eaves_m), s, z, look, detailed, doors)
    for name, closed in (("right", not plot.open_right), ("left", not plot.open_left), ("back", False)):
        _plain_side(builder, main, name, look, closed, 0)
    if detailed and not office and len(s) > 1 and rng.random() < 0.75:
        every = s[int(rng.integers(2)) :: 2]
        balconies(builder, place, every, look.floors_m(1), _pick(rng, palette.METALS + palette.PANELS), look)
    if detailed and not office and rng.random() < 0.4:
        _accent(builder, main, look, rng)
    flat(builder, main, float(rng.uniform(0.5, 1.1)), look, palette.LEAD)
    if set_back:
        top = replace(look, wall=Material.PLAIN, wall_tint=_pick(rng, palette.PANELS), storeys=look.storeys + 1)
        pent = Span(plot.place, 1.8, plot.width_m - 1.8, 2.0, plot.depth_m - 1.5, look.eaves_m + top_floor)
        _raised(builder, pent, look.eaves_m, top)
        flat(builder, pent, 0.2, top, palette.LEAD)
        rooftop(builder, pent, top, rng)
    else:
        rooftop(builder, main, look, rng)


def _accent(builder: Builder, main: Span, look: Look, rng: np.random.Generator) -> None:
    """A stair tower of another colour that stands a little out of the front and above the roof."""
    place, length = main.side("front")
    width = 2.4
    s = 0.4 if rng.random() < 0.5 else length - width - 0.4
    other = replace(look, wall=Material.PLAIN, wall_tint=_pick(rng, palette.PANELS))
    top = look.eaves_m + 1.6
    high = [s + width, 2.5, top]
    builder.boxes(place, [s, -0.25, look.ground_m], high, other.wall, other.wall_tint, look.tag, "lrfbdt")
    floors = look.floors_m(1)
    panes = np.stack([np.full_like(floors, s + 0.5), np.full_like(floors, s + width - 0.5), floors + 0.3, floors + 2.6], axis=1)
    builder.quads(place, rectangles(panes, -0.28), Material.WINDOW, look.frame, look.tag, UNIT_UV)


def _raised(builder: Builder, span: Span, z_m: float, look: Look) -> None:
    """Walls of a storey on a roof."""
    for name in _SIDES:
        place, length = span.side(name)
        s = columns(length, look, 0.8)
        z = window_rows(np.array([z_m]), look, len(s))
        windows_wall(builder, place, length, (z_m, span.eaves_m), s, z, look, False)


def _suburb(builder: Builder, plot: Plot, tag: int, rng: np.random.Generator) -> None:
    if plot.arterial and plot.width_m > 11 and rng.random() < 0.15 and not plot.backland:
        _modern(builder, replace(plot, arterial=False), tag, rng, 3)
        return
    kind = int(rng.integers(3))
    wall = (Material.PLASTER, Material.BRICK, Material.PLAIN)[kind]
    look = Look(
        wall=wall,
        wall_tint=_pick(rng, (palette.PLASTERS, palette.BRICKS, palette.SIDINGS)[kind]),
        trim=_pick(rng, palette.TRIMS),
        frame=_pick(rng, palette.FRAMES[:2]),
        door=_pick(rng, palette.DOORS),
        bay_m=float(rng.uniform(2.8, 3.4)),
        window_m=(float(rng.uniform(1.2, 1.7)), float(rng.uniform(1.2, 1.45))),
        sill_m=0.85,
        ground_m=2.8,
        storey_m=2.7,
        storeys=1 if rng.random() < 0.35 else 2,
        recess_m=0.1,
        sills=True,
        tag=tag,
    )
    _detached(builder, plot, look, rng)


def _detached(builder: Builder, plot: Plot, look: Look, rng: np.random.Generator) -> None:
    garage = plot.width_m > 11 and rng.random() < 0.75
    split = plot.width_m - (3.6 if garage else 0.0)
    wing = rng.random() < 0.5
    front = 1.6 if wing else 0.0
    main = Span(plot.place, 0.0, split, front, plot.depth_m, look.eaves_m)
    detailed = not plot.backland
    place, length = main.side("front")
    s = columns(length, look, 0.7)
    z = window_rows(look.floors_m(), look, len(s))
    doors = np.zeros(z.shape[:2], np.bool_)
    door = len(s) - 1
    doors[0, door], z[0, door] = True, (0.04, 2.15)
    windows_wall(builder, place, length, (0.0, look.eaves_m), s, z, look, detailed, doors)
    for name in ("right", "back", "left"):
        _plain_side(builder, main, name, look, False)
    tint, pitch = _pick(rng, palette.SHINGLES + palette.TILES[:4]), float(rng.uniform(0.45, 0.75))
    kind = rng.random()
    if kind < 0.4 and length > plot.depth_m - front:
        top = hip(builder, main, pitch, tint, look)
    elif kind < 0.75 or wing:
        top = gable(builder, main, pitch, tint, look, 0.4, 0.3)
    else:
        top = gable(builder, main.turned(), pitch, tint, look, 0.4, 0.3)
    if rng.random() < 0.55:
        chimney(builder, main, main.s0 + 1.2, (main.d0 + main.d1) / 2, top + 0.6, _pick(rng, palette.BRICKS), look)
    if detailed:
        _porch(builder, main, float(s[door].mean()), look, tint)
    if wing:
        bay = Span(plot.place, 0.0, min(4.2, 0.42 * split), 0.0, front + 2.0, look.eaves_m)
        _front_wing(builder, bay, look, pitch, tint)
    if garage:
        _garage(builder, Span(plot.place, split, plot.width_m, 2.2, min(plot.depth_m, 8.2), 2.6), look, pitch, tint)


def _porch(builder: Builder, main: Span, s: float, look: Look, tint: Tint) -> None:
    """A little roof over the door, on two posts, and a step."""
    d = main.d0
    builder.boxes(main.place, [s - 1.0, d - 1.2, 2.45], [s + 1.0, d, 2.6], Material.PLAIN, look.trim, look.tag, "lrfdt")
    posts = np.array([[s - 0.95, d - 1.15, 0.0], [s + 0.83, d - 1.15, 0.0]])
    builder.boxes(main.place, posts, posts + [0.12, 0.12, 2.45], Material.PLAIN, look.trim, look.tag, "lrfb")
    slope = [[s + 1.0, d, 3.0], [s - 1.0, d, 3.0], [s - 1.0, d - 1.2, 2.6], [s + 1.0, d - 1.2, 2.6]]
    builder.quads(main.place, slope, Material.ROOF_TILES, tint, look.tag)
    cheeks = [
        [[s + 1.0, d - 1.2, 2.6], [s + 1.0, d, 2.6], [s + 1.0, d, 3.0]],
        [[s - 1.0, d, 2.6], [s - 1.0, d - 1.2, 2.6], [s - 1.0, d, 3.0]],
    ]
    builder.triangles(main.place, cheeks, Material.PLAIN, look.trim, look.tag)
    builder.boxes(main.place, [s - 0.9, d - 1.0, 0], [s + 0.9, d, 0.14], Material.CONCRETE, palette.CONCRETE, look.tag)


def _front_wing(builder: Builder, bay: Span, look: Look, pitch_rad: float, tint: Tint) -> None:
    """A part that stands forward with its gable to the street."""
    place, length = bay.side("front")
    s = np.array([[length / 2 - 0.95, length / 2 + 0.95]])
    z = window_rows(look.floors_m(), look, 1)
    windows_wall(builder, place, length, (0.0, look.eaves_m), s, z, look, True)
    for name in ("left", "right"):
        side, length = bay.side(name)
        plain_wall(builder, side, np.array([[0.0, length, 0.0, look.eaves_m]]), look.wall, look.wall_tint, look.tag)
    gable(builder, bay.turned(), pitch_rad, tint, look, 0.3, 0.3)


def _garage(builder: Builder, span: Span, look: Look, pitch_rad: float, tint: Tint) -> None:
    place, length = span.side("front")
    door = np.array([[length / 2 - 1.3, length / 2 + 1.3]])
    shut = replace(look, door=look.trim, storeys=1, sills=False)
    windows_wall(
        builder, place, length, (0.0, span.eaves_m), door, np.array([[[0.02, 2.15]]]), shut, True, np.ones((1, 1), np.bool_)
    )
    for name in ("right", "back"):
        _plain_side(builder, span, name, shut, True)
    gable(builder, span.turned(), min(pitch_rad, 0.5), tint, shut, 0.25, 0.25)


def _industrial(builder: Builder, plot: Plot, tag: int, rng: np.random.Generator) -> None:
    wall = (Material.METAL, Material.CONCRETE, Material.BRICK)[int(rng.choice(3, p=(0.55, 0.3, 0.15)))]
    tints = palette.BRICKS if wall == Material.BRICK else palette.HALLS
    look = Look(
        wall=wall,
        wall_tint=_pick(rng, tints),
        trim=_pick(rng, palette.TRIMS),
        frame=_pick(rng, palette.DARK_FRAMES),
        door=_pick(rng, palette.METALS + palette.AWNINGS),
        bay_m=float(rng.uniform(4.0, 5.5)),
        window_m=(float(rng.uniform(2.0, 3.4)), 1.1),
        sill_m=float(rng.uniform(3.6, 4.4)),
        ground_m=float(rng.uniform(6.5, 10.0)),
        storey_m=3.2,
        storeys=1,
        recess_m=0.12,
        sills=False,
        tag=tag,
    )
    office = not plot.backland and plot.width_m > 24 and rng.random() < 0.5
    front = 5.0 if office else 0.0
    main = Span(plot.place, 0.0, plot.width_m, front, plot.depth_m, look.eaves_m)
    place, length = main.side("front")
    s = columns(length, look)
    z = np.concatenate([np.broadcast_to([0.03, 3.4], (1, len(s), 2)), window_rows(look.floors_m(), look, len(s))])
    gates = np.arange(len(s)) % 3 == int(rng.integers(3))
    z[0, ~gates] = z[1, ~gates, :1]
    doors = np.zeros(z.shape[:2], np.bool_)
    doors[0] = True
    windows_wall(builder, place, length, (0.0, look.eaves_m), s, z, look, not plot.backland, doors)
    for name in ("right", "back", "left"):
        _plain_side(builder, main, name, look, False)
    if not plot.backland:
        _hall_ribs(builder, main, look, rng)
    _hall_roof(builder, main, look, rng)
    if office:
        _office(builder, plot, look, rng)


def _hall_ribs(builder: Builder, main: Span, look: Look, rng: np.random.Generator) -> None:
    """A plinth, a coloured band under the eaves, and posts that divide the walls."""
    stripe = _pick(rng, palette.AWNINGS + palette.METALS)
    for name in _SIDES:
        place, length = main.side(name)
        s = columns(length, look)
        builder.boxes(place, [-0.06, -0.06, 0.0], [length + 0.06, 0.0, 0.55], Material.CONCRETE, palette.CONCRETE, look.tag, "lrft")
        low = [-0.05, -0.05, look.eaves_m - 0.9], [length + 0.05, 0.0, look.eaves_m - 0.25]
        builder.boxes(place, *low, Material.PLAIN, stripe, look.tag, "lrfdt")
        if len(s) > 1:
            between = (s[1:, 0] + s[:-1, 1]) / 2
            low = np.stack([between - 0.15, np.full_like(between, -0.12), np.zeros_like(between)], axis=1)
            builder.boxes(place, low, low + [0.3, 0.12, look.eaves_m], look.wall, look.wall_tint, look.tag, "lrf")


def _hall_roof(builder: Builder, main: Span, look: Look, rng: np.random.Generator) -> None:
    kind, sheet = rng.random(), _pick(rng, palette.METALS[2:] + palette.HALLS[:3])
    if kind < 0.4:
        saw_teeth(builder, main, float(rng.uniform(5.5, 8.0)), 2.4, sheet, look)
    elif kind < 0.75:
        flat(builder, main, 0.8, look, palette.LEAD)
        rooftop(builder, main, look, rng)
    else:
        gable(builder, main.turned(), 0.2, sheet, look, 0.2, 0.1)


def _office(builder: Builder, plot: Plot, hall: Look, rng: np.random.Generator) -> None:
    """Two storeys of offices before a hall."""
    look = replace(
        hall,
        wall=Material.PLASTER,
        wall_tint=_pick(rng, palette.PLASTERS),
        bay_m=2.6,
        window_m=(1.7, 1.5),
        sill_m=0.85,
        ground_m=3.3,
        storeys=2,
    )
    start = 0.0 if rng.random() < 0.5 else plot.width_m - 12.0
    span = Span(plot.place, start, start + 12.0, 0.0, 5.0, look.eaves_m)
    place, length = span.side("front")
    s = columns(length, look)
    z = window_rows(look.floors_m(), look, len(s))
    doors = np.zeros(z.shape[:2], np.bool_)
    doors[0, 1], z[0, 1] = True, (0.04, 2.3)
    windows_wall(builder, place, length, (0.0, look.eaves_m), s, z, look, True, doors)
    for name in ("left", "right"):
        _plain_side(builder, span, name, look, False)
    flat(builder, span, 0.5, look, palette.LEAD)
