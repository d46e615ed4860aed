"""Industrial buildings: saw-tooth, flat or low gabled roofs, gates, offices in front."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from appocc.checks import FloatArray
from appocc.simulation.mesh import Material
from appocc.simulation.scenery import palette
from appocc.simulation.scenery.builder import Builder
from appocc.simulation.scenery.facade import (
    FacadeStyle,
    add_window_wall,
    place_door,
    window_columns,
    window_rows,
)
from appocc.simulation.scenery.palette import pick_tint
from appocc.simulation.scenery.plots import Plot
from appocc.simulation.scenery.roofs import add_flat_roof, add_gable_roof, add_roof_equipment, add_saw_tooth_roof
from appocc.simulation.scenery.spans import SIDES, BuildingPart, add_plain_side, plain_window_columns


def add_industrial_building(builder: Builder, plot: Plot, tag: int, rng: np.random.Generator) -> None:
    """Add an industrial building; wide plots may have offices."""
    wall = (Material.METAL, Material.CONCRETE, Material.BRICK)[int(rng.choice(3, p=(0.55, 0.3, 0.15)))]
    tints = palette.BRICKS if wall == Material.BRICK else palette.INDUSTRIAL_WALLS
    style = FacadeStyle(
        wall=wall,
        wall_tint=pick_tint(rng, tints),
        trim=pick_tint(rng, palette.TRIMS),
        window_frame=pick_tint(rng, palette.DARK_FRAMES),
        door=pick_tint(rng, palette.METALS + palette.AWNINGS),
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
    main = BuildingPart(plot.frame, 0.0, plot.width_m, front, plot.depth_m, style.eaves_m)
    frame, length = main.side("front")
    s = window_columns(length, style)
    z = np.concatenate([np.broadcast_to([0.03, 3.4], (1, len(s), 2)), window_rows(style.floors_m(), style, len(s))])
    gates = np.arange(len(s)) % 3 == int(rng.integers(3))
    z[0, ~gates] = z[1, ~gates, :1]
    doors = np.zeros(z.shape[:2], np.bool_)
    doors[0] = True
    add_window_wall(
        builder, frame, length, (0.0, style.eaves_m), s, z, style=style, detailed=not plot.backland, doors=doors
    )
    for name in ("right", "back", "left"):
        add_plain_side(builder, main, name, style, False)
    if not plot.backland:
        _add_ribs(builder, main, style, s[gates], rng)
    _add_roof(builder, main, style, rng)
    if office:
        _add_office(builder, plot, style, rng)


def _add_ribs(
    builder: Builder, main: BuildingPart, style: FacadeStyle, gates: FloatArray, rng: np.random.Generator
) -> None:
    """Add a plinth with gaps at the front gates (n, 2), a band below the eaves, and posts between windows."""
    stripe = pick_tint(rng, palette.AWNINGS + palette.METALS)
    for name in SIDES:
        frame, length = main.side(name)
        front = name == "front"
        s = window_columns(length, style) if front else plain_window_columns(length, style)
        cut = np.concatenate([[-0.06], gates.ravel() if front else [], [length + 0.06]]).reshape(-1, 2)
        count = len(cut)
        low = np.stack([cut[:, 0], np.full(count, -0.06), np.zeros(count)], axis=1)
        high = np.stack([cut[:, 1], np.zeros(count), np.full(count, 0.55)], axis=1)
        builder.add_boxes(frame, low, high, Material.CONCRETE, palette.CONCRETE, tag=style.tag, sides="lrft")
        ends = [-0.05, -0.05, style.eaves_m - 0.9], [length + 0.05, 0.0, style.eaves_m - 0.25]
        builder.add_boxes(frame, *ends, Material.PLAIN, stripe, style.tag, "lrfdt")
        if len(s) > 1:
            between = (s[1:, 0] + s[:-1, 1]) / 2
            low = np.stack([between - 0.15, np.full_like(between, -0.12), np.zeros_like(between)], axis=1)
            builder.add_boxes(
                frame,
                low,
                low + np.array([0.3, 0.12, style.eaves_m]),
                style.wall,
                style.wall_tint,
                tag=style.tag,
                sides="lrf",
            )


def _add_roof(builder: Builder, main: BuildingPart, style: FacadeStyle, rng: np.random.Generator) -> None:
    kind, sheet = rng.random(), pick_tint(rng, palette.METALS[2:] + palette.INDUSTRIAL_WALLS[:3])
    if kind < 0.4:
        add_saw_tooth_roof(builder, main, float(rng.uniform(5.5, 8.0)), 2.4, sheet, style)
    elif kind < 0.75:
        add_flat_roof(builder, main, 0.8, style, palette.LEAD)
        add_roof_equipment(builder, main, style, rng)
    else:
        add_gable_roof(builder, main.turned(), 0.2, sheet, style, eave_m=0.2, verge_m=0.1)


def _add_office(builder: Builder, plot: Plot, main_style: FacadeStyle, rng: np.random.Generator) -> None:
    """Add two storeys of offices in front of an industrial building."""
    style = replace(
        main_style,
        wall=Material.PLASTER,
        wall_tint=pick_tint(rng, palette.PLASTERS),
        bay_m=2.6,
        window_m=(1.7, 1.5),
        sill_m=0.85,
        ground_m=3.3,
        storeys=2,
    )
    start = 0.0 if rng.random() < 0.5 else plot.width_m - 12.0
    span = BuildingPart(plot.frame, start, start + 12.0, 0.0, 5.0, style.eaves_m)
    frame, length = span.side("front")
    s = window_columns(length, style)
    z = window_rows(style.floors_m(), style, len(s))
    doors = place_door(z, 1, 2.3)
    add_window_wall(builder, frame, length, (0.0, style.eaves_m), s, z, style=style, detailed=True, doors=doors)
    for name in ("left", "right"):
        add_plain_side(builder, span, name, style, False)
    add_flat_roof(builder, span, 0.5, style, palette.LEAD)
