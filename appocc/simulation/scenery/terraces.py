"""Terraced houses of an old town: brick or plaster, shops, tiled roofs with dormers and chimneys."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from appocc.simulation.mesh import Material
from appocc.simulation.scenery import palette
from appocc.simulation.scenery.apartments import apartment_house
from appocc.simulation.scenery.builder import Builder
from appocc.simulation.scenery.facade import (
    Look,
    band,
    columns,
    shop_floor,
    window_rows,
    windows_wall,
    with_door,
)
from appocc.simulation.scenery.palette import pick
from appocc.simulation.scenery.plots import Plot
from appocc.simulation.scenery.roofs import chimney, dormers, flat, gable
from appocc.simulation.scenery.spans import Span, plain_side


def town_house(builder: Builder, plot: Plot, tag: int, rng: np.random.Generator) -> None:
    """Add a terraced house, rarely an apartment building."""
    if plot.width_m > 11 and rng.random() < 0.06 and not plot.backland:
        apartment_house(builder, plot, tag, rng)
        return
    _terrace(builder, plot, _old_look(plot, tag, rng), rng)


def _old_look(plot: Plot, tag: int, rng: np.random.Generator) -> Look:
    brick = rng.random() < 0.42
    tall = rng.random() < 0.75
    return Look(
        wall=Material.BRICK if brick else Material.PLASTER,
        wall_tint=pick(rng, palette.BRICKS if brick else palette.PLASTERS),
        trim=pick(rng, palette.TRIMS),
        frame=pick(rng, palette.FRAMES),
        door=pick(rng, palette.DOORS),
        bay_m=float(rng.uniform(2.3, 3.1)),
        window_m=(float(rng.uniform(1.0, 1.3)), float(rng.uniform(1.6, 1.95) if tall else rng.uniform(1.3, 1.5))),
        sill_m=0.72 if tall else 0.95,
        ground_m=float(rng.uniform(3.6, 4.2) if plot.arterial else rng.uniform(3.1, 3.6)),
        storey_m=float(rng.uniform(2.95, 3.3)),
        storeys=int(
            rng.choice((3, 4, 5), p=(0.35, 0.45, 0.2)) if plot.arterial else rng.choice((2, 3, 4), p=(0.3, 0.5, 0.2))
        ),
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
        plain_side(builder, main, name, look, closed)
    if wing:
        low = replace(look, storeys=max(1, look.storeys - 1))
        start = rng.uniform(0.0, 0.45) * plot.width_m
        rear = Span(plot.place, start, start + 0.5 * plot.width_m, depth, plot.depth_m, low.eaves_m)
        for name in ("right", "back", "left"):
            plain_side(builder, rear, name, low, name != "back")
        flat(builder, rear, 0.3, low, palette.STONE)
    _old_roof(builder, plot, main, look, rng)


def _old_front(builder: Builder, plot: Plot, main: Span, look: Look, shop: bool, rng: np.random.Generator) -> None:
    place, length = main.side("front")
    s = columns(length, look)
    if shop:
        awning = pick(rng, palette.AWNINGS) if rng.random() < 0.5 and plot.road_m > 2.0 else None
        shop_floor(builder, place, length, look, pick(rng, palette.FASCIAS), awning)
        upper = window_rows(look.floors_m(1), look, len(s))
        windows_wall(builder, place, length, (look.ground_m, look.eaves_m), s, upper, look, True)
    else:
        z = window_rows(look.floors_m(), look, len(s))
        doors = with_door(z, int(rng.integers(len(s))), 2.3) if len(s) else None
        windows_wall(builder, place, length, (0.0, look.eaves_m), s, z, look, not plot.backland, doors)
        if look.wall == Material.PLASTER and not plot.backland:
            builder.boxes(place, [0, -0.04, 0], [length, 0.0, 0.4], Material.CONCRETE, palette.STONE, look.tag, "ft")
    if not plot.backland:
        band(builder, place, length, look.eaves_m - 0.3, 0.3, 0.22, look)
        if rng.random() < 0.6:
            band(builder, place, length, look.ground_m - 0.1, 0.2, 0.08, look)


def _old_roof(builder: Builder, plot: Plot, main: Span, look: Look, rng: np.random.Generator) -> None:
    tint = pick(rng, palette.TILES)
    if rng.random() < 0.12:
        flat(builder, main, 0.7, look, look.trim)
        return
    pitch = float(rng.uniform(0.62, 0.86))
    top = gable(builder, main, pitch, tint, look, 0.3)
    bricks = pick(rng, palette.BRICKS)
    if rng.random() < 0.75:
        chimney(
            builder, main, main.s0 + 0.5, (main.d0 + main.d1) / 2 + rng.uniform(-1.5, 1.5), top + 0.9, bricks, look
        )
    if rng.random() < 0.45 and not plot.backland:
        dormers(builder, main, int(plot.width_m / 4.2), pitch, tint, look)
