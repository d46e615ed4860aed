"""Walls with openings: recessed windows, doors, shopfronts, balconies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from appocc.checks import BoolArray, FloatArray
from appocc.simulation.mesh import Material
from appocc.simulation.scenery.builder import UNIT_UV, Builder, LocalFrame, Tint
from appocc.simulation.scenery.palette import CONCRETE, METALS

SHOP_PANE_WIDTH_M, SHOP_PANE_HEIGHT_M = 1.6, 3.2  # size of a shop window pane, see `rendering.materials`
_GATE_M, _GROOVES = 1.8, 4
_PROUD_M = 0.03  # panes of plain walls are in front of the wall, which avoids z-fighting


@dataclass(frozen=True, kw_only=True)
class FacadeStyle:
    """Walls and windows of a building.

    Attributes:
        wall: material of the walls.
        wall_tint: colour of the walls.
        trim: colour of sills, cornices and surrounds.
        window_frame: colour of the window frames.
        door: colour of the doors.
        bay_m: approximate distance between windows.
        window_m: width and height of a window.
        sill_m: height of the window above the floor.
        ground_m: height of the ground floor.
        storey_m: height of the other storeys.
        storeys: number of storeys, including the ground floor.
        recess_m: recess of the windows in street facades.
        sills: whether the windows have sills.
        tag: number of the building.
    """

    wall: Material
    wall_tint: Tint
    trim: Tint
    window_frame: Tint
    door: Tint
    bay_m: float
    window_m: tuple[float, float]
    sill_m: float
    ground_m: float
    storey_m: float
    storeys: int
    recess_m: float
    sills: bool
    tag: int

    @property
    def eaves_m(self) -> float:
        """Height of the walls."""
        return self.ground_m + (self.storeys - 1) * self.storey_m

    def floors_m(self, first: int = 0) -> FloatArray:
        """Return the heights of the floors, from `first` on."""
        floors = np.concatenate([[0.0], self.ground_m + self.storey_m * np.arange(self.storeys - 1)])
        return np.asarray(floors[first:])


def upright_quads(edges: FloatArray, d: float | FloatArray = 0.0) -> FloatArray:
    """Return (N, 4, 3) upright quads of [s0, s1, z0, z1] (N, 4) that face the street at depth d."""
    edges = np.asarray(edges, np.float64).reshape(-1, 4)
    quads = np.empty((len(edges), 4, 3))
    quads[:, :, 0] = edges[:, [0, 1, 1, 0]]
    quads[:, :, 1] = np.reshape(d, (-1, 1))
    quads[:, :, 2] = edges[:, [2, 2, 3, 3]]
    return quads


def add_plain_wall(
    builder: Builder, frame: LocalFrame, edges: FloatArray, material: Material, tint: Tint, tag: int
) -> None:
    """Add wall rectangles [s0, s1, z0, z1] (N, 4) with a continuous pattern."""
    quads = upright_quads(edges)
    builder.add_quads(frame, quads, material, tint, tag, quads[..., [0, 2]])


def window_columns(length_m: float, style: FacadeStyle, margin_m: float = 0.5) -> FloatArray:
    """Return (n, 2) left and right edges of the windows of a wall, evenly spaced; none if the wall is too short."""
    count = int((length_m - 2 * margin_m) / style.bay_m + 0.35)
    if count == 0 and length_m > style.window_m[0] + 0.6:
        count = 1
    if count == 0:
        return np.zeros((0, 2))
    bay = (length_m - 2 * margin_m) / count
    middle = margin_m + bay * (np.arange(count) + 0.5)
    half = min(style.window_m[0], bay - 0.3) / 2
    return np.stack([middle - half, middle + half], axis=1)


def window_rows(floors_m: FloatArray, style: FacadeStyle, count: int) -> FloatArray:
    """Return (m, n, 2) lower and upper edges of the windows of some floors, n in each."""
    low = floors_m + style.sill_m
    rows = np.stack([low, low + style.window_m[1]], axis=1)
    return np.broadcast_to(rows[:, None], (len(floors_m), count, 2)).copy()


def place_door(z: FloatArray, column: int, top_m: float) -> BoolArray:
    """Replace the lowest window of a column of `window_rows` by a door; return which openings are doors (m, n)."""
    doors = np.zeros(z.shape[:2], np.bool_)
    doors[0, column], z[0, column] = True, (0.04, top_m)
    return doors


def add_window_wall(
    builder: Builder,
    frame: LocalFrame,
    length_m: float,
    z_m: tuple[float, float],
    s: FloatArray,
    z: FloatArray,
    style: FacadeStyle,
    detailed: bool,
    doors: BoolArray | None = None,
) -> None:
    """Add a wall from z_m[0] to z_m[1] with openings: columns s (n, 2), rows z (m, n, 2).

    Args:
        builder: collects the faces.
        frame: frame with s = 0 at the left end of the wall.
        length_m: length of the wall.
        z_m: lower and upper edge.
        s: left and right edges of the columns.
        z: lower and upper edges of each opening, from the bottom.
        style: materials.
        detailed: recess the windows in the wall, with sills; otherwise panes are in front of the wall.
        doors: (m, n) which openings are doors.
    """
    whole = np.array([[0.0, length_m, *z_m]])
    rows, count = z.shape[:2]
    if rows * count == 0:
        add_plain_wall(builder, frame, whole, style.wall, style.wall_tint, style.tag)
        return
    across = np.broadcast_to(s[None], (rows, count, 2))
    panes = np.concatenate([across, z], axis=-1).reshape(-1, 4)
    there = panes[:, 3] - panes[:, 2] > 1e-3  # an opening without height is omitted
    door = np.zeros(len(panes), np.bool_) if doors is None else doors.reshape(-1)
    panes, door = panes[there], door[there]
    if detailed:
        _add_wall_around(builder, frame, length_m, z_m, s, z=z, style=style)
        _add_reveals(builder, frame, panes, style)
        if style.sills:
            _add_sills(builder, frame, panes[~door], style)
    else:
        add_plain_wall(builder, frame, whole, style.wall, style.wall_tint, style.tag)
    depth = style.recess_m if detailed else -_PROUD_M
    builder.add_quads(
        frame, upright_quads(panes[~door], depth), Material.WINDOW, style.window_frame, style.tag, UNIT_UV
    )
    builder.add_quads(frame, upright_quads(panes[door], depth), Material.PLAIN, style.door, style.tag)
    if detailed and door.any():
        _add_door_details(builder, frame, panes[door], style)


def _add_wall_around(
    builder: Builder,
    frame: LocalFrame,
    length_m: float,
    z_m: tuple[float, float],
    s: FloatArray,
    z: FloatArray,
    style: FacadeStyle,
) -> None:
    """Add the wall around the openings: piers of full height, and spandrels above and below the openings."""
    low, high = np.concatenate([[0.0], s[:, 1]]), np.concatenate([s[:, 0], [length_m]])
    piers = np.stack([low, high, np.full_like(low, z_m[0]), np.full_like(low, z_m[1])], axis=1)
    count = len(s)
    bottom = np.concatenate([np.full((1, count), z_m[0]), z[..., 1]])
    top = np.concatenate([z[..., 0], np.full((1, count), z_m[1])])
    across = np.broadcast_to(s[None], (len(bottom), count, 2))
    spandrels = np.concatenate([across, bottom[..., None], top[..., None]], axis=-1).reshape(-1, 4)
    spandrels = spandrels[spandrels[:, 3] - spandrels[:, 2] > 1e-3]
    add_plain_wall(builder, frame, np.concatenate([piers, spandrels]), style.wall, style.wall_tint, style.tag)


def _add_reveals(builder: Builder, frame: LocalFrame, panes: FloatArray, style: FacadeStyle) -> None:
    """Add the sides and upper edge of each opening, from the wall's face to the pane; sills are the lower edge."""
    s0, s1, z0, z1 = panes.T
    f, b = np.zeros_like(s0), np.full_like(s0, style.recess_m)
    left = [[s0, f, z0], [s0, b, z0], [s0, b, z1], [s0, f, z1]]
    right = [[s1, b, z0], [s1, f, z0], [s1, f, z1], [s1, b, z1]]
    upper = [[s0, b, z1], [s1, b, z1], [s1, f, z1], [s0, f, z1]]
    sides = [left, right, upper]
    if not style.sills:
        sides.append([[s0, f, z0], [s1, f, z0], [s1, b, z0], [s0, b, z0]])
    quads = np.moveaxis(np.array(sides), -1, 0)
    builder.add_quads(frame, quads, style.wall, style.wall_tint, style.tag)


