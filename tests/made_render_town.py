"""A hand-made street of forty metres, and objects to place on it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from appocc.camera import Camera
from appocc.geometry import transform
from appocc.simulation.mesh import Material, Mesh, join_meshes
from appocc.simulation.network import RoadNetwork
from appocc.simulation.plan import TownPlan
from appocc.simulation.surface import Ground, Surface
from appocc.simulation.town import Town, TownMap

WALL_Y_M = 10.0
LAMP_M = (30.0, -6.0, 6.0)
_SIDES = [
    ([1, 3, 7, 5], [1, 0, 0]),
    ([0, 4, 6, 2], [-1, 0, 0]),
    ([2, 6, 7, 3], [0, 1, 0]),
    ([0, 1, 5, 4], [0, -1, 0]),
    ([4, 5, 7, 6], [0, 0, 1]),
    ([0, 2, 3, 1], [0, 0, -1]),
]


def box(
    low: tuple[float, float, float],
    high: tuple[float, float, float],
    material: Material,
    tint: tuple[int, int, int] = (128, 128, 128),
    tag: int = -1,
) -> Mesh:
    """A box between two corners, uv in metres."""
    ends = np.array([low, high])
    corners = np.array([[ends[i >> a & 1, a] for a in range(3)] for i in range(8)])
    vertices = np.concatenate([corners[side] for side, _ in _SIDES])
    normals = np.repeat([normal for _, normal in _SIDES], 4, axis=0)
    uv = np.where(np.abs(normals[:, :1]) > 0, vertices[:, [1, 2]], vertices[:, [0, 2]])
    faces = (np.arange(6)[:, None, None] * 4 + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
    return Mesh(
        vertices_m=vertices.astype(np.float32),
        normals=normals.astype(np.float32),
        uv=uv.astype(np.float32),
        faces=faces.astype(np.int32),
        material=np.full(12, material, np.uint8),
        tint=np.tile(np.array(tint, np.uint8), (12, 1)),
        tag=np.full(12, tag, np.int32),
    )


def car(x: float, y: float, tag: int, tint: tuple[int, int, int] = (190, 30, 30)) -> Mesh:
    """A painted box with panes on it, a brake lamp at its rear (towards -x) and head lamps at its front."""
    return join_meshes(
        [
            box((x - 2, y - 0.9, 0.3), (x + 2, y + 0.9, 1.0), Material.PAINT, tint, tag),
            box((x - 1, y - 0.8, 1.0), (x + 1, y + 0.8, 1.5), Material.GLASS, (30, 34, 38), tag),
            box((x - 2.05, y - 0.8, 0.6), (x - 2.0, y + 0.8, 0.9), Material.TAIL_LAMP, (120, 16, 18), tag),
            box((x + 2.0, y - 0.8, 0.6), (x + 2.05, y + 0.8, 0.8), Material.HEAD_LAMP, (214, 218, 222), tag),
        ]
    )


def town(*more: Mesh) -> Town:
    """A street along x from 0 to 40 with a white line at y = 0, grass next to it, a brick wall, a pole and a lamp."""
    label = np.full((400, 400), Surface.GRASS, np.uint8)
    label[160:240] = Surface.ROAD
    label[198:202] = Surface.LINE_WHITE
    colours = np.zeros((len(Surface), 3), np.uint8)
    colours[Surface.GRASS], colours[Surface.ROAD], colours[Surface.LINE_WHITE] = (
        (80, 100, 50),
        (90, 90, 92),
        (220,) * 3,
    )
    none = RoadNetwork(
        edges=(),
        inner_lanes=(),
        junctions=(),
        connections=(),
        low_m=np.zeros(2),
        high_m=np.zeros(2),
        offset_m=np.zeros(2),
    )
    solid = join_meshes(
        [
            box((5, WALL_Y_M, 0), (35, WALL_Y_M + 4, 5), Material.BRICK, (150, 70, 55), 0),
            box((25, 5, 0), (25.4, 5.4, 6), Material.METAL, (60, 60, 60)),
            *(box((20, -8, 4 - k), (20.2, -7.8, 4.2 - k), Material.SIGNAL, (40, 40, 40), k) for k in range(3)),
            *more,
        ]
    )
    return Town(
        TownPlan("made", 1, "old", none),
        Ground(np.array([0.0, -20.0]), label, colours[label]),
        solid,
        np.array([LAMP_M]),
        TownMap((), (), (), ()),
    )


def camera(channel: str, width: int, height: int, place: tuple[float, float, float], toward_deg: float) -> Camera:
    """Return a level camera that faces a heading."""
    focal = width / 2 / np.tan(np.radians(35))
    intrinsic = np.array([[focal, 0, (width - 1) / 2], [0, focal, height * 0.45], [0, 0, 1]])
    cos, sin = np.cos(np.radians(toward_deg)), np.sin(np.radians(toward_deg))
    right_down_ahead = np.array([[sin, 0, cos], [-cos, 0, sin], [0, -1, 0]])
    return Camera(channel, width, height, intrinsic, transform(right_down_ahead, list(place)))


def down(
    points_m: list[tuple[float, float]], height_m: float = 5.5
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return vertical rays onto points."""
    origins = np.array([[x, y, height_m] for x, y in points_m], np.float32)
    return origins, np.tile(np.array([0, 0, -1], np.float32), (len(origins), 1))
