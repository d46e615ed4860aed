"""Roofs of rectangular building parts: gabled, hipped, flat, saw-tooth; chimneys and roof equipment."""

from __future__ import annotations

import numpy as np

from appocc.simulation.mesh import Material
from appocc.simulation.scenery.builder import UNIT_UV, Builder, Tint
from appocc.simulation.scenery.facade import FacadeStyle
from appocc.simulation.scenery.palette import GRAVEL, LEAD
from appocc.simulation.scenery.spans import BuildingPart

_THICK_M = 0.16


def add_gable_roof(
    builder: Builder,
    part: BuildingPart,
    pitch_rad: float,
    tint: Tint,
    style: FacadeStyle,
    eave_m: float = 0.35,
    verge_m: float = 0.0,
) -> float:
    """Add a roof with its ridge along s, and gable walls at both ends; return the height of the ridge."""
    s0, s1, d0, d1, z = part.s0, part.s1, part.d0, part.d1, part.eaves_m
    middle, rise = (d0 + d1) / 2, np.tan(pitch_rad)
    top = z + (d1 - d0) / 2 * rise
    wall = style.wall, style.wall_tint, style.tag
    builder.add_triangles(
        part.frame,
        [
            [[s1, d0, z], [s1, d1, z], [s1, middle, top]],
            [[s0, d1, z], [s0, d0, z], [s0, middle, top]],
        ],
        *wall,
    )
    e, low = eave_m, z - eave_m * rise
    a, b = s0 - verge_m, s1 + verge_m
    t = _THICK_M
    # Front and back slope from the ridge down; then undersides, eaves and verges.
    front = [[b, middle, top + t], [a, middle, top + t], [a, d0 - e, low + t], [b, d0 - e, low + t]]
    back = [[a, middle, top + t], [b, middle, top + t], [b, d1 + e, low + t], [a, d1 + e, low + t]]
    builder.add_quads(part.frame, [front, back], Material.ROOF_TILES, tint, style.tag)
    under = [
        [[a, middle, top], [b, middle, top], [b, d0 - e, low], [a, d0 - e, low]],
        [[b, middle, top], [a, middle, top], [a, d1 + e, low], [b, d1 + e, low]],
        [[a, d0 - e, low], [b, d0 - e, low], [b, d0 - e, low + t], [a, d0 - e, low + t]],
        [[b, d1 + e, low], [a, d1 + e, low], [a, d1 + e, low + t], [b, d1 + e, low + t]],
    ]
    verges = [
        [[b, d0 - e, low], [b, middle, top], [b, middle, top + t], [b, d0 - e, low + t]],
        [[b, middle, top], [b, d1 + e, low], [b, d1 + e, low + t], [b, middle, top + t]],
        [[a, middle, top], [a, d0 - e, low], [a, d0 - e, low + t], [a, middle, top + t]],
        [[a, d1 + e, low], [a, middle, top], [a, middle, top + t], [a, d1 + e, low + t]],
    ]
    builder.add_quads(part.frame, under + verges, Material.PLAIN, style.trim, style.tag)
    return float(top + t)


def add_hip_roof(
    builder: Builder, part: BuildingPart, pitch_rad: float, tint: Tint, style: FacadeStyle, eave_m: float = 0.4
) -> float:
    """Add a roof that slopes to all four sides, its ridge along s; return the height of the ridge."""
    a, b, c, d = part.s0 - eave_m, part.s1 + eave_m, part.d0 - eave_m, part.d1 + eave_m
    half = min(b - a, d - c) / 2
    middle, z = (c + d) / 2, part.eaves_m
    t = z + _THICK_M
    top = t + half * np.tan(pitch_rad)
    p, q = a + half, max(b - half, a + half + 0.01)
    builder.add_quads(
        part.frame,
        [
            [[q, middle, top], [p, middle, top], [a, c, t], [b, c, t]],
            [[p, middle, top], [q, middle, top], [b, d, t], [a, d, t]],
        ],
        Material.ROOF_TILES,
        tint,
        style.tag,
    )
    ends = [[[a, d, t], [a, c, t], [p, middle, top]], [[b, c, t], [b, d, t], [q, middle, top]]]
    builder.add_triangles(part.frame, ends, Material.ROOF_TILES, tint, style.tag)
    builder.add_boxes(part.frame, [a, c, z], [b, d, t], Material.PLAIN, style.trim, tag=style.tag, sides="lrfbd")
    return float(top)


