"""Terraced houses of an old town: brick or plaster, shops, tiled roofs with dormers and chimneys."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from appocc.simulation.mesh import Material
from appocc.simulation.scenery import palette
from appocc.simulation.scenery.apartments import add_apartment_building
from appocc.simulation.scenery.builder import Builder
from appocc.simulation.scenery.facade import (
    FacadeStyle,
    add_cornice,
    add_shop_floor,
    add_window_wall,
    place_door,
    window_columns,
    window_rows,
)
from appocc.simulation.scenery.palette import pick_tint
from appocc.simulation.scenery.plots import Plot
from appocc.simulation.scenery.roofs import add_chimney, add_dormers, add_flat_roof, add_gable_roof
from appocc.simulation.scenery.spans import BuildingPart, add_plain_side


def add_town_house(builder: Builder, plot: Plot, tag: int, rng: np.random.Generator) -> None:
    """Add a terraced house, rarely an apartment building."""
    if plot.width_m > 11 and rng.random() < 0.06 and not plot.backland:
        add_apartment_building(builder, plot, tag, rng)
        return
    _build_terrace(builder, plot, _draw_style(plot, tag, rng), rng)


def _draw_style(plot: Plot, tag: int, rng: np.random.Generator) -> FacadeStyle:
    brick = rng.random() < 0.42
    tall = rng.random() < 0.75
    return FacadeStyle(
        wall=Material.BRICK if brick else Material.PLASTER,
        wall_tint=pick_tint(rng, palette.BRICKS if brick else palette.PLASTERS),
        trim=pick_tint(rng, palette.TRIMS),
        window_frame=pick_tint(rng, palette.FRAMES),
        door=pick_tint(rng, palette.DOORS),
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


def _build_terrace(builder: Builder, plot: Plot, style: FacadeStyle, rng: np.random.Generator) -> None:
    wing = not plot.backland and plot.width_m > 7 and rng.random() < 0.4
    depth = plot.depth_m - (3.0 if wing else 0.0)
    main = BuildingPart(plot.frame, 0.0, plot.width_m, 0.0, depth, style.eaves_m)
    shop = not plot.backland and rng.random() < (0.75 if plot.arterial else 0.07)
    _add_front(builder, plot, main, style, shop, rng)
    for name, closed in (("right", not plot.open_right), ("left", not plot.open_left), ("back", False)):
        add_plain_side(builder, main, name, style, closed)
    if wing:
        low = replace(style, storeys=max(1, style.storeys - 1))
        start = rng.uniform(0.0, 0.45) * plot.width_m
        rear = BuildingPart(plot.frame, start, start + 0.5 * plot.width_m, depth, plot.depth_m, low.eaves_m)
        for name in ("right", "back", "left"):
            add_plain_side(builder, rear, name, low, name != "back")
        add_flat_roof(builder, rear, 0.3, low, palette.STONE)
    _add_roof(builder, plot, main, style, rng)


def _add_front(
    builder: Builder, plot: Plot, main: BuildingPart, style: FacadeStyle, shop: bool, rng: np.random.Generator
) -> None:
    frame, length = main.side("front")
    s = window_columns(length, style)
    if shop:
        awning = pick_tint(rng, palette.AWNINGS) if rng.random() < 0.5 and plot.road_m > 2.0 else None
        add_shop_floor(builder, frame, length, style, pick_tint(rng, palette.FASCIAS), awning)
        upper = window_rows(style.floors_m(1), style, len(s))
        add_window_wall(builder, frame, length, (style.ground_m, style.eaves_m), s, upper, style=style, detailed=True)
    else:
        z = window_rows(style.floors_m(), style, len(s))
        doors = place_door(z, int(rng.integers(len(s))), 2.3) if len(s) else None
        add_window_wall(
            builder, frame, length, (0.0, style.eaves_m), s, z, style=style, detailed=not plot.backland, doors=doors
        )
        if style.wall == Material.PLASTER and not plot.backland:
            builder.add_boxes(
                frame, [0, -0.04, 0], [length, 0.0, 0.4], Material.CONCRETE, palette.STONE, tag=style.tag, sides="ft"
            )
    if not plot.backland:
        add_cornice(builder, frame, length, style.eaves_m - 0.3, 0.3, out_m=0.22, style=style)
        if rng.random() < 0.6:
            add_cornice(builder, frame, length, style.ground_m - 0.1, 0.2, out_m=0.08, style=style)


def _add_roof(builder: Builder, plot: Plot, main: BuildingPart, style: FacadeStyle, rng: np.random.Generator) -> None:
    tint = pick_tint(rng, palette.TILES)
    if rng.random() < 0.12:
        add_flat_roof(builder, main, 0.7, style, style.trim)
        return
    pitch = float(rng.uniform(0.62, 0.86))
    top = add_gable_roof(builder, main, pitch, tint, style, 0.3)
    bricks = pick_tint(rng, palette.BRICKS)
    if rng.random() < 0.75:
        add_chimney(
            builder,
            main,
            main.s0 + 0.5,
            (main.d0 + main.d1) / 2 + rng.uniform(-1.5, 1.5),
            top + 0.9,
            tint=bricks,
            style=style,
        )
    if rng.random() < 0.45 and not plot.backland:
        add_dormers(builder, main, int(plot.width_m / 4.2), pitch, tint, style)
