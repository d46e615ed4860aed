"""A spinning LiDAR with 32 beams as in nuScenes: points, intensity, ring, category and actor of each point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from appocc.checks import ByteArray, Float32Array, FloatArray, frozen
from appocc.geometry import transform
from appocc.nuscenes.writer import CATEGORIES
from appocc.simulation.mesh import Material, Mesh
from appocc.simulation.rendering.tracing import ACTOR, GROUND, SKY, TOWN, Hits, Tracer
from appocc.simulation.surface import CELL_M, ROAD_SURFACES, Ground, Surface
from appocc.simulation.town import Town

# nuScenes: x to the right, y forward; mounted above the roof.
EGO_FROM_LIDAR = transform(np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]]), [0.94, 0.0, 1.84])
BEAMS_RAD = np.radians(np.linspace(-30.67, 10.67, 32))
# Closer returns are suppressed.
_NEAREST_M = 1.0
# Range at which a surface of 10 % reflectance that faces the sensor returns half of all shots.
_REACH_M = 70.0
_OF_NOISE_M = 0.02
# Infrared reflectance of a white surface of a material.
_REFLECTANCE = np.full(len(Material), 0.5, np.float32)
_REFLECTANCE[[Material.FOLIAGE, Material.HEDGE]] = 1.3  # foliage is bright in the infrared
_REFLECTANCE[[Material.GLASS, Material.WINDOW, Material.SHOPFRONT]] = 0.12
_REFLECTANCE[[Material.RUBBER, Material.TRIM]] = 0.35
_REFLECTANCE[[Material.CLOTH, Material.SKIN]] = 0.7
# Retro-reflectors, independent of their tint: brighter than any white wall.
_RETRO = np.zeros(len(Material), np.float32)
_RETRO[[Material.SIGN, Material.PLATE, Material.HEAD_LAMP, Material.TAIL_LAMP]] = 2.2, 1.6, 0.9, 1.2
# Smooth surfaces reflect most of the light away from the sensor unless they face it.
_SMOOTH = np.zeros(len(Material), np.bool_)
_SMOOTH[[Material.PAINT, Material.GLASS, Material.WINDOW, Material.SHOPFRONT, Material.CHROME]] = True
_MARKINGS = tuple(s for s in Surface if s >= Surface.ZEBRA)
_OUTSIDE = Surface.GRASS


@dataclass(frozen=True, eq=False)
class LidarSweep:
    """P points of one revolution, by column (clockwise from behind), and within a column from the lowest beam up.

    Attributes:
        points: (P, 5) float32 x, y, z in metres, intensity 0..255, ring 0 (lowest) .. 31; LiDAR frame.
        category: (P,) uint8 index in nuScenes' `CATEGORIES` (nuScenes-lidarseg).
        actor: (P,) int32 index of the actor that was hit, -1 for none.
    """

    points: Float32Array
    category: ByteArray
    actor: NDArray[np.int32]

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        for array in (self.points, self.category, self.actor):
            frozen(array)


def simulate_sweep(
    tracer: Tracer,
    town: Town,
    actors_mesh: Mesh,
    actor_category: ByteArray,
    town_from_ego: FloatArray,
    random: np.random.Generator | None,
    columns: int = 1080,
    range_m: float = 90.0,
) -> LidarSweep:
    """Simulate one revolution of the LiDAR, without motion during it.

    Args:
        tracer: tracer of the town with `actors_mesh` set, without the ego.
        town: ground and static scenery.
        actors_mesh: faces of all actors; the tag is the index of the actor.
        actor_category: (A,) category of each actor of the log, see `truth.objects.category_indices`.
        town_from_ego: (4, 4) pose.
        random: random generator of noise and dropouts; None for exact points without dropouts.
        columns: shots of each beam per revolution.
        range_m: maximum range.
    """
    beams, ring = _directions(columns)
    town_from_lidar = town_from_ego @ EGO_FROM_LIDAR
    towards = (beams @ town_from_lidar[:3, :3].T).astype(np.float32)
    start = np.broadcast_to(town_from_lidar[:3, 3].astype(np.float32), towards.shape)
    hits = tracer.nearest(np.ascontiguousarray(start), towards)
    keep = np.flatnonzero((hits.source != SKY) & (hits.distance_m >= _NEAREST_M) & (hits.distance_m <= range_m))
    hits = Hits(hits.distance_m[keep], hits.source[keep], hits.face[keep], hits.uv[keep])
    towards, beams, ring = towards[keep], beams[keep], ring[keep]
    surface = _HitSurfaces.look_up(hits, start[keep] + towards * hits.distance_m[:, None], towards, town, actors_mesh)
    distance = hits.distance_m.astype(np.float64)
    intensity = surface.intensity()
    if random is not None:
        returned = surface.back * (_REACH_M / distance) ** 2 * 6.9
        found = random.random(len(distance)) < 1 - np.exp(-returned)
        distance = distance + random.normal(0.0, _OF_NOISE_M, len(distance))
        intensity = np.clip(
            intensity * random.normal(1.0, 0.1, len(distance)) + random.normal(0, 1, len(distance)), 0, 255
        )
    else:
        found = np.ones(len(distance), np.bool_)
    points = np.concatenate([beams * distance[:, None], np.round(intensity)[:, None], ring[:, None]], axis=1)
    category = surface.category
    hit_actor = surface.actor >= 0
    category[hit_actor] = actor_category[surface.actor[hit_actor]]
    return LidarSweep(points[found].astype(np.float32), category[found], surface.actor[found])


def _directions(columns: int) -> tuple[FloatArray, FloatArray]:
    """Return unit directions (columns * 32, 3) in the LiDAR frame and their rings."""
    turn = -np.pi / 2 - 2 * np.pi * np.arange(columns) / columns
    across, up = np.cos(BEAMS_RAD), np.sin(BEAMS_RAD)
    beams = np.stack(
        [
            np.cos(turn)[:, None] * across,
            np.sin(turn)[:, None] * across,
            np.broadcast_to(up, (columns, len(up))),
        ],
        axis=2,
    )
    return beams.reshape(-1, 3), np.tile(np.arange(float(len(up))), columns)


@dataclass(frozen=True, eq=False)
class _HitSurfaces:
    """Surfaces hit by the rays: reflected share, category and actor, all (P,)."""

    back: FloatArray
    category: ByteArray
    actor: NDArray[np.int32]

    @classmethod
    def look_up(
        cls, hits: Hits, place: Float32Array, towards: Float32Array, town: Town, actors_mesh: Mesh
    ) -> _HitSurfaces:
        """Look up the surfaces at hits, at points (P, 3) in the town, hit along directions (P, 3)."""
        count = len(place)
        back, facing = np.empty(count), np.empty(count)
        category, actor = np.empty(count, np.uint8), np.full(count, -1, np.int32)
        on = hits.source == GROUND
        back[on], category[on] = _ground(town.ground, place[on])
        facing[on] = -towards[on, 2]
        for source, mesh in ((TOWN, town.solid), (ACTOR, actors_mesh)):
            on = hits.source == source
            face = hits.face[on]
            back[on] = _mesh_back(mesh, face, towards[on], facing, on)
            category[on] = _CATEGORY_OF_MATERIAL[mesh.material[face]]
            if source == ACTOR:
                actor[on] = mesh.tag[face]
        # Rough ground also reflects at grazing angles.
        return cls(back * (0.35 + 0.65 * np.clip(facing, 0, 1)), category, actor)

    def intensity(self) -> FloatArray:
        """Return (P,) intensity on nuScenes' scale: about 100 at most for matt surfaces, 255 for retro-reflectors."""
        return np.asarray(np.clip(100 * self.back, 0, 255))