def add_flat_roof(builder: Builder, part: BuildingPart, parapet_m: float, style: FacadeStyle, coping: Tint) -> None:
    """Add a gravel roof behind a parapet; the walls end at the eaves, the parapet continues above them."""
    s0, s1, d0, d1, z = part.s0, part.s1, part.d0, part.d1, part.eaves_m
    thick = 0.25
    builder.add_quads(
        part.frame, [[s0, d0, z], [s1, d0, z], [s1, d1, z], [s0, d1, z]], Material.FLAT_ROOF, GRAVEL, style.tag
    )
    low = [[s0, d0, z], [s0, d1 - thick, z], [s0, d0 + thick, z], [s1 - thick, d0 + thick, z]]
    high = [[s1, d0 + thick], [s1, d1], [s0 + thick, d1 - thick], [s1, d1 - thick]]
    top = z + parapet_m
    builder.add_boxes(
        part.frame, low, [[*h, top] for h in high], style.wall, style.wall_tint, tag=style.tag, sides="lrfb"
    )
    out = 0.05
    low = [[s0 - out, d0 - out, top], [s0 - out, d1 - thick, top], [s0 - out, d0 + thick, top]]
    low.append([s1 - thick, d0 + thick, top])
    high = [[s1 + out, d0 + thick], [s1 + out, d1 + out], [s0 + thick, d1 - thick], [s1 + out, d1 - thick]]
    builder.add_boxes(
        part.frame, low, [[*h, top + 0.09] for h in high], Material.CONCRETE, coping, tag=style.tag, sides="lrfbt"
    )


def add_roof_equipment(builder: Builder, part: BuildingPart, style: FacadeStyle, rng: np.random.Generator) -> None:
    """Add a stair head and machinery to a flat roof."""
    width, depth, z = part.s1 - part.s0, part.d1 - part.d0, part.eaves_m
    if width < 6 or depth < 6:
        return
    s, d = part.s0 + rng.uniform(0.25, 0.55) * width, part.d0 + rng.uniform(0.4, 0.55) * depth
    builder.add_boxes(part.frame, [s, d, z], [s + 3.4, d + 2.6, z + 2.5], style.wall, style.wall_tint, style.tag)
    count = int(rng.integers(1, 5))
    low = np.stack(
        [
            part.s0 + 1 + rng.uniform(0, 1, count) * (width - 3.5),
            part.d0 + 1 + rng.uniform(0, 1, count) * (depth - 3.5),
            np.full(count, z),
        ],
        axis=1,
    )
    size = rng.uniform([0.8, 0.8, 0.6], [2.0, 1.5, 1.5], (count, 3))
    builder.add_boxes(part.frame, low, low + size, Material.METAL, LEAD, style.tag)


def add_chimney(
    builder: Builder, part: BuildingPart, s: float, d: float, z_m: float, tint: Tint, style: FacadeStyle
) -> None:
    """Add a brick chimney with a cap and two pots; its cap begins at `z_m`."""
    low = [s - 0.35, d - 0.5, part.eaves_m]
    builder.add_boxes(part.frame, low, [s + 0.35, d + 0.5, z_m], Material.BRICK, tint, tag=style.tag, sides="lrfb")
    cap = [s - 0.42, d - 0.57, z_m], [s + 0.42, d + 0.57, z_m + 0.12]
    builder.add_boxes(part.frame, *cap, Material.CONCRETE, style.trim, style.tag, "lrfbdt")
    pots = np.array([[s - 0.13, d - 0.35, z_m + 0.12], [s - 0.13, d + 0.1, z_m + 0.12]])
    builder.add_boxes(part.frame, pots, pots + np.array([0.26, 0.26, 0.45]), Material.PLAIN, (146, 88, 66), style.tag)


