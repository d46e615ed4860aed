"""Record one simulated scene in the nuScenes schema: images, LiDAR, boxes, map and exact ground truth."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from appocc.bevmap import BEVMap, bev_path
from appocc.camera import CameraRig
from appocc.checks import ByteArray, FloatArray, IntArray
from appocc.files import write_bytes, write_image, write_json
from appocc.geometry import quaternion_from_yaw, transform
from appocc.grid import BEVGrid
from appocc.nuscenes.dataset import LIDAR
from appocc.nuscenes.lidar import write_lidar
from appocc.nuscenes.map_writer import MapExpansion
from appocc.nuscenes.view_reduction import reduce_view
from appocc.nuscenes.view_targets import ViewTargets, save_view_targets, view_targets_path
from appocc.nuscenes.writer import Writer, token_of
from appocc.rigs import SourceRig
from appocc.simulation.actors.assembling import assemble
from appocc.simulation.actors.paint import ActorPaint, draw_paints
from appocc.simulation.build import build_town
from appocc.simulation.mesh import Mesh
from appocc.simulation.rendering.birdseye import render_birdseye
from appocc.simulation.rendering.lidar import EGO_FROM_LIDAR, simulate_sweep
from appocc.simulation.rendering.lighting import EgoBody
from appocc.simulation.rendering.renderer import Renderer
from appocc.simulation.rendering.views import CameraView, PixelMaps
from appocc.simulation.rendering.weather import draw_weather
from appocc.simulation.scenario import Scenario, describe_scenario
from appocc.simulation.scenery.signals import signal_names
from appocc.simulation.sources import TownSource
from appocc.simulation.surface import ROAD_SURFACES, surface_table
from appocc.simulation.town import Town
from appocc.simulation.traffic import Actor, TrafficLog, TrafficState
from appocc.simulation.truth.annotations import annotate
from appocc.simulation.truth.objects import ActorBoxes, category_indices, count_lidar_points, objects_near
from appocc.simulation.truth.occupancy import exact_occupancy
from appocc.simulation.truth.visibility import visible_shares
from appocc.simulation.variation.scene import SceneVariation, draw_variation
from appocc.simulation.variation.slope import lean_scenery
from appocc.simulation.variation.traffic import vary_traffic

VERSION, SOURCE = "v1.0-simulation", "exact"
# Pictures as the lenses of a rig take them: RAW/SCENE/FRAME/CAMERA.jpg, for `appocc infer RAW/SCENE --rig`.
RAW = "raw"
_START_US, _SCENE_US = 1_700_000_000_000_000, 3_600_000_000
# Boxes are annotated, and vehicles in the map get instances, within this range of the ego.
_ANNOTATED_M = 80.0
# Share of a vehicle's length behind its rear axle.
_REAR_OVERHANG = 0.2


@dataclass(frozen=True)
class RecordingSettings:
    """What is recorded of a scene.

    Attributes:
        frames: samples per scene.
        hz: samples per second.
        rig: cameras.
        lidar: whether every sample has a LiDAR sweep.
        full_maps: whether depth, class and actor of every pixel are stored, in addition to those of 8x8 blocks.
        vary: whether cameras, traffic, paints, materials and light vary, see `draw_variation` and `vary_traffic`.
        source: cameras with other lenses, whose pictures are rectified to the rig and kept; None for pinholes.
    """

    frames: int
    hz: float
    rig: CameraRig
    lidar: bool = True
    full_maps: bool = False
    vary: bool = False
    source: SourceRig | None = None

    def as_json(self) -> dict[str, Any]:
        """Return JSON values that identify the settings."""
        cameras = {
            camera.channel: {
                "size_px": [camera.width_px, camera.height_px],
                "intrinsic": camera.intrinsic.tolist(),
                "ego_from_cam": camera.ego_from_cam.tolist(),
            }
            for camera in self.rig
        }
        return {
            "frames": self.frames,
            "hz": self.hz,
            "lidar": self.lidar,
            "full_maps": self.full_maps,
            "rig": cameras,
            **({"vary": True} if self.vary else {}),
            **({} if self.source is None else {"lenses": self.source.as_json()}),
        }


@dataclass(frozen=True, eq=False)
class TownSimulation:
    """A town with its traffic, ready to be recorded.

    Attributes:
        town: static scene.
        log: recorded traffic.
        renderer: renderer of the town.
        signal_column: (S,) column of the log's signals for each lamp of the town, -1 if it has none.
        category: (A,) nuScenes category of each actor.
    """

    town: Town
    log: TrafficLog
    renderer: Renderer
    signal_column: IntArray
    category: ByteArray

    def with_log(self, log: TrafficLog) -> TownSimulation:
        """Return the same town with other traffic under the same signals."""
        return replace(self, log=log, category=category_indices(log.actors))


@lru_cache(maxsize=1)
def build_town_simulation(source: TownSource, folder: Path) -> TownSimulation:
    """Build a town with its renderer; each process caches the last one."""
    plan, log = source.load(folder)
    town = build_town(plan)
    columns = {name: column for column, name in enumerate(log.signal_links)}
    signal_column = np.array([columns.get(name, -1) for name in signal_names(plan.network)], np.int64)
    return TownSimulation(town, log, Renderer(town), signal_column, category_indices(log.actors))


def record_scene(
    scenario: Scenario,
    simulation: TownSimulation,
    recording: RecordingSettings,
    writer: Writer,
    advance: Callable[[float], None],
) -> None:
    """Write a scene's files below the writer's root and its rows into the writer; `advance` is called once per frame.

    Map files, which all scenes of a town share, are written by `write_map`.

    Raises:
        DataError: if a file cannot be written.
    """
    recorder = _Recorder(scenario, simulation, recording, writer)
    samples = []
    for number in range(recording.frames):
        samples.append(recorder.add_sample(number))
        advance(1)
    log = token_of("log", scenario.town)
    date = str(np.datetime64(_START_US // 1_000_000, "s").astype("datetime64[D]"))
    writer.add("log", log, logfile=scenario.town, vehicle="simulated", date_captured=date, location=scenario.town)
    description = describe_scenario(scenario, simulation.log.actors[scenario.ego])
    writer.add_scene(scenario.name, description, log, samples)
    name = _mask_name(scenario.town)
    writer.add("map", token_of("map", scenario.town), category="semantic_prior", filename=name, log_tokens=[log])


class _Recorder:
    """Renders and writes the samples of a scene."""

    def __init__(
        self, scenario: Scenario, simulation: TownSimulation, recording: RecordingSettings, writer: Writer
    ) -> None:
        if recording.vary:
            seconds = (recording.frames - 1) / recording.hz
            simulation = simulation.with_log(vary_traffic(simulation.log, simulation.town, scenario, seconds))
        self._scenario, self._simulation, self._recording, self._writer = scenario, simulation, recording, writer
        self._scene = token_of("scene", scenario.name)
        seed = np.random.SeedSequence([*scenario.random_seed, 1]).generate_state(1)
        self._variation = self._draw_variation()
        self._paints: tuple[ActorPaint, ...] = draw_paints(
            simulation.log.actors, int(seed[0]), self._variation.rare_paints
        )
        self._world_from_town = transform(np.eye(3), [*(-simulation.town.ground.low_m), 0.0])
        self._calibration = {
            camera.channel: writer.add_sensor(scenario.name, camera.channel, camera.ego_from_cam, camera.intrinsic)
            for camera in self._variation.rig
        }
        if recording.lidar:
            self._calibration[LIDAR] = writer.add_sensor(scenario.name, LIDAR, EGO_FROM_LIDAR)
        self._painted: set[str] = set()
        simulation.renderer.set_look(self._variation.look)
        simulation.renderer.set_scenery(lean_scenery(simulation.town.solid, self._variation.slope))

    def _draw_variation(self) -> SceneVariation:
        seed, rig = self._scenario.random_seed, self._recording.rig
        weather = draw_weather(self._scenario.weather, np.random.default_rng([*seed, 2]))
        source = self._recording.source
        if not self._recording.vary:
            return SceneVariation(rig, weather, source=source)
        return draw_variation(rig, weather, [*seed, 4], source)

    def add_sample(self, number: int) -> str:
        """Record frame `number`; return the sample's token."""
        scenario, simulation = self._scenario, self._simulation
        seconds = number / self._recording.hz
        timestamp = _START_US + scenario.number * _SCENE_US + round(seconds * 1e6)
        sample = token_of("sample", scenario.name, number)
        self._writer.add("sample", sample, timestamp=timestamp, scene_token=self._scene, prev="", next="")
        state = simulation.log.state_at(scenario.start_s + seconds)
        pose = ego_pose(simulation.log.actors[scenario.ego], state, scenario.ego)
        objects = objects_near(simulation.log.actors, state, pose[:2, 3], _ANNOTATED_M, scenario.ego)
        mesh = assemble(simulation.log.actors, state, self._paints, pose[:2, 3], scenario.ego)
        self._set_scene(state, mesh, pose)
        random = np.random.default_rng([*scenario.random_seed, 3, number])
        self._add_views(sample, number, timestamp, pose, random)
        points = self._add_sweep(sample, timestamp, pose, mesh, objects, random)
        self._add_boxes(sample, pose, mesh, objects, points)
        self._add_bev(sample, pose, objects)
        return sample

    def _set_scene(self, state: TrafficState, mesh: Mesh, pose: FloatArray) -> None:
        simulation = self._simulation
        lights = np.zeros(len(simulation.log.actors), np.uint8)
        lights[state.index] = state.lights
        letters = np.append(state.signals, np.uint8(ord("O")))  # lamps without a column are off
        ego = EgoBody(pose, simulation.log.actors[self._scenario.ego].size_lwh_m)
        simulation.renderer.set_scene(mesh, lights, letters[simulation.signal_column], self._variation.weather, ego)

    def _add_views(
        self, sample: str, number: int, timestamp: int, pose: FloatArray, random: np.random.Generator
    ) -> None:
        """Write the images of a sample, all taken at the time of the sample, and their pixel maps."""
        images, maps = self._images_and_maps(number, pose, random)
        for channel, image in images.items():
            filename = f"samples/{channel}/{self._scenario.name}__{channel}__{timestamp}.jpg"
            write_image(self._writer.root / filename, image)
            size = (image.shape[1], image.shape[0])
            self._add_file(sample, channel, pose, timestamp, filename, size)
        small = {channel: reduce_view(view.depth_m, view.kind) for channel, view in maps.items()}
        save_view_targets(view_targets_path(self._writer.root, sample), small)
        if self._recording.full_maps:
            full = {channel: ViewTargets(view.depth_m, view.kind) for channel, view in maps.items()}
            save_view_targets(self._writer.root / "views_full" / f"{sample}.npz", full)

    def _images_and_maps(
        self, number: int, pose: FloatArray, random: np.random.Generator
    ) -> tuple[Mapping[str, ByteArray], Mapping[str, CameraView | PixelMaps]]:
        """Return the images and pixel maps by channel; write the pictures of cameras with other lenses."""
        renderer, rig, source = self._simulation.renderer, self._variation.rig, self._variation.source
        if source is None:
            views = renderer.views(rig, pose, random)
            return {channel: view.image for channel, view in views.items()}, views
        pictures = renderer.lens_images(source.cameras, pose, random)
        folder = self._writer.root / RAW / self._scenario.name / f"{number:04d}"
        for name, picture in pictures.items():
            write_image(folder / f"{name}.jpg", picture)
        return source.rectify(pictures), renderer.maps(rig, pose)

    def _add_file(
        self,
        sample: str,
        channel: str,
        pose: FloatArray,
        timestamp: int,
        name: str,
        size_px: tuple[int, int] = (0, 0),
    ) -> str:
        world_from_ego = self._world_from_town @ pose
        calibration = self._calibration[channel]
        return self._writer.add_file(
            sample, channel, calibration, world_from_ego, timestamp, filename=name, size_px=size_px
        )

    def _add_sweep(
        self,
        sample: str,
        timestamp: int,
        pose: FloatArray,
        mesh: Mesh,
        objects: ActorBoxes,
        random: np.random.Generator,
    ) -> IntArray:
        """Write the LiDAR sweep with its labels; return the number of points on each object, -1 without a LiDAR."""
        if not self._recording.lidar:
            return np.full(len(objects), -1)
        simulation, root = self._simulation, self._writer.root
        found = simulate_sweep(simulation.renderer.tracer, simulation.town, mesh, simulation.category, pose, random)
        filename = f"samples/{LIDAR}/{self._scenario.name}__{LIDAR}__{timestamp}.pcd.bin"
        write_lidar(root / filename, found.points.astype(np.float64))
        token = self._add_file(sample, LIDAR, pose, timestamp, filename)
        labels = f"lidarseg/{VERSION}/{token}_lidarseg.bin"
        write_bytes(root / labels, found.category.tobytes())
        self._writer.add_extra("lidarseg", token, sample_data_token=token, filename=labels)
        return count_lidar_points(found.actor, objects.number)

    def _add_boxes(self, sample: str, pose: FloatArray, mesh: Mesh, objects: ActorBoxes, points: IntArray) -> None:
        seen = visible_shares(self._simulation.renderer.tracer, mesh, objects.number, self._variation.rig, pose)
        boxes = annotate(objects, self._world_from_town, points, seen)
        for box, number, velocity in zip(boxes, objects.number, objects.velocity_mps, strict=True):
            self._writer.add_annotation(self._scene, sample, box, velocity_mps=velocity)
            if box.instance not in self._painted:
                self._painted.add(box.instance)
                self._add_paint(box.instance, int(number))

    def _add_paint(self, instance: str, number: int) -> None:
        paint, actor = self._paints[number], self._simulation.log.actors[number]
        token = token_of("instance", self._scene, instance)
        self._writer.add_extra(
            "paint", token, instance_token=token, rgb=list(paint.rgb), name=paint.name, body=actor.body
        )

    def _add_bev(self, sample: str, pose: FloatArray, objects: ActorBoxes) -> None:
        grid, simulation = BEVGrid.surround(), self._simulation
        truth = exact_occupancy(simulation.town.ground, grid, pose, objects)
        above = render_birdseye(simulation.renderer, simulation.town, grid, pose)
        tokens = [token_of("instance", self._scene, actor.name) for actor in objects.actors]
        position = np.full(len(simulation.log.actors) + 1, -1, np.int32)
        position[objects.number] = np.arange(len(objects))
        meta = {"source": "simulated", "weather": self._scenario.weather, "instances": tokens}
        bev = BEVMap(grid, truth.occupancy, truth.valid, above.appearance, above.valid, meta)
        more: dict[str, NDArray[np.generic]] = {
            "instance": position[truth.vehicle],
            "appearance_covered": above.covered,
        }
        bev.save(bev_path(self._writer.root, SOURCE, sample), more)


