"""Apartment and office buildings: flat roofs, large windows, balconies, glazed ground floors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from appocc.simulation.mesh import Material
from appocc.simulation.scenery import palette
from appocc.simulation.scenery.builder import UNIT_UV, Builder
from appocc.simulation.scenery.facade import (
    FacadeStyle,
    add_balconies,
    add_shop_floor,
    add_window_wall,
    place_door,
    upright_quads,
    window_columns,
    window_rows,
)
from appocc.simulation.scenery.palette import pick_tint
from appocc.simulation.scenery.plots import Plot
from appocc.simulation.scenery.roofs import add_flat_roof, add_roof_equipment
from appocc.simulation.scenery.spans import SIDES, BuildingPart, add_plain_side


def add_apartment_building(
    builder: Builder, plot: Plot, tag: int, rng: np.random.Generator, highest: int = 12
) -> None:
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
    style = FacadeStyle(
        wall=wall,
        wall_tint=pick_tint(rng, tints),
        trim=pick_tint(rng, palette.CONCRETES),
        window_frame=pick_tint(rng, palette.DARK_FRAMES),
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
    _build_apartments(builder, plot, style, office, rng)


def _build_apartments(
    builder: Builder, plot: Plot, style: FacadeStyle, office: bool, rng: np.random.Generator
) -> None:
    set_back = style.storeys >= 4 and rng.random() < 0.45
    top_floor = 3.0 if set_back else 0.0
    main = BuildingPart(plot.frame, 0.0, plot.width_m, 0.0, plot.depth_m, style.eaves_m)
    frame, length = main.side("front")
    s = window_columns(length, style)
    detailed = not plot.backland
    if detailed and rng.random() < (0.85 if plot.arterial or office else 0.4):
        add_shop_floor(builder, frame, length, style, pick_tint(rng, palette.DARK_FRAMES), None, stall=False)
        upper = window_rows(style.floors_m(1), style, len(s))
        add_window_wall(builder, frame, length, (style.ground_m, style.eaves_m), s, upper, style=style, detailed=True)
    else:
        z = window_rows(style.floors_m(), style, len(s))
        doors = place_door(z, len(s) // 2, 2.6) if len(s) else None
        add_window_wall(
            builder, frame, length, (0.0, style.eaves_m), s, z, style=style, detailed=detailed, doors=doors
        )
    for name, closed in (("right", not plot.open_right), ("left", not plot.open_left), ("back", False)):
        add_plain_side(builder, main, name, style, closed)
    if detailed and not office and len(s) > 1 and rng.random() < 0.75:
        every = s[int(rng.integers(2)) :: 2]
        add_balconies(
            builder, frame, every, style.floors_m(1), pick_tint(rng, palette.METALS + palette.PANELS), style
        )
    if detailed and not office and rng.random() < 0.4:
        _add_stair_tower(builder, main, style, rng)
    add_flat_roof(builder, main, float(rng.uniform(0.5, 1.1)), style, palette.LEAD)
    if set_back:
        top = replace(style, wall=Material.PLAIN, wall_tint=pick_tint(rng, palette.PANELS), storeys=style.storeys + 1)
        pent = BuildingPart(plot.frame, 1.8, plot.width_m - 1.8, 2.0, plot.depth_m - 1.5, style.eaves_m + top_floor)
        _add_storey_walls(builder, pent, style.eaves_m, top)
        add_flat_roof(builder, pent, 0.2, top, palette.LEAD)
        add_roof_equipment(builder, pent, top, rng)
    else:
        add_roof_equipment(builder, main, style, rng)


def _add_stair_tower(builder: Builder, main: BuildingPart, style: FacadeStyle, rng: np.random.Generator) -> None:
    """Add a stair tower of another colour, slightly in front of the facade and above the roof."""
    frame, length = main.side("front")
    width = 2.4
    s = 0.4 if rng.random() < 0.5 else length - width - 0.4
    other = replace(style, wall=Material.PLAIN, wall_tint=pick_tint(rng, palette.PANELS))
    top = style.eaves_m + 1.6
    high = [s + width, 2.5, top]
    builder.add_boxes(
        frame, [s, -0.25, style.ground_m], high, other.wall, other.wall_tint, tag=style.tag, sides="lrfbdt"
    )
    floors = style.floors_m(1)
    panes = np.stack(
        [np.full_like(floors, s + 0.5), np.full_like(floors, s + width - 0.5), floors + 0.3, floors + 2.6], axis=1
    )
    builder.add_quads(frame, upright_quads(panes, -0.28), Material.WINDOW, style.window_frame, style.tag, UNIT_UV)


def _add_storey_walls(builder: Builder, span: BuildingPart, z_m: float, style: FacadeStyle) -> None:
    """Add the walls of a storey on a roof."""
    for name in SIDES:
        frame, length = span.side(name)
        s = window_columns(length, style, 0.8)
        z = window_rows(np.array([z_m]), style, len(s))
        add_window_wall(builder, frame, length, (z_m, span.eaves_m), s, z, style=style, detailed=False)
