"""Industrial buildings: saw-tooth, flat or low gabled roofs, gates, offices in front."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from appocc.checks import FloatArray
from appocc.simulation.mesh import Material
from appocc.simulation.scenery import palette
from appocc.simulation.scenery.builder import Builder
from appocc.simulation.scenery.facade import (
    Look,
    columns,
    window_rows,
    windows_wall,
    with_door,
)
from appocc.simulation.scenery.palette import pick
from appocc.simulation.scenery.plots import Plot
from appocc.simulation.scenery.roofs import flat, gable, rooftop, saw_teeth
from appocc.simulation.scenery.spans import SIDES, Span, plain_columns, plain_side


def works(builder: Builder, plot: Plot, tag: int, rng: np.random.Generator) -> None:
    """Add an industrial building; wide plots may have offices."""
    wall = (Material.METAL, Material.CONCRETE, Material.BRICK)[int(rng.choice(3, p=(0.55, 0.3, 0.15)))]
    tints = palette.BRICKS if wall == Material.BRICK else palette.HALLS
    look = Look(
        wall=wall,
        wall_tint=pick(rng, tints),
        trim=pick(rng, palette.TRIMS),
        frame=pick(rng, palette.DARK_FRAMES),
        door=pick(rng, palette.METALS + palette.AWNINGS),
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
        plain_side(builder, main, name, look, False)
    if not plot.backland:
        _hall_ribs(builder, main, look, s[gates], rng)
    _hall_roof(builder, main, look, rng)
    if office:
        _office(builder, plot, look, rng)


def _hall_ribs(builder: Builder, main: Span, look: Look, gates: FloatArray, rng: np.random.Generator) -> None:
    """Add a plinth with gaps at the front gates (n, 2), a band below the eaves, and posts between windows."""
    stripe = pick(rng, palette.AWNINGS + palette.METALS)
    for name in SIDES:
        place, length = main.side(name)
        front = name == "front"
        s = columns(length, look) if front else plain_columns(length, look)
        cut = np.concatenate([[-0.06], gates.ravel() if front else [], [length + 0.06]]).reshape(-1, 2)
        count = len(cut)
        low = np.stack([cut[:, 0], np.full(count, -0.06), np.zeros(count)], axis=1)
        high = np.stack([cut[:, 1], np.zeros(count), np.full(count, 0.55)], axis=1)
        builder.boxes(place, low, high, Material.CONCRETE, palette.CONCRETE, look.tag, "lrft")
        ends = [-0.05, -0.05, look.eaves_m - 0.9], [length + 0.05, 0.0, look.eaves_m - 0.25]
        builder.boxes(place, *ends, Material.PLAIN, stripe, look.tag, "lrfdt")
        if len(s) > 1:
            between = (s[1:, 0] + s[:-1, 1]) / 2
            low = np.stack([between - 0.15, np.full_like(between, -0.12), np.zeros_like(between)], axis=1)
            builder.boxes(
                place, low, low + np.array([0.3, 0.12, look.eaves_m]), look.wall, look.wall_tint, look.tag, "lrf"
            )


def _hall_roof(builder: Builder, main: Span, look: Look, rng: np.random.Generator) -> None:
    kind, sheet = rng.random(), pick(rng, palette.METALS[2:] + palette.HALLS[:3])
    if kind < 0.4:
        saw_teeth(builder, main, float(rng.uniform(5.5, 8.0)), 2.4, sheet, look)
    elif kind < 0.75:
        flat(builder, main, 0.8, look, palette.LEAD)
        rooftop(builder, main, look, rng)
    else:
        gable(builder, main.turned(), 0.2, sheet, look, 0.2, 0.1)


def _office(builder: Builder, plot: Plot, hall: Look, rng: np.random.Generator) -> None:
    """Add two storeys of offices in front of an industrial building."""
    look = replace(
        hall,
        wall=Material.PLASTER,
        wall_tint=pick(rng, palette.PLASTERS),
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
    doors = with_door(z, 1, 2.3)
    windows_wall(builder, place, length, (0.0, look.eaves_m), s, z, look, True, doors)
    for name in ("left", "right"):
        plain_side(builder, span, name, look, False)
    flat(builder, span, 0.5, look, palette.LEAD)