def ego_pose(actor: Actor, state: TrafficState, number: int) -> FloatArray:
    """Return (4, 4) town_from_ego of an actor: rear axle on the ground, x forward."""
    row = int(np.flatnonzero(state.index == number)[0])
    back = actor.size_lwh_m[0] * (0.5 - _REAR_OVERHANG)
    yaw = float(state.yaw_rad[row])
    x, y = state.xy_m[row] - back * np.array([np.cos(yaw), np.sin(yaw)])
    return transform(quaternion_from_yaw(yaw), [x, y, 0.0])


def write_map(town: Town, name: str, root: Path) -> None:
    """Write the vector map of a town, and the drivable-area mask for nuScenes' own tools, if they do not exist.

    The world origin is the lower corner of the town's ground.

    Raises:
        DataError: if a file cannot be written.
    """
    mask = root / _mask_name(name)
    if mask.is_file():  # written last
        return
    low = town.ground.low_m
    lines, made = town.map, MapExpansion(name)
    for outline in lines.drivable:
        made.add_drivable(outline - low)
    for layer, found in (("lane_divider", lines.lane_dividers), ("road_divider", lines.road_dividers)):
        for line in found:
            made.add_line(layer, line - low)
    for kind, outlines in (("YIELD", lines.stop_lines), ("TRAFFIC_LIGHT", lines.light_lines)):
        for outline in outlines:
            made.add_area("stop_line", outline - low, stop_line_type=kind)
    for outline in lines.junctions:
        made.add_area("road_segment", outline - low, is_intersection=True)
    for layer, outlines in (("ped_crossing", lines.crossings), ("carpark_area", lines.car_parks)):
        for outline in outlines:
            made.add_area(layer, outline - low)
    write_json(root / "maps" / "expansion" / f"{name}.json", made.tables, indent=None)
    drivable = surface_table(ROAD_SURFACES)[town.ground.label[::-1]]
    write_image(mask, np.ascontiguousarray(drivable.astype(np.uint8) * 255))


def _mask_name(town: str) -> str:
    return f"maps/{token_of('map', town)}.png"