def add_dormers(
    builder: Builder, part: BuildingPart, count: int, pitch_rad: float, tint: Tint, style: FacadeStyle
) -> None:
    """Add dormers with flat roofs to the front slope of a gabled roof."""
    rise = np.tan(pitch_rad)
    width, height, d = 1.35, 1.35, part.d0 + 0.9
    z = part.eaves_m + 0.9 * rise + 0.1
    if count == 0 or height / rise > (part.d1 - part.d0) / 2 - 1.0:
        return
    s = part.s0 + (part.s1 - part.s0) * (np.arange(count) + 0.5) / count
    one = np.ones(count)
    low = np.stack([s - width / 2, d * one, (z - 0.3) * one], axis=1)
    high = np.stack([s + width / 2, (d + height / rise) * one, (z + height) * one], axis=1)
    builder.add_boxes(part.frame, low, high, Material.PLAIN, tint, tag=style.tag, sides="lrf")
    roof = [0.12, 0.14, 0.0]
    top = high.copy()
    top[:, 2] += 0.12
    bottom = low.copy()
    bottom[:, 2] = high[:, 2]
    builder.add_boxes(
        part.frame,
        bottom - roof,
        top + np.array([0.12, 0.25, 0.0]),
        Material.PLAIN,
        LEAD,
        tag=style.tag,
        sides="lrfdt",
    )
    x0, x1, z0, z1 = s - width / 2 + 0.15, s + width / 2 - 0.15, (z + 0.12) * one, (z + height - 0.12) * one
    y = (d - 0.03) * one
    panes = np.moveaxis(np.array([[x0, y, z0], [x1, y, z0], [x1, y, z1], [x0, y, z1]]), -1, 0)
    builder.add_quads(part.frame, panes, Material.WINDOW, style.window_frame, style.tag, UNIT_UV)


def add_saw_tooth_roof(
    builder: Builder, part: BuildingPart, tooth_m: float, rise_m: float, tint: Tint, style: FacadeStyle
) -> None:
    """Add a saw-tooth roof with glazed upright sides, along s."""
    count = max(1, round((part.s1 - part.s0) / tooth_m))
    edge = np.linspace(part.s0, part.s1, count + 1)
    a, b, c, d, z = edge[:-1], edge[1:], part.d0, part.d1, part.eaves_m
    one = np.ones(count)
    low, top, front, back = z * one, (z + rise_m) * one, c * one, d * one
    slope = [[a, front, top], [b, front, low], [b, back, low], [a, back, top]]
    builder.add_quads(part.frame, np.moveaxis(np.array(slope), -1, 0), Material.METAL, tint, style.tag)
    upright = [[a, back, low], [a, front, low], [a, front, top], [a, back, top]]
    builder.add_quads(part.frame, np.moveaxis(np.array(upright), -1, 0), style.wall, style.wall_tint, style.tag)
    panes = _tooth_panes(a, c, d, z, rise_m)
    builder.add_quads(part.frame, panes, Material.WINDOW, style.window_frame, style.tag, UNIT_UV)
    ends = [
        [[a, front, low], [b, front, low], [a, front, top]],
        [[b, back, low], [a, back, low], [a, back, top]],
    ]
    triangles = np.moveaxis(np.array(ends), -1, 0)
    builder.add_triangles(part.frame, triangles, style.wall, style.wall_tint, style.tag)


def _tooth_panes(a: np.ndarray, c: float, d: float, z: float, rise_m: float) -> np.ndarray:
    """Return panes along the upright sides of saw teeth."""
    panes = max(1, int((d - c) / 3.0))
    cut = np.linspace(c + 0.4, d - 0.4, panes + 1)
    s, near = np.meshgrid(a - 0.03, cut[:-1], indexing="ij")
    far = near + (cut[1] - cut[0]) - 0.15
    low, top = np.full_like(s, z + 0.25 * rise_m), np.full_like(s, z + 0.85 * rise_m)
    corners = [[s, far, low], [s, near, low], [s, near, top], [s, far, top]]
    return np.moveaxis(np.array(corners).reshape(4, 3, -1), -1, 0)
