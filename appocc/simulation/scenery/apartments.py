"""Apartment and office buildings: flat roofs, large windows, balconies, glazed ground floors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from appocc.simulation.mesh import Material
from appocc.simulation.scenery import palette
from appocc.simulation.scenery.builder import UNIT_UV, Builder
from appocc.simulation.scenery.facade import (
    Look,
    balconies,
    columns,
    rectangles,
    shop_floor,
    window_rows,
    windows_wall,
    with_door,
)
from appocc.simulation.scenery.palette import pick
from appocc.simulation.scenery.plots import Plot
from appocc.simulation.scenery.roofs import flat, rooftop
from appocc.simulation.scenery.spans import SIDES, Span, plain_side


def apartment_house(builder: Builder, plot: Plot, tag: int, rng: np.random.Generator, highest: int = 12) -> None:
    """Add an apartment or office building with at most `highest` storeys."""
    office = rng.random() < (0.35 if plot.arterial else 0.12)
    wall = (Material.CONCRETE, Material.PLASTER, Material.BRICK, Material.PLAIN)[
        int(rng.choice(4, p=(0.2, 0.4, 0.2, 0.2)))
    ]
    tints = {
        Material.CONCRETE: palette.CONCRETES,
        Material.PLASTER: palette.PLASTERS,
        Material.BRICK: palette.BRICKS,
        Material.PLAIN: palette.PANELS,
    }[wall]
    high = (
        rng.choice((4, 5, 6, 8, 10, 12), p=(0.2, 0.25, 0.25, 0.15, 0.1, 0.05))
        if plot.arterial
        else rng.choice((3, 4, 5, 6))
    )
    look = Look(
        wall=wall,
        wall_tint=pick(rng, tints),
        trim=pick(rng, palette.CONCRETES),
        frame=pick(rng, palette.DARK_FRAMES),
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
        shop_floor(builder, place, length, look, pick(rng, palette.DARK_FRAMES), None, stall=False)
        upper = window_rows(look.floors_m(1), look, len(s))
        windows_wall(builder, place, length, (look.ground_m, look.eaves_m), s, upper, look, True)
    else:
        z = window_rows(look.floors_m(), look, len(s))
        doors = with_door(z, len(s) // 2, 2.6) if len(s) else None
        windows_wall(builder, place, length, (0.0, look.eaves_m), s, z, look, detailed, doors)
    for name, closed in (("right", not plot.open_right), ("left", not plot.open_left), ("back", False)):
        plain_side(builder, main, name, look, closed)
    if detailed and not office and len(s) > 1 and rng.random() < 0.75:
        every = s[int(rng.integers(2)) :: 2]
        balconies(builder, place, every, look.floors_m(1), pick(rng, palette.METALS + palette.PANELS), look)
    if detailed and not office and rng.random() < 0.4:
        _accent(builder, main, look, rng)
    flat(builder, main, float(rng.uniform(0.5, 1.1)), look, palette.LEAD)
    if set_back:
        top = replace(look, wall=Material.PLAIN, wall_tint=pick(rng, palette.PANELS), storeys=look.storeys + 1)
        pent = Span(plot.place, 1.8, plot.width_m - 1.8, 2.0, plot.depth_m - 1.5, look.eaves_m + top_floor)
        _raised(builder, pent, look.eaves_m, top)
        flat(builder, pent, 0.2, top, palette.LEAD)
        rooftop(builder, pent, top, rng)
    else:
        rooftop(builder, main, look, rng)


def _accent(builder: Builder, main: Span, look: Look, rng: np.random.Generator) -> None:
    """Add a stair tower of another colour, slightly in front of the facade and above the roof."""
    place, length = main.side("front")
    width = 2.4
    s = 0.4 if rng.random() < 0.5 else length - width - 0.4
    other = replace(look, wall=Material.PLAIN, wall_tint=pick(rng, palette.PANELS))
    top = look.eaves_m + 1.6
    high = [s + width, 2.5, top]
    builder.boxes(place, [s, -0.25, look.ground_m], high, other.wall, other.wall_tint, look.tag, "lrfbdt")
    floors = look.floors_m(1)
    panes = np.stack(
        [np.full_like(floors, s + 0.5), np.full_like(floors, s + width - 0.5), floors + 0.3, floors + 2.6], axis=1
    )
    builder.quads(place, rectangles(panes, -0.28), Material.WINDOW, look.frame, look.tag, UNIT_UV)


def _raised(builder: Builder, span: Span, z_m: float, look: Look) -> None:
    """Add the walls of a storey on a roof."""
    for name in SIDES:
        place, length = span.side(name)
        s = columns(length, look, 0.8)
        z = window_rows(np.array([z_m]), look, len(s))
        windows_wall(builder, place, length, (z_m, span.eaves_m), s, z, look, False)