def _lightness(rgb: NDArray[np.uint8]) -> FloatArray:
    """Return linear brightness 0..1 of sRGB colours (N, 3)."""
    return np.asarray((rgb.astype(np.float64) / 255) ** 2.2 @ [0.3, 0.5, 0.2])


def _ground(ground: Ground, place: Float32Array) -> tuple[FloatArray, ByteArray]:
    """Return reflected share and category of points (N, 3) on the ground."""
    cell = np.floor((place[:, :2] - ground.low_m) / CELL_M).astype(np.int64)
    inside = ((cell >= 0) & (cell < ground.label.shape[::-1])).all(axis=1)
    label = np.full(len(place), _OUTSIDE, np.uint8)
    lightness = np.full(len(place), 0.2)
    east, north = cell[inside].T
    label[inside] = ground.label[north, east]
    lightness[inside] = _lightness(ground.colour[north, east])
    return lightness * _BACK_OF_GROUND[label], _CATEGORY_OF_GROUND[label]


def _mesh_back(
    mesh: Mesh, face: NDArray[np.int32], towards: Float32Array, facing: FloatArray, on: NDArray[np.bool_]
) -> FloatArray:
    """Return the reflected share of faces (N,) hit along directions (N, 3); write their cosines into `facing[on]`."""
    a, b, c = (mesh.vertices_m[mesh.faces[face, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1)
    cosine = np.abs((normal * towards).sum(axis=1)) / np.maximum(length, 1e-12)
    facing[on] = cosine
    material = mesh.material[face]
    back = _REFLECTANCE[material] * (0.1 + 0.9 * _lightness(mesh.tint[face])) + _RETRO[material]
    smooth = _SMOOTH[material]
    back[smooth] *= 0.15 + 1.2 * cosine[smooth] ** 4
    return np.asarray(back, np.float64)


def _table(fill: str, **named: tuple[int, ...]) -> ByteArray:
    """Return (256,) uint8 indices in `CATEGORIES`."""
    table = np.full(256, CATEGORIES.index(fill), np.uint8)
    for name, entries in named.items():
        table[list(entries)] = CATEGORIES.index(name.replace("__", "."))
    return table


_CATEGORY_OF_GROUND = _table(
    "flat.terrain",
    flat__driveable_surface=tuple(int(s) for s in ROAD_SURFACES),
    flat__sidewalk=(Surface.PAVEMENT, Surface.KERB),
    flat__other=(Surface.YARD,),
)
_CATEGORY_OF_MATERIAL = _table("static.manmade", static__vegetation=(Material.FOLIAGE, Material.BARK, Material.HEDGE))
_BACK_OF_GROUND = np.full(256, 1.0)
_BACK_OF_GROUND[[Surface.GRASS]] = 2.5
_BACK_OF_GROUND[list(_MARKINGS)] = 1.2
