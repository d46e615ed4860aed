"""Light sources: sun and sky of a weather, sky visibility in the town, street lamps, vehicle lamps."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from appocc.checks import ByteArray, Float32Array, FloatArray
from appocc.geometry import inverse
from appocc.simulation.mesh import Material, Mesh
from appocc.simulation.rendering.compiled import kernel
from appocc.simulation.rendering.sky import mean_light, sky_map, sun_direction
from appocc.simulation.rendering.tracing import Tracer
from appocc.simulation.rendering.weather import Weather
from appocc.simulation.surface import Ground
from appocc.simulation.town import Town
from appocc.simulation.traffic import Light

OPEN_CELL_M, LAMP_CELL_M, NEAR_CELL_M = 2.0, 1.0, 0.25
NEAR_CELLS = 640
_LAMP_REACH_M, _BEAM_REACH_M = 28.0, 30.0
_PROBES = 20


class Lighting(NamedTuple):
    """Light of a scene in the form the kernels take; a white surface has the value of its irradiance.

    Attributes:
        sun_to: (3,) unit direction to the sun.
        sun: (3,) irradiance of a surface that faces the sun.
        up: (3,) irradiance of a horizontal surface by the open sky.
        bounce: (3,) light reflected by the ground.
        sky: sky map, see `sky_at`.
        horizon: (3,) colour of the haze.
        haze_per_m: extinction per metre.
        wetness: 0..1.
        lamps: strength of lamps, 0 if all are off.
        white: radiance that appears white in the image; lamps are scaled by it.
        low_x: lower corner of `open` and `lamp`, metres.
        low_y: lower corner of `open` and `lamp`, metres.
        open: (Y, X) float32 visible share of the sky; cells of OPEN_CELL_M.
        lamp: (Y, X) float32 light of the street lamps on the ground; cells of LAMP_CELL_M.
        near_x: lower corner of `near`, metres.
        near_y: lower corner of `near`, metres.
        near: (NEAR_CELLS, NEAR_CELLS, 3) float32 around the ego: sky visibility under vehicles, light of head lamps,
            red light of tail lamps; cells of NEAR_CELL_M.
        ego_from_town: (3, 4) float32.
        ego_box: (4,) float32 length, width, height of the ego, x of its centre in the ego frame; zeros without ego.
        noise: noise tile.
    """

    sun_to: Float32Array
    sun: Float32Array
    up: Float32Array
    bounce: Float32Array
    sky: Float32Array
    horizon: Float32Array
    haze_per_m: float
    wetness: float
    lamps: float
    white: float
    low_x: float
    low_y: float
    open: Float32Array
    lamp: Float32Array
    near_x: float
    near_y: float
    near: Float32Array
    ego_from_town: Float32Array
    ego_box: Float32Array
    noise: Float32Array


@dataclass(frozen=True, eq=False)
class EgoBody:
    """The vehicle that carries the cameras: it casts shadow and light, but has no mesh.

    Attributes:
        town_from_ego: (4, 4) pose of the ego frame (rear axle, on the ground).
        size_lwh_m: length, width, height of its box.
        lights: `traffic.Light` bits.
    """

    town_from_ego: FloatArray
    size_lwh_m: tuple[float, float, float]
    lights: int = 0

    @property
    def centre_x_m(self) -> float:
        """Distance of the box centre ahead of the rear axle: a fifth of the length overhangs behind it."""
        return 0.3 * self.size_lwh_m[0]


@dataclass(frozen=True, eq=False)
class Sky:
    """Sky and sun of a weather, computed once per weather."""

    weather: Weather
    radiance: Float32Array
    up: Float32Array
    bounce: Float32Array
    sun_to: Float32Array

    @staticmethod
    def build(weather: Weather, tile: Float32Array) -> Sky:
        """Build the sky of a weather."""
        radiance, toward = sky_map(weather, tile), sun_direction(weather)
        up = mean_light(radiance)
        ground = up + np.asarray(weather.sun, np.float32) * max(float(toward[2]), 0.0)
        return Sky(weather, radiance, up, (0.16 * ground).astype(np.float32), toward)


@dataclass(frozen=True, eq=False)
class TownLight:
    """Light that depends on the town alone: see `Lighting.open` and `Lighting.lamp`."""

    low_m: FloatArray
    open: Float32Array
    lamp: Float32Array

    @staticmethod
    def compute(town: Town, tracer: Tracer) -> TownLight:
        """Compute the sky visibility and the light of the street lamps of a town."""
        extent = np.array(town.ground.label.shape[::-1]) * 0.1
        return TownLight(town.ground.low_m, _open_sky(town.ground, extent, tracer), _lamp_light(town, extent))


def _open_sky(ground: Ground, extent_m: FloatArray, tracer: Tracer) -> Float32Array:
    """Return the share of upward rays, cosine-weighted, that leave the town from the centre of each cell."""
    columns, rows = np.ceil(extent_m / OPEN_CELL_M).astype(int)
    x = ground.low_m[0] + (np.arange(columns) + 0.5) * OPEN_CELL_M
    y = ground.low_m[1] + (np.arange(rows) + 0.5) * OPEN_CELL_M
    origins = np.stack([*(a.ravel() for a in np.meshgrid(x, y)), np.full(rows * columns, 0.3)], 1).astype(np.float32)
    free = np.zeros(len(origins), np.float32)
    for probe in range(_PROBES):
        # Golden-angle spiral with cosine-weighted directions.
        around, height = probe * 2.39996, math.sqrt(1 - (probe + 0.5) / _PROBES)
        flat = math.sqrt(1 - height * height)
        toward = np.array([flat * math.cos(around), flat * math.sin(around), height], np.float32)
        free += ~tracer.blocked(origins, np.tile(toward, (len(origins), 1)))
    share = (free / _PROBES).reshape(rows, columns)
    # There is no sky inside buildings; walls use the value of the ground before them.
    share = np.where(share == 0, cv2.dilate(share, np.ones((3, 3), np.uint8)), share)
    return np.asarray(cv2.GaussianBlur(share, (0, 0), 0.8), np.float32)


def _lamp_light(town: Town, extent_m: FloatArray) -> Float32Array:
    columns, rows = np.ceil(extent_m / LAMP_CELL_M).astype(int)
    light = np.zeros((rows, columns), np.float32)
    for lamp in town.lamps_m:
        place = (lamp[:2] - town.ground.low_m) / LAMP_CELL_M
        reach = int(_LAMP_REACH_M / LAMP_CELL_M)
        left, low = max(int(place[0]) - reach, 0), max(int(place[1]) - reach, 0)
        right, high = min(int(place[0]) + reach + 1, columns), min(int(place[1]) + reach + 1, rows)
        if left >= right or low >= high:
            continue
        y, x = np.mgrid[low:high, left:right] + 0.5
        flat2 = ((x - place[0]) ** 2 + (y - place[1]) ** 2) * LAMP_CELL_M**2
        window = np.clip(1 - flat2 / _LAMP_REACH_M**2, 0, 1) ** 2
        light[low:high, left:right] += 22.0 * lamp[2] / (flat2 + lamp[2] ** 2) ** 1.5 * window
    return light


def near_light(
    actors: Mesh, actor_lights: ByteArray, ego: EgoBody | None, lamps: float, middle_m: FloatArray
) -> Float32Array:
    """Compute shade under actors and the light of their lamps around a point (2,): see `Lighting.near`.

    Args:
        actors: mesh of the actors.
        actor_lights: (A,) `traffic.Light` bits by index of the actor.
        ego: the vehicle without a mesh; it emits light, but does not darken the ground below it, which BEV maps show.
        lamps: strength of lamps, 0 if all are off.
        middle_m: (2,) centre of the map.
    """
    corner = near_corner(middle_m)
    low = np.zeros((NEAR_CELLS, NEAR_CELLS), np.float32)
    _mark_low_parts(actors.vertices_m, actors.faces, corner.astype(np.float32), low)
    near = np.zeros((NEAR_CELLS, NEAR_CELLS, 3), np.float32)
    # Most of the sky is hidden right below a vehicle, and some of it half a metre from it.
    near[..., 0] = 1 - 0.62 * cv2.blur(low, (3, 3)) - 0.34 * cv2.blur(cv2.blur(low, (7, 7)), (5, 5))
    if lamps > 0:
        beams = _beams(actors, actor_lights, ego)
        _add_beams(near, corner.astype(np.float32), beams)
    return near


def near_corner(middle_m: FloatArray) -> FloatArray:
    """Return the (2,) lower corner of the near map, aligned to whole cells so that shades do not flicker."""
    return np.round(np.asarray(middle_m) / NEAR_CELL_M) * NEAR_CELL_M - NEAR_CELLS // 2 * NEAR_CELL_M


def _beams(actors: Mesh, actor_lights: ByteArray, ego: EgoBody | None) -> Float32Array:
    """Return (B, 6) position and direction on the ground, head and tail lamp strength of each actor with lamps."""
    found = []
    for material, channel in ((Material.HEAD_LAMP, 4), (Material.TAIL_LAMP, 5)):
        faces = np.flatnonzero(actors.material == material)
        tag = actors.tag[faces]
        faces, tag = faces[(tag >= 0) & (tag < len(actor_lights))], tag[(tag >= 0) & (tag < len(actor_lights))]
        faces, tag = faces[(actor_lights[tag] & Light.PARKED) == 0], tag[(actor_lights[tag] & Light.PARKED) == 0]
        places = actors.vertices_m[actors.faces[faces]].mean(1)[:, :2]
        normals = actors.normals[actors.faces[faces]].mean(1)[:, :2]
        for number in np.unique(tag):
            own = tag == number
            beam = np.zeros(6)
            beam[:2], beam[2:4] = places[own].mean(0), normals[own].mean(0)
            beam[2:4] /= max(float(np.hypot(*beam[2:4])), 1e-6)
            beam[channel] = 1.0 if channel == 4 or not actor_lights[number] & Light.BRAKE else 2.5
            found.append(beam)
    if ego is not None:  # its head lamps are computed exactly, see `illumination`
        ahead, middle = ego.town_from_ego[:2, 0], ego.town_from_ego[:2, 3]
        half = ego.size_lwh_m[0] / 2
        brake = 2.5 if ego.lights & Light.BRAKE else 1.0
        found.append(np.array([*(middle + ahead * (ego.centre_x_m - half)), *-ahead, 0.0, brake]))
    return np.array(found, np.float32).reshape(-1, 6)


def inverse_pose(target_from_source: FloatArray) -> Float32Array:
    """Return (3, 4) float32 of the inverse of a pose."""
    return np.ascontiguousarray(inverse(target_from_source)[:3], np.float32)


@kernel
def _mark_low_parts(
    vertices: Float32Array, faces: NDArray[np.int32], corner: Float32Array, low: Float32Array
) -> None:
    """Mark the cells below parts that are less than a metre above the ground."""
    for face in range(len(faces)):
        a, b, c = vertices[faces[face, 0]], vertices[faces[face, 1]], vertices[faces[face, 2]]
        if min(a[2], b[2], c[2]) > 0.9 or max(abs(a[0] - corner[0] - 80), abs(a[1] - corner[1] - 80)) > 85:
            continue
        reach = max(abs(a[0] - b[0]), abs(a[1] - b[1]), abs(a[0] - c[0]), abs(a[1] - c[1]))
        steps = min(int(reach / 0.2) + 1, 24)
        for i in range(steps + 1):
            for j in range(steps + 1 - i):
                p, q = i / steps, j / steps
                x = a[0] + p * (b[0] - a[0]) + q * (c[0] - a[0]) - corner[0]
                y = a[1] + p * (b[1] - a[1]) + q * (c[1] - a[1]) - corner[1]
                column, row = int(x * 4.0), int(y * 4.0)
                if 0 <= column < low.shape[1] and 0 <= row < low.shape[0]:
                    low[row, column] = 1.0


@kernel
def _add_beams(near: Float32Array, corner: Float32Array, beams: Float32Array) -> None:
    """Add the light of lamps (see `_beams`) on the ground: low beams ahead, a red glow behind."""
    cells = int(30.0 / 0.25)
    for beam in range(len(beams)):
        column, row = int((beams[beam, 0] - corner[0]) * 4.0), int((beams[beam, 1] - corner[1]) * 4.0)
        reach = cells if beams[beam, 4] > 0 else cells // 4
        for r in range(max(row - reach, 0), min(row + reach, near.shape[0])):
            for c in range(max(column - reach, 0), min(column + reach, near.shape[1])):
                x, y = corner[0] + (c + 0.5) * 0.25 - beams[beam, 0], corner[1] + (r + 0.5) * 0.25 - beams[beam, 1]
                ahead, aside = x * beams[beam, 2] + y * beams[beam, 3], x * beams[beam, 3] - y * beams[beam, 2]
                if ahead <= 0.0:
                    continue
                if beams[beam, 4] > 0:
                    spread = aside / (1.2 + 0.28 * ahead)
                    fade = max(1 - ahead / 30.0, 0.0)
                    near[r, c, 1] += (
                        beams[beam, 4] * 1.6 * math.exp(-spread * spread) * fade * fade * ahead / (ahead + 3.0)
                    )
                else:
                    far2 = x * x + y * y
                    near[r, c, 2] += beams[beam, 5] * 0.14 * ahead / (far2 + 1.0) * max(1 - far2 / 56.0, 0.0)
