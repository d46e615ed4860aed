"""Detached suburban houses: gabled and hipped roofs, porches, garages."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from appocc.simulation.mesh import Material
from appocc.simulation.scenery import palette
from appocc.simulation.scenery.apartments import apartment_house
from appocc.simulation.scenery.builder import Builder, Tint
from appocc.simulation.scenery.facade import (
    Look,
    columns,
    plain_wall,
    window_rows,
    windows_wall,
    with_door,
)
from appocc.simulation.scenery.palette import pick
from appocc.simulation.scenery.plots import Plot
from appocc.simulation.scenery.roofs import chimney, gable, hip
from appocc.simulation.scenery.spans import Span, plain_side


def detached_house(builder: Builder, plot: Plot, tag: int, rng: np.random.Generator) -> None:
    """Add a house with its garage; on arterials sometimes a low apartment building."""
    if plot.arterial and plot.width_m > 11 and rng.random() < 0.15 and not plot.backland:
        apartment_house(builder, replace(plot, arterial=False), tag, rng, 3)
        return
    kind = int(rng.integers(3))
    wall = (Material.PLASTER, Material.BRICK, Material.PLAIN)[kind]
    look = Look(
        wall=wall,
        wall_tint=pick(rng, (palette.PLASTERS, palette.BRICKS, palette.SIDINGS)[kind]),
        trim=pick(rng, palette.TRIMS),
        frame=pick(rng, palette.FRAMES[:2]),
        door=pick(rng, palette.DOORS),
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
    door = len(s) - 1
    doors = with_door(z, door, 2.15)
    windows_wall(builder, place, length, (0.0, look.eaves_m), s, z, look, detailed, doors)
    for name in ("right", "back", "left"):
        plain_side(builder, main, name, look, False)
    tint, pitch = pick(rng, palette.SHINGLES + palette.TILES[:4]), float(rng.uniform(0.45, 0.75))
    kind = rng.random()
    if kind < 0.4 and length > plot.depth_m - front:
        top = hip(builder, main, pitch, tint, look)
    elif kind < 0.75 or wing:
        top = gable(builder, main, pitch, tint, look, 0.4, 0.3)
    else:
        top = gable(builder, main.turned(), pitch, tint, look, 0.4, 0.3)
    if rng.random() < 0.55:
        chimney(builder, main, main.s0 + 1.2, (main.d0 + main.d1) / 2, top + 0.6, pick(rng, palette.BRICKS), look)
    if detailed:
        _porch(builder, main, float(s[door].mean()), look, tint)
    if wing:
        bay = Span(plot.place, 0.4, 0.4 + min(4.0, 0.4 * split), 0.0, front + 2.0, look.eaves_m)
        _front_wing(builder, bay, look, pitch, tint)
    if garage:
        _garage(builder, Span(plot.place, split, plot.width_m, 2.2, min(plot.depth_m, 8.2), 2.6), look, pitch, tint)


def _porch(builder: Builder, main: Span, s: float, look: Look, tint: Tint) -> None:
    """Add a small roof above the door on two posts, and a step."""
    d = main.d0
    builder.boxes(
        main.place, [s - 1.0, d - 1.2, 2.45], [s + 1.0, d, 2.6], Material.PLAIN, look.trim, look.tag, "lrfdt"
    )
    posts = np.array([[s - 0.95, d - 1.15, 0.0], [s + 0.83, d - 1.15, 0.0]])
    builder.boxes(
        main.place, posts, posts + np.array([0.12, 0.12, 2.45]), Material.PLAIN, look.trim, look.tag, "lrfb"
    )
    slope = [[s + 1.0, d, 3.0], [s - 1.0, d, 3.0], [s - 1.0, d - 1.2, 2.6], [s + 1.0, d - 1.2, 2.6]]
    builder.quads(main.place, slope, Material.ROOF_TILES, tint, look.tag)
    cheeks = [
        [[s + 1.0, d - 1.2, 2.6], [s + 1.0, d, 2.6], [s + 1.0, d, 3.0]],
        [[s - 1.0, d, 2.6], [s - 1.0, d - 1.2, 2.6], [s - 1.0, d, 3.0]],
    ]
    builder.triangles(main.place, cheeks, Material.PLAIN, look.trim, look.tag)
    builder.boxes(
        main.place, [s - 0.9, d - 1.0, 0], [s + 0.9, d, 0.14], Material.CONCRETE, palette.CONCRETE, look.tag
    )


def _front_wing(builder: Builder, bay: Span, look: Look, pitch_rad: float, tint: Tint) -> None:
    """Add a front wing whose gable faces the street."""
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
        builder,
        place,
        length,
        (0.0, span.eaves_m),
        door,
        np.array([[[0.02, 2.15]]]),
        shut,
        True,
        np.ones((1, 1), np.bool_),
    )
    for name in ("right", "back"):
        plain_side(builder, span, name, shut, True)
    gable(builder, span.turned(), min(pitch_rad, 0.5), tint, shut, 0.25, 0.25)
