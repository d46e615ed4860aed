"""A hand-made town: flat ground with a road along x, one wall, and box-shaped actors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from appocc.camera import Camera, CameraRig
from appocc.checks import FloatArray
from appocc.geometry import transform
from appocc.simulation.mesh import Material, Mesh, join_meshes
from appocc.simulation.network import RoadNetwork
from appocc.simulation.plan import TownPlan
from appocc.simulation.rendering.tracing import Tracer
from appocc.simulation.surface import Ground, Surface
from appocc.simulation.town import Town, TownMap
from appocc.simulation.traffic import Actor, TrafficState

# Ground from (-50, -50) to (50, 50); the road's centre line is y = 0, 8 m wide; a white line along y = 0.
LOW_M, CELLS = -50.0, 1000
_FACES = np.array([[0, 3, 2], [0, 2, 1], [4, 5, 6], [4, 6, 7]])  # below, above
_SIDES = np.array([[0, 4, 7], [0, 7, 3], [1, 5, 4], [1, 4, 0], [2, 6, 5], [2, 5, 1], [3, 7, 6], [3, 6, 2]])


class Street(NamedTuple):
    """A town, its actors, and the tracer of both."""

    town: Town
    actors: tuple[Actor, ...]
    state: TrafficState
    mesh: Mesh
    tracer: Tracer


def box_mesh(
    centre_m: Sequence[float],
    size_lwh_m: Sequence[float],
    yaw_rad: float = 0.0,
    material: Material = Material.PLAIN,
    tint: tuple[int, int, int] = (128, 128, 128),
    tag: int = -1,
) -> Mesh:
    """A box centred at a point; normals outward, corners not shared."""
    signs = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]], np.float64)
    corners = np.array([[*xy, z] for z in (-1.0, 1.0) for xy in signs]) * np.array(size_lwh_m) / 2
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    corners = corners @ np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]]) + np.array(centre_m)
    faces = np.concatenate([_FACES, _SIDES[:, [0, 2, 1]]])
    points = corners[faces]
    normals = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    count = len(faces)
    return Mesh(
        vertices_m=points.reshape(-1, 3).astype(np.float32),
        normals=np.repeat(normals, 3, axis=0).astype(np.float32),
        uv=np.zeros((3 * count, 2), np.float32),
        faces=np.arange(3 * count, dtype=np.int32).reshape(-1, 3),
        material=np.full(count, material, np.uint8),
        tint=np.tile(np.array(tint, np.uint8), (count, 1)),
        tag=np.full(count, tag, np.int32),
    )


def made_ground() -> Ground:
    """Grass with a road 8 m wide along x, a white line 0.2 m wide in its middle."""
    label = np.full((CELLS, CELLS), Surface.GRASS, np.uint8)
    label[460:540] = Surface.ROAD
    label[499:501] = Surface.LINE_WHITE
    colours = np.zeros((256, 3), np.uint8)
    colours[Surface.GRASS], colours[Surface.ROAD] = (70, 110, 50), (80, 80, 84)
    colours[Surface.LINE_WHITE] = 235
    return Ground(np.array([LOW_M, LOW_M]), label, colours[label])


def made_town(solid: Mesh) -> Town:
    """Return a town of the ground of `made_ground` and a static mesh."""
    nowhere = np.zeros(2)
    network = RoadNetwork(
        edges=(), inner_lanes=(), junctions=(), connections=(), low_m=nowhere, high_m=nowhere, offset_m=nowhere
    )
    return Town(TownPlan("made", 0, "old", network), made_ground(), solid, np.zeros((0, 3)), TownMap((), (), (), ()))


def made_street(
    rows: Sequence[tuple[str, str, tuple[float, float, float], float, float, float]], solid: Mesh | None = None
) -> Street:
    """Actors of rows (kind, body, size l w h, x, y, yaw), as boxes of their size, next to a wall at y = 8..9."""
    wall = box_mesh((10, 8.5, 2), (20, 1, 4), material=Material.BRICK)
    town = made_town(wall if solid is None else solid)
    actors = tuple(Actor(f"actor-{i}", kind, body, size) for i, (kind, body, size, *_) in enumerate(rows))
    places = np.array([row[3:] for row in rows], np.float64).reshape(-1, 3)
    mesh = join_meshes(
        [
            box_mesh((x, y, actor.size_lwh_m[2] / 2), actor.size_lwh_m, yaw, Material.PAINT, (180, 20, 20), i)
            for i, (actor, (x, y, yaw)) in enumerate(zip(actors, places, strict=True))
        ]
    )
    count = len(rows)
    state = TrafficState(
        np.arange(count),
        places[:, :2],
        places[:, 2],
        np.zeros((count, 2)),
        np.zeros(count, np.uint8),
        np.zeros(0, np.uint8),
    )
    tracer = Tracer(town.solid)
    tracer.set_actors(mesh)
    return Street(town, actors, state, mesh, tracer)


def looking(channel: str, yaw_rad: float, place_m: Sequence[float], wide: int = 640, high: int = 360) -> Camera:
    """A camera with a field of view of 90 degrees that faces a yaw in the ego frame."""
    focal = wide / 2
    intrinsic = np.array([[focal, 0, (wide - 1) / 2], [0, focal, (high - 1) / 2], [0, 0, 1]])
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    ego_from_cam = transform(np.array([[sin, 0, cos], [-cos, 0, sin], [0, -1, 0]]), np.array(place_m))
    return Camera(channel, wide, high, intrinsic, ego_from_cam)


def made_rig() -> CameraRig:
    """Four cameras around the ego."""
    return CameraRig(
        tuple(
            looking(name, yaw, (1.0, 0.0, 1.6))
            for name, yaw in (
                ("CAM_FRONT", 0.0),
                ("CAM_LEFT", np.pi / 2),
                ("CAM_BACK", np.pi),
                ("CAM_RIGHT", -np.pi / 2),
            )
        )
    )


def pixel_rays(camera: Camera, town_from_ego: FloatArray) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Rays through all pixel centres, row by row: origins and unit directions (H * W, 3), town frame."""
    v, u = np.indices((camera.height_px, camera.width_px)).reshape(2, -1)
    inside = np.stack([u, v, np.ones(len(u))], axis=1) @ np.linalg.inv(camera.intrinsic).T
    pose = town_from_ego @ camera.ego_from_cam
    towards = inside / np.linalg.norm(inside, axis=1, keepdims=True) @ pose[:3, :3].T
    return np.tile(pose[:3, 3], (len(u), 1)).astype(np.float32), towards.astype(np.float32)
