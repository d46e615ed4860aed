"""Detached suburban houses: gabled and hipped roofs, porches, garages."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from appocc.simulation.mesh import Material
from appocc.simulation.scenery import palette
from appocc.simulation.scenery.apartments import add_apartment_building
from appocc.simulation.scenery.builder import Builder, Tint
from appocc.simulation.scenery.facade import (
    FacadeStyle,
    add_plain_wall,
    add_window_wall,
    place_door,
    window_columns,
    window_rows,
)
from appocc.simulation.scenery.palette import pick_tint
from appocc.simulation.scenery.plots import Plot
from appocc.simulation.scenery.roofs import add_chimney, add_gable_roof, add_hip_roof
from appocc.simulation.scenery.spans import BuildingPart, add_plain_side


def add_detached_house(builder: Builder, plot: Plot, tag: int, rng: np.random.Generator) -> None:
    """Add a house with its garage; on arterials sometimes a low apartment building."""
    if plot.arterial and plot.width_m > 11 and rng.random() < 0.15 and not plot.backland:
        add_apartment_building(builder, replace(plot, arterial=False), tag, rng, 3)
        return
    kind = int(rng.integers(3))
    wall = (Material.PLASTER, Material.BRICK, Material.PLAIN)[kind]
    style = FacadeStyle(
        wall=wall,
        wall_tint=pick_tint(rng, (palette.PLASTERS, palette.BRICKS, palette.SIDINGS)[kind]),
        trim=pick_tint(rng, palette.TRIMS),
        window_frame=pick_tint(rng, palette.FRAMES[:2]),
        door=pick_tint(rng, palette.DOORS),
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
    _build_house(builder, plot, style, rng)


def _build_house(builder: Builder, plot: Plot, style: FacadeStyle, rng: np.random.Generator) -> None:
    garage = plot.width_m > 11 and rng.random() < 0.75
    split = plot.width_m - (3.6 if garage else 0.0)
    wing = rng.random() < 0.5
    front = 1.6 if wing else 0.0
    main = BuildingPart(plot.frame, 0.0, split, front, plot.depth_m, style.eaves_m)
    detailed = not plot.backland
    frame, length = main.side("front")
    s = window_columns(length, style, 0.7)
    z = window_rows(style.floors_m(), style, len(s))
    door = len(s) - 1
    doors = place_door(z, door, 2.15)
    add_window_wall(builder, frame, length, (0.0, style.eaves_m), s, z, style=style, detailed=detailed, doors=doors)
    for name in ("right", "back", "left"):
        add_plain_side(builder, main, name, style, False)
    tint, pitch = pick_tint(rng, palette.SHINGLES + palette.TILES[:4]), float(rng.uniform(0.45, 0.75))
    kind = rng.random()
    if kind < 0.4 and length > plot.depth_m - front:
        top = add_hip_roof(builder, main, pitch, tint, style)
    elif kind < 0.75 or wing:
        top = add_gable_roof(builder, main, pitch, tint, style, eave_m=0.4, verge_m=0.3)
    else:
        top = add_gable_roof(builder, main.turned(), pitch, tint, style, eave_m=0.4, verge_m=0.3)
    if rng.random() < 0.55:
        add_chimney(
            builder,
            main,
            main.s0 + 1.2,
            (main.d0 + main.d1) / 2,
            top + 0.6,
            tint=pick_tint(rng, palette.BRICKS),
            style=style,
        )
    if detailed:
        _add_porch(builder, main, float(s[door].mean()), style, tint)
    if wing:
        bay = BuildingPart(plot.frame, 0.4, 0.4 + min(4.0, 0.4 * split), 0.0, front + 2.0, style.eaves_m)
        _add_front_wing(builder, bay, style, pitch, tint)
    if garage:
        _add_garage(
            builder,
            BuildingPart(plot.frame, split, plot.width_m, 2.2, min(plot.depth_m, 8.2), 2.6),
            style,
            pitch,
            tint,
        )


def _add_porch(builder: Builder, main: BuildingPart, s: float, style: FacadeStyle, tint: Tint) -> None:
    """Add a small roof above the door on two posts, and a step."""
    d = main.d0
    builder.add_boxes(
        main.frame,
        [s - 1.0, d - 1.2, 2.45],
        [s + 1.0, d, 2.6],
        Material.PLAIN,
        style.trim,
        tag=style.tag,
        sides="lrfdt",
    )
    posts = np.array([[s - 0.95, d - 1.15, 0.0], [s + 0.83, d - 1.15, 0.0]])
    builder.add_boxes(
        main.frame,
        posts,
        posts + np.array([0.12, 0.12, 2.45]),
        Material.PLAIN,
        style.trim,
        tag=style.tag,
        sides="lrfb",
    )
    slope = [[s + 1.0, d, 3.0], [s - 1.0, d, 3.0], [s - 1.0, d - 1.2, 2.6], [s + 1.0, d - 1.2, 2.6]]
    builder.add_quads(main.frame, slope, Material.ROOF_TILES, tint, style.tag)
    cheeks = [
        [[s + 1.0, d - 1.2, 2.6], [s + 1.0, d, 2.6], [s + 1.0, d, 3.0]],
        [[s - 1.0, d, 2.6], [s - 1.0, d - 1.2, 2.6], [s - 1.0, d, 3.0]],
    ]
    builder.add_triangles(main.frame, cheeks, Material.PLAIN, style.trim, style.tag)
    builder.add_boxes(
        main.frame, [s - 0.9, d - 1.0, 0], [s + 0.9, d, 0.14], Material.CONCRETE, palette.CONCRETE, style.tag
    )


def _add_front_wing(builder: Builder, bay: BuildingPart, style: FacadeStyle, pitch_rad: float, tint: Tint) -> None:
    """Add a front wing whose gable faces the street."""
    frame, length = bay.side("front")
    s = np.array([[length / 2 - 0.95, length / 2 + 0.95]])
    z = window_rows(style.floors_m(), style, 1)
    add_window_wall(builder, frame, length, (0.0, style.eaves_m), s, z, style=style, detailed=True)
    for name in ("left", "right"):
        side, length = bay.side(name)
        add_plain_wall(
            builder, side, np.array([[0.0, length, 0.0, style.eaves_m]]), style.wall, style.wall_tint, style.tag
        )
    add_gable_roof(builder, bay.turned(), pitch_rad, tint, style, eave_m=0.3, verge_m=0.3)


def _add_garage(builder: Builder, part: BuildingPart, style: FacadeStyle, pitch_rad: float, tint: Tint) -> None:
    frame, length = part.side("front")
    door = np.array([[length / 2 - 1.3, length / 2 + 1.3]])
    shut = replace(style, door=style.trim, storeys=1, sills=False)
    add_window_wall(
        builder,
        frame,
        length,
        (0.0, part.eaves_m),
        door,
        np.array([[[0.02, 2.15]]]),
        style=shut,
        detailed=True,
        doors=np.ones((1, 1), np.bool_),
    )
    for name in ("right", "back"):
        add_plain_side(builder, part, name, shut, True)
    add_gable_roof(builder, part.turned(), min(pitch_rad, 0.5), tint, shut, eave_m=0.25, verge_m=0.25)