def _add_sills(builder: Builder, frame: LocalFrame, panes: FloatArray, style: FacadeStyle) -> None:
    s0, s1, z0, _ = panes.T
    low = np.stack([s0 - 0.08, np.full_like(s0, -0.09), z0 - 0.11], axis=1)
    high = np.stack([s1 + 0.08, np.full_like(s0, style.recess_m), z0 + 0.005], axis=1)
    builder.add_boxes(frame, low, high, Material.CONCRETE, style.trim, tag=style.tag, sides="ft")


def _add_door_details(builder: Builder, frame: LocalFrame, doors: FloatArray, style: FacadeStyle) -> None:
    """Add frames and handles of doors, and grooves across those as wide as a gate."""
    before = style.recess_m - 0.02
    gate = doors[:, 1] - doors[:, 0] > _GATE_M
    s0, s1, z0, z1 = doors[~gate].T
    left, right = (np.stack([a, a + 0.07, z0, z1], axis=1) for a in (s0, s1 - 0.07))
    upper = np.stack([s0 + 0.07, s1 - 0.07, z1 - 0.08, z1], axis=1)
    frames = upright_quads(np.concatenate([left, right, upper]), before)
    builder.add_quads(frame, frames, Material.PLAIN, style.window_frame, style.tag)
    handles = upright_quads(np.stack([s1 - 0.20, s1 - 0.14, z0 + 0.95, z0 + 1.12], axis=1), before)
    builder.add_quads(frame, handles, Material.METAL, METALS[2], style.tag)
    s0, s1, z0, z1 = np.repeat(doors[gate], _GROOVES, axis=0).T
    z = z0 + (z1 - z0) * np.tile((np.arange(_GROOVES) + 1) / (_GROOVES + 1), int(gate.sum()))
    grooves = upright_quads(np.stack([s0, s1, z - 0.015, z + 0.015], axis=1), before + 0.01)
    builder.add_quads(frame, grooves, Material.PLAIN, np.array(style.door) * 3 // 5, style.tag)


def add_cornice(
    builder: Builder,
    frame: LocalFrame,
    length_m: float,
    z_m: float,
    height_m: float,
    out_m: float,
    style: FacadeStyle,
) -> None:
    """Add a cornice or string course along a wall."""
    low, high = [0.0, -out_m, z_m], [length_m, 0.02, z_m + height_m]
    builder.add_boxes(frame, low, high, Material.CONCRETE, style.trim, tag=style.tag, sides="lrfdt")


def add_shop_floor(
    builder: Builder,
    frame: LocalFrame,
    length_m: float,
    style: FacadeStyle,
    fascia: Tint,
    awning: Tint | None,
    stall: bool = True,
) -> None:
    """Add a ground floor of shop windows between piers, its sign board, and an optional awning.

    Args:
        builder: takes the faces.
        frame: frame with s = 0 at the left end of the wall.
        length_m: length of the wall.
        style: materials.
        fascia: colour of the sign board.
        awning: colour of the awning, None for no awning.
        stall: whether the glass is on a low wall; otherwise it reaches the ground.
    """
    count = max(1, round((length_m - 0.4) / 3.6))
    bay = (length_m - 0.4) / count
    middle = 0.2 + bay * (np.arange(count) + 0.5)
    s = np.stack([middle - bay / 2 + 0.2, middle + bay / 2 - 0.2], axis=1)
    head = style.ground_m - 0.85
    z = np.broadcast_to(np.array([0.45 if stall else 0.08, head]), (1, count, 2)).copy()
    door = np.arange(count) == count // 2
    s_door = s[door][:, :1] + np.array([0.0, 1.05])
    s[door, 0] += 1.2
    s, z = np.concatenate([s, s_door]), np.concatenate([z, [[[0.02, head]]]], axis=1)
    order = np.argsort(s[:, 0], kind="stable")
    s, z = s[order], z[:, order]
    _add_wall_around(builder, frame, length_m, (0.0, style.ground_m), s, z=z, style=style)
    panes = np.concatenate([s, z[0]], axis=1)
    _add_reveals(builder, frame, panes, style)
    glass = upright_quads(panes, style.recess_m)
    builder.add_quads(frame, glass, Material.SHOPFRONT, style.window_frame, style.tag, _shop_uv(panes))
    board = [0.25, -0.12, head + 0.12], [length_m - 0.25, 0.02, head + 0.67]
    builder.add_boxes(frame, *board, Material.PLAIN, fascia, style.tag, "lrfdt")
    if awning is not None:
        _add_awnings(builder, frame, s[s[:, 1] - s[:, 0] > 1.3], head + 0.05, awning, style.tag)


def _shop_uv(panes: FloatArray) -> FloatArray:
    """Return (N, 4, 2) metres along and up shop windows, scaled slightly so that each shows whole panes."""
    count = np.maximum(np.rint((panes[:, 1] - panes[:, 0]) / SHOP_PANE_WIDTH_M), 1.0)
    first = np.cumsum(count) - count
    along = np.stack([first, first + count], axis=1)[:, [0, 1, 1, 0]] * SHOP_PANE_WIDTH_M
    up = np.broadcast_to([0.0, 0.0, SHOP_PANE_HEIGHT_M, SHOP_PANE_HEIGHT_M], along.shape)
    return np.stack([along, up], axis=-1)


def _add_awnings(builder: Builder, frame: LocalFrame, s: FloatArray, z_m: float, tint: Tint, tag: int) -> None:
    """Add sloping, two-sided awnings with a valance above shop windows."""
    s0, s1 = s.T
    back, front, top, low = np.full_like(s0, -0.13), np.full_like(s0, -1.25), z_m, z_m - 0.45
    t, e, v = np.full_like(s0, top), np.full_like(s0, low), np.full_like(s0, low - 0.22)
    cloth = [[s0, front, e], [s1, front, e], [s1, back, t], [s0, back, t]]
    under = [[s0, back, t - 0.02], [s1, back, t - 0.02], [s1, front, e - 0.02], [s0, front, e - 0.02]]
    valance = [[s0, front, v], [s1, front, v], [s1, front, e], [s0, front, e]]
    inner = [[s1, front + 0.01, v], [s0, front + 0.01, v], [s0, front + 0.01, e], [s1, front + 0.01, e]]
    builder.add_quads(frame, np.moveaxis(np.array([cloth, under, valance, inner]), -1, 0), Material.CLOTH, tint, tag)


def add_balconies(
    builder: Builder, frame: LocalFrame, s: FloatArray, floors_m: FloatArray, rail: Tint, style: FacadeStyle
) -> None:
    """Add balconies in front of columns (n, 2) at floors (m,): a slab and a railing on three sides."""
    s0, s1 = (np.tile(edge, len(floors_m)) for edge in (s[:, 0] - 0.45, s[:, 1] + 0.45))
    z = np.repeat(floors_m, len(s))
    out = np.full_like(s0, -1.3)
    wall = np.zeros_like(s0)
    builder.add_boxes(
        frame,
        np.stack([s0, out, z - 0.16], axis=1),
        np.stack([s1, wall, z], axis=1),
        Material.CONCRETE,
        CONCRETE,
        tag=style.tag,
        sides="lrfd",
    )
    low, high = np.stack([s0, out, z + 0.06], axis=1), np.stack([s1, out + 0.04, z + 1.02], axis=1)
    builder.add_boxes(frame, low, high, Material.METAL, rail, tag=style.tag, sides="fbt")
    for left in (s0, s1 - 0.04):
        low, high = np.stack([left, out + 0.04, z + 0.06], axis=1), np.stack([left + 0.04, wall, z + 1.02], axis=1)
        builder.add_boxes(frame, low, high, Material.METAL, rail, tag=style.tag, sides="lr")
