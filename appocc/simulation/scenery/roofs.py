"""Roofs of rectangular building parts: gabled, hipped, flat, saw-tooth; chimneys and roof equipment."""

from __future__ import annotations

import numpy as np

from appocc.simulation.mesh import Material
from appocc.simulation.scenery.builder import UNIT_UV, Builder, Tint
from appocc.simulation.scenery.facade import Look
from appocc.simulation.scenery.palette import GRAVEL, LEAD
from appocc.simulation.scenery.spans import Span

_THICK_M = 0.16


def gable(
    builder: Builder, span: Span, pitch_rad: float, tint: Tint, look: Look, eave_m: float = 0.35, verge_m: float = 0.0
) -> float:
    """Add a roof with its ridge along s, and gable walls at both ends; return the height of the ridge."""
    s0, s1, d0, d1, z = span.s0, span.s1, span.d0, span.d1, span.eaves_m
    middle, rise = (d0 + d1) / 2, np.tan(pitch_rad)
    top = z + (d1 - d0) / 2 * rise
    wall = look.wall, look.wall_tint, look.tag
    builder.triangles(
        span.place,
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
    builder.quads(span.place, [front, back], Material.ROOF_TILES, tint, look.tag)
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
    builder.quads(span.place, under + verges, Material.PLAIN, look.trim, look.tag)
    return float(top + t)


def hip(builder: Builder, span: Span, pitch_rad: float, tint: Tint, look: Look, eave_m: float = 0.4) -> float:
    """Add a roof that slopes to all four sides, its ridge along s; return the height of the ridge."""
    a, b, c, d = span.s0 - eave_m, span.s1 + eave_m, span.d0 - eave_m, span.d1 + eave_m
    half = min(b - a, d - c) / 2
    middle, z = (c + d) / 2, span.eaves_m
    t = z + _THICK_M
    top = t + half * np.tan(pitch_rad)
    p, q = a + half, max(b - half, a + half + 0.01)
    builder.quads(
        span.place,
        [
            [[q, middle, top], [p, middle, top], [a, c, t], [b, c, t]],
            [[p, middle, top], [q, middle, top], [b, d, t], [a, d, t]],
        ],
        Material.ROOF_TILES,
        tint,
        look.tag,
    )
    ends = [[[a, d, t], [a, c, t], [p, middle, top]], [[b, c, t], [b, d, t], [q, middle, top]]]
    builder.triangles(span.place, ends, Material.ROOF_TILES, tint, look.tag)
    builder.boxes(span.place, [a, c, z], [b, d, t], Material.PLAIN, look.trim, look.tag, "lrfbd")
    return float(top)


def flat(builder: Builder, span: Span, parapet_m: float, look: Look, coping: Tint) -> None:
    """Add a gravel roof behind a parapet; the walls end at the eaves, the parapet continues above them."""
    s0, s1, d0, d1, z = span.s0, span.s1, span.d0, span.d1, span.eaves_m
    thick = 0.25
    builder.quads(
        span.place, [[s0, d0, z], [s1, d0, z], [s1, d1, z], [s0, d1, z]], Material.FLAT_ROOF, GRAVEL, look.tag
    )
    low = [[s0, d0, z], [s0, d1 - thick, z], [s0, d0 + thick, z], [s1 - thick, d0 + thick, z]]
    high = [[s1, d0 + thick], [s1, d1], [s0 + thick, d1 - thick], [s1, d1 - thick]]
    top = z + parapet_m
    builder.boxes(span.place, low, [[*h, top] for h in high], look.wall, look.wall_tint, look.tag, "lrfb")
    out = 0.05
    low = [[s0 - out, d0 - out, top], [s0 - out, d1 - thick, top], [s0 - out, d0 + thick, top]]
    low.append([s1 - thick, d0 + thick, top])
    high = [[s1 + out, d0 + thick], [s1 + out, d1 + out], [s0 + thick, d1 - thick], [s1 + out, d1 - thick]]
    builder.boxes(span.place, low, [[*h, top + 0.09] for h in high], Material.CONCRETE, coping, look.tag, "lrfbt")


def rooftop(builder: Builder, span: Span, look: Look, rng: np.random.Generator) -> None:
    """Add a stair head and machinery to a flat roof."""
    width, depth, z = span.s1 - span.s0, span.d1 - span.d0, span.eaves_m
    if width < 6 or depth < 6:
        return
    s, d = span.s0 + rng.uniform(0.25, 0.55) * width, span.d0 + rng.uniform(0.4, 0.55) * depth
    builder.boxes(span.place, [s, d, z], [s + 3.4, d + 2.6, z + 2.5], look.wall, look.wall_tint, look.tag)
    count = int(rng.integers(1, 5))
    low = np.stack(
        [
            span.s0 + 1 + rng.uniform(0, 1, count) * (width - 3.5),
            span.d0 + 1 + rng.uniform(0, 1, count) * (depth - 3.5),
            np.full(count, z),
        ],
        axis=1,
    )
    size = rng.uniform([0.8, 0.8, 0.6], [2.0, 1.5, 1.5], (count, 3))
    builder.boxes(span.place, low, low + size, Material.METAL, LEAD, look.tag)


def chimney(builder: Builder, span: Span, s: float, d: float, z_m: float, tint: Tint, look: Look) -> None:
    """Add a brick chimney with a cap and two pots; its cap begins at `z_m`."""
    low = [s - 0.35, d - 0.5, span.eaves_m]
    builder.boxes(span.place, low, [s + 0.35, d + 0.5, z_m], Material.BRICK, tint, look.tag, "lrfb")
    cap = [s - 0.42, d - 0.57, z_m], [s + 0.42, d + 0.57, z_m + 0.12]
    builder.boxes(span.place, *cap, Material.CONCRETE, look.trim, look.tag, "lrfbdt")
    pots = np.array([[s - 0.13, d - 0.35, z_m + 0.12], [s - 0.13, d + 0.1, z_m + 0.12]])
    builder.boxes(span.place, pots, pots + np.array([0.26, 0.26, 0.45]), Material.PLAIN, (146, 88, 66), look.tag)


def dormers(builder: Builder, span: Span, count: int, pitch_rad: float, tint: Tint, look: Look) -> None:
    """Add dormers with flat roofs to the front slope of a gabled roof."""
    rise = np.tan(pitch_rad)
    width, height, d = 1.35, 1.35, span.d0 + 0.9
    z = span.eaves_m + 0.9 * rise + 0.1
    if count == 0 or height / rise > (span.d1 - span.d0) / 2 - 1.0:
        return
    s = span.s0 + (span.s1 - span.s0) * (np.arange(count) + 0.5) / count
    one = np.ones(count)
    low = np.stack([s - width / 2, d * one, (z - 0.3) * one], axis=1)
    high = np.stack([s + width / 2, (d + height / rise) * one, (z + height) * one], axis=1)
    builder.boxes(span.place, low, high, Material.PLAIN, tint, look.tag, "lrf")
    roof = [0.12, 0.14, 0.0]
    top = high.copy()
    top[:, 2] += 0.12
    bottom = low.copy()
    bottom[:, 2] = high[:, 2]
    builder.boxes(
        span.place, bottom - roof, top + np.array([0.12, 0.25, 0.0]), Material.PLAIN, LEAD, look.tag, "lrfdt"
    )
    x0, x1, z0, z1 = s - width / 2 + 0.15, s + width / 2 - 0.15, (z + 0.12) * one, (z + height - 0.12) * one
    y = (d - 0.03) * one
    panes = np.moveaxis(np.array([[x0, y, z0], [x1, y, z0], [x1, y, z1], [x0, y, z1]]), -1, 0)
    builder.quads(span.place, panes, Material.WINDOW, look.frame, look.tag, UNIT_UV)


def saw_teeth(builder: Builder, span: Span, tooth_m: float, rise_m: float, tint: Tint, look: Look) -> None:
    """Add a saw-tooth roof with glazed upright sides, along s."""
    count = max(1, round((span.s1 - span.s0) / tooth_m))
    edge = np.linspace(span.s0, span.s1, count + 1)
    a, b, c, d, z = edge[:-1], edge[1:], span.d0, span.d1, span.eaves_m
    one = np.ones(count)
    low, top, front, back = z * one, (z + rise_m) * one, c * one, d * one
    slope = [[a, front, top], [b, front, low], [b, back, low], [a, back, top]]
    builder.quads(span.place, np.moveaxis(np.array(slope), -1, 0), Material.METAL, tint, look.tag)
    upright = [[a, back, low], [a, front, low], [a, front, top], [a, back, top]]
    builder.quads(span.place, np.moveaxis(np.array(upright), -1, 0), look.wall, look.wall_tint, look.tag)
    panes = _tooth_panes(a, c, d, z, rise_m)
    builder.quads(span.place, panes, Material.WINDOW, look.frame, look.tag, UNIT_UV)
    ends = [
        [[a, front, low], [b, front, low], [a, front, top]],
        [[b, back, low], [a, back, low], [a, back, top]],
    ]
    triangles = np.moveaxis(np.array(ends), -1, 0)
    builder.triangles(span.place, triangles, look.wall, look.wall_tint, look.tag)


def _tooth_panes(a: np.ndarray, c: float, d: float, z: float, rise_m: float) -> np.ndarray:
    """Return panes along the upright sides of saw teeth."""
    panes = max(1, int((d - c) / 3.0))
    cut = np.linspace(c + 0.4, d - 0.4, panes + 1)
    s, near = np.meshgrid(a - 0.03, cut[:-1], indexing="ij")
    far = near + (cut[1] - cut[0]) - 0.15
    low, top = np.full_like(s, z + 0.25 * rise_m), np.full_like(s, z + 0.85 * rise_m)
    corners = [[s, far, low], [s, near, low], [s, near, top], [s, far, top]]
    return np.moveaxis(np.array(corners).reshape(4, 3, -1), -1, 0)
