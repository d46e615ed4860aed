"""Render what the cameras of a vehicle see in a town."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from appocc.camera import CameraRig
from appocc.checks import BoolArray, ByteArray, Float32Array, FloatArray
from appocc.rigs.source_camera import SourceCamera
from appocc.simulation.mesh import Material, Mesh, join_meshes
from appocc.simulation.rendering import camera_response
from appocc.simulation.rendering.compiled import kernel
from appocc.simulation.rendering.lighting import (
    EgoBody,
    Lighting,
    Sky,
    TownLight,
    inverse_pose,
    near_corner,
    near_light,
)
from appocc.simulation.rendering.look import Look
from appocc.simulation.rendering.noise import noise_tile
from appocc.simulation.rendering.pixel_rays import LensRays, PinholeRays, PixelRays
from appocc.simulation.rendering.profile import RenderProfile
from appocc.simulation.rendering.rays import GROUND_KINDS, label_pixels
from appocc.simulation.rendering.refining import (
    blend_extra_rays,
    blend_reflections,
    find_jagged_pixels,
    reflect_wet_ground,
)
from appocc.simulation.rendering.scene_buffers import SceneBuffers
from appocc.simulation.rendering.shading import shade
from appocc.simulation.rendering.sunlight import find_sunlit
from appocc.simulation.rendering.texture import build_texture
from appocc.simulation.rendering.tracing import ACTOR, Hits, Tracer
from appocc.simulation.rendering.views import CameraView, PixelMaps
from appocc.simulation.rendering.weather import WEATHERS, Weather
from appocc.simulation.town import Town

_CHUNK = 1 << 17
# Three extra rays for pixels with edges; together with the centre they form a rotated pattern.
_SHIFTS_PX = ((0.36, 0.10), (-0.27, 0.26), (-0.09, -0.36))


class Renderer:
    """Renders one town; `set_scene` sets actors, lamps and weather."""

    def __init__(self, town: Town) -> None:
        """Prepare everything that depends on the town alone."""
        self._town = town
        self._look: Look | None = None
        self._scenery = town.solid
        self.tracer = Tracer(town.solid)
        self._buffers = SceneBuffers(town.solid)
        self._texture = build_texture(town.ground)
        self._noise = noise_tile(town.plan.seed)
        self._town_light = TownLight.compute(town, self.tracer)
        self._actor_lights, self._signals = np.zeros(0, np.uint8), np.zeros(0, np.uint8)
        self._sky = Sky.build(WEATHERS["clear"], self._noise)
        self.profile = RenderProfile()
        self.set_scene(join_meshes([]), self._actor_lights, self._signals, WEATHERS["clear"], None)

    def set_look(self, look: Look | None) -> None:
        """Set the materials of the town for the next scenes; None is as built."""
        if look is self._look:
            return
        if look is not None:
            self.set_look(None)  # frees the colours of the former look
        with self.profile.stage("look"):
            ground, tint = self._town.ground, self._town.solid.tint
            if look is not None:
                ground = look.recolour_ground(ground, self._noise)
                kind = self._buffers.triangles.kind[: self._buffers.town_faces]
                tint = look.recolour_scenery(self._town.solid, kind)
            self._texture = build_texture(ground)
            self._buffers.set_town_tints(tint)
        self._look = look

    def set_scenery(self, solid: Mesh) -> None:
        """Move the static scenery for the next scenes: a mesh with the faces of the town's."""
        if solid is self._scenery:
            return
        with self.profile.stage("look"):
            self.tracer.set_solid(solid)
        self._scenery = solid

    def set_scene(
        self, actors: Mesh, lights: ByteArray, signals: ByteArray, weather: Weather, ego: EgoBody | None
    ) -> None:
        """Set the scene of the next images.

        Args:
            actors: all actors except the ego, town frame; the tag is the index of the actor.
            lights: (A,) `traffic.Light` bits by index of the actor.
            signals: (S,) letters of the traffic lights as ASCII, in the order of `signal_links`.
            weather: light and atmosphere.
            ego: the vehicle that carries the cameras, None if there is none.
        """
        with self.profile.stage("scene"):
            self.tracer.set_actors(actors)
            self._buffers.set_actors(actors)
            self._actor_lights, self._signals = np.array(lights, np.uint8), np.array(signals, np.uint8)
            if weather != self._sky.weather:
                self._sky = Sky.build(weather, self._noise)
            middle = ego.town_from_ego[:2, 3] if ego else _centre_of(actors)
            self._light = self._lighting(
                near_light(actors, self._actor_lights, ego, weather.lamps, middle), middle, ego
            )

    @property
    def gains(self) -> Float32Array:
        """(3,) exposure and white balance of the weather, for `camera_response.tone_map`."""
        return camera_response.exposure_gains(self._sky.weather, self._sky.up)

    def views(self, rig: CameraRig, town_from_ego: FloatArray, rng: np.random.Generator) -> Mapping[str, CameraView]:
        """Render images and pixel maps of a rig by channel; `rng` generates the noise."""
        return {camera.channel: self._render_view(PinholeRays(camera, town_from_ego), rng) for camera in rig}

    def lens_images(
        self, cameras: Iterable[SourceCamera], town_from_ego: FloatArray, rng: np.random.Generator
    ) -> dict[str, ByteArray]:
        """Render the pictures (H, W, 3) uint8 of cameras with any lenses, by name; black where they see nothing."""
        return {camera.name: self._render_view(LensRays(camera, town_from_ego), rng).image for camera in cameras}

    def maps(self, rig: CameraRig, town_from_ego: FloatArray) -> dict[str, PixelMaps]:
        """Return the pixel maps of a rig by channel, without images."""
        found = {}
        for camera in rig:
            pinhole, shape = PinholeRays(camera, town_from_ego), (camera.height_px, camera.width_px)
            flat = PixelMaps.empty(shape)
            for rows, pixels in _chunks(pinhole):
                origins, directions = pinhole.rays(pixels, 0.0, 0.0)
                self._label(self._trace(origins, directions), origins, directions, pinhole, flat.rows(rows))
            found[camera.channel] = flat.shaped(shape)
        return found

    def radiance(
        self, origins: Float32Array, directions: Float32Array, spread_rad: float, see_through_leaves: bool = False
    ) -> Float32Array:
        """Return the radiance (N, 3) float32 linear, without haze, along unit rays (N, 3), town frame.

        Args:
            origins: (N, 3) float32 start of the rays.
            directions: (N, 3) float32 unit.
            spread_rad: angular width of a pixel.
            see_through_leaves: whether to skip foliage.
        """
        origins = np.require(origins, np.float32, ["C", "W"])
        directions = np.require(directions, np.float32, ["C", "W"])
        result = np.empty((len(origins), 3), np.float32)
        clear = self._light._replace(haze_per_m=0.0)
        for start in range(0, len(origins), _CHUNK):
            rows = slice(start, start + _CHUNK)
            hits = self._trace(origins[rows], directions[rows])
            if see_through_leaves:
                hits = self._behind_leaves(origins[rows], directions[rows], hits)
            self._shade(hits, origins[rows], directions[rows], spread_rad, clear, result[rows])
        return result

    def _render_view(self, camera: PixelRays, rng: np.random.Generator) -> CameraView:
        shape = (camera.height_px, camera.width_px)
        linear, maps = np.empty((shape[0] * shape[1], 3), np.float32), PixelMaps.empty(shape)
        for rows, pixels in _chunks(camera):
            origins, directions = camera.rays(pixels, 0.0, 0.0)
            hits = self._trace(origins, directions)
            self._label(hits, origins, directions, camera, maps.rows(rows))
            lit = self._shade(hits, origins, directions, camera.spread_rad, self._light, linear[rows])
            self._antialias(camera, linear[rows], hits.source, lit=lit, first_pixel=rows.start)
        if camera.blind is not None:
            linear[camera.blind] = 0.0
        with self.profile.stage("response"):
            glow = 0.05 if self._sky.weather.lamps > 0 else 0.0
            image = camera_response.apply_response(linear.reshape(*shape, 3), self.gains, glow, rng)
        return CameraView(image, *maps.shaped(shape))

    def _label(
        self, hits: Hits, origins: Float32Array, directions: Float32Array, camera: PixelRays, maps: PixelMaps
    ) -> None:
        """Write the maps of the hits of rays."""
        with self.profile.stage("maps"):
            label_pixels(
                hits.distance_m, hits.source, hits.face, origins, directions, camera.ahead, self._buffers.triangles,
                self._texture, GROUND_KINDS, *maps,
            )  # fmt: skip

    def _antialias(
        self, camera: PixelRays, linear: Float32Array, source: ByteArray, lit: BoolArray, first_pixel: int
    ) -> None:
        """Antialias the edges in some rows of an image by extra rays."""
        with self.profile.stage("refine"):
            gain = float(self.gains.mean())
            pixels = find_jagged_pixels(linear, gain, source, lit, camera.width_px)
        self.profile.count["refined"] += len(pixels)
        self.profile.count["pixels"] += len(linear)
        if not len(pixels):
            return
        parts = [camera.rays(pixels + np.int32(first_pixel), u, v) for u, v in _SHIFTS_PX]
        origins, directions = (np.concatenate(part) for part in zip(*parts, strict=True))
        more = np.empty((len(origins), 3), np.float32)
        for start in range(0, len(origins), _CHUNK):
            rows = slice(start, start + _CHUNK)
            hits = self._trace(origins[rows], directions[rows])
            self._shade(hits, origins[rows], directions[rows], camera.spread_rad, self._light, more[rows])
        blend_extra_rays(linear, pixels, more, len(_SHIFTS_PX), 4.0 / gain)

    def _trace(self, origins: Float32Array, directions: Float32Array) -> Hits:
        """Trace rays; faces are numbered as in the scene buffers."""
        with self.profile.stage("trace"):
            hits = self.tracer.nearest(origins, directions)
            _offset_faces(hits.source, hits.face, self._buffers.town_faces)
        return hits

    def _behind_leaves(self, origins: Float32Array, directions: Float32Array, hits: Hits) -> Hits:
        """Replace hits on foliage by the hits behind it."""
        for _ in range(12):
            leaves = np.flatnonzero(
                (hits.face >= 0) & (self._buffers.triangles.material[hits.face] == Material.FOLIAGE)
            )
            if not len(leaves):
                break
            passed = hits.distance_m[leaves] + np.float32(0.02)
            further = self._trace(
                origins[leaves] + passed[:, None] * directions[leaves], np.ascontiguousarray(directions[leaves])
            )
            hits.distance_m[leaves] = further.distance_m + passed
            hits.source[leaves], hits.face[leaves], hits.uv[leaves] = further.source, further.face, further.uv
        return hits

    def _shade(
        self,
        hits: Hits,
        origins: Float32Array,
        directions: Float32Array,
        spread_rad: float,
        light: Lighting,
        radiance: Float32Array,
    ) -> BoolArray:
        """Write the radiance (N, 3) along rays; return (N,) whether their hits are sunlit."""
        lit = self._find_sunlit(hits, origins, directions, light)
        self._shade_hits(hits, origins, directions, lit, spread_rad, light=light, radiance=radiance)
        if light.wetness > 0:
            with self.profile.stage("wet"):
                numbers, shares, starts, ways = reflect_wet_ground(
                    hits.distance_m,
                    hits.source,
                    origins,
                    directions,
                    self._texture,
                    self._noise,
                    float(light.wetness),
                )
            image, seen = np.empty((len(numbers), 3), np.float32), self._trace(starts, ways)
            self._shade_hits(
                seen, starts, ways, self._find_sunlit(seen, starts, ways, light), 0.02, light=light, radiance=image
            )
            blend_reflections(radiance, numbers, shares, image)
        return lit

    def _find_sunlit(self, hits: Hits, origins: Float32Array, directions: Float32Array, light: Lighting) -> BoolArray:
        """Return (N,) whether the hits of rays are sunlit."""
        with self.profile.stage("shadow"):
            lit = np.zeros(len(origins), np.bool_)
            if light.sun.any():
                numbers, starts = np.empty(len(lit), np.int32), np.empty((len(lit), 3), np.float32)
                count = find_sunlit(
                    hits.distance_m, hits.source, hits.face, hits.uv, origins, directions, self._buffers.triangles,
                    light, numbers, starts,
                )  # fmt: skip
                self.profile.count["shadow"] += count
                lit[numbers[:count]] = ~self.tracer.blocked(starts[:count], np.tile(light.sun_to, (count, 1)))
        return lit

    def _shade_hits(
        self,
        hits: Hits,
        origins: Float32Array,
        directions: Float32Array,
        lit: BoolArray,
        spread_rad: float,
        light: Lighting,
        radiance: Float32Array,
    ) -> None:
        with self.profile.stage("shade"):
            self.profile.count["shaded"] += len(lit)
            shade(
                hits.distance_m, hits.source, hits.face, hits.uv, origins, directions, lit, spread_rad,
                self._buffers.triangles, self._texture, light, self._actor_lights, self._signals, radiance,
            )  # fmt: skip

    def _lighting(self, near: Float32Array, middle_m: FloatArray, ego: EgoBody | None) -> Lighting:
        weather, town_light, corner = self._sky.weather, self._town_light, near_corner(middle_m)
        box = (*ego.size_lwh_m, ego.centre_x_m) if ego else (0.0, 0.0, 0.0, 0.0)
        return Lighting(
            sun_to=self._sky.sun_to,
            sun=np.array(weather.sun, np.float32),
            up=self._sky.up,
            bounce=self._sky.bounce,
            sky=self._sky.radiance,
            horizon=np.array(weather.horizon, np.float32),
            haze_per_m=float(weather.haze_per_m),
            wetness=float(weather.wetness),
            lamps=float(weather.lamps),
            white=float(1 / self.gains.mean()),
            low_x=float(town_light.low_m[0]),
            low_y=float(town_light.low_m[1]),
            open=town_light.open,
            lamp=town_light.lamp,
            near_x=float(corner[0]),
            near_y=float(corner[1]),
            near=near,
            ego_from_town=inverse_pose(ego.town_from_ego if ego else np.eye(4)),
            ego_box=np.array(box, np.float32),
            noise=self._noise,
        )


def _chunks(camera: PixelRays) -> Iterator[tuple[slice, NDArray[np.int32]]]:
    """Iterate over the pixels of a camera in whole rows."""
    total, step = camera.width_px * camera.height_px, max(_CHUNK // camera.width_px, 1) * camera.width_px
    for start in range(0, total, step):
        stop = min(start + step, total)
        yield slice(start, stop), np.arange(start, stop, dtype=np.int32)


def _centre_of(actors: Mesh) -> FloatArray:
    """Return the (2,) centre of all actors."""
    places = actors.vertices_m[:, :2].astype(np.float64)
    return np.asarray(places.mean(0)) if len(places) else np.zeros(2)


@kernel
def _offset_faces(source: ByteArray, face: NDArray[np.int32], town_faces: int) -> None:
    """Offset the actors' faces by the number of town faces."""
    for i in range(len(source)):
        if source[i] == ACTOR:
            face[i] += town_faces
