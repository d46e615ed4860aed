"""One simulated scene written in the nuScenes schema: pictures, LiDAR, boxes, map and exact truth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
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
from appocc.nuscenes.view_targets import ViewTargets, save_view_targets, view_targets_path
from appocc.nuscenes.writer import Writer, token_of
from appocc.simulation.actors.assembling import assemble
from appocc.simulation.actors.paint import Paint, paints_of
from appocc.simulation.build import build_town
from appocc.simulation.mesh import Mesh
from appocc.simulation.rendering.birdseye import birdseye
from appocc.simulation.rendering.lidar import EGO_FROM_LIDAR, sweep
from appocc.simulation.rendering.lighting import Ego
from appocc.simulation.rendering.renderer import Renderer
from appocc.simulation.rendering.weather import drawn
from appocc.simulation.scenario import Scenario, description_of
from appocc.simulation.scenery.signals import signal_names
from appocc.simulation.sources import TownSource
from appocc.simulation.surface import ROAD_SURFACES, surface_table
from appocc.simulation.town import Town
from appocc.simulation.traffic import Actor, Moment, TrafficLog
from appocc.simulation.truth.annotations import annotate
from appocc.simulation.truth.auxiliary import reduced
from appocc.simulation.truth.objects import Objects, category_indices, objects_near, points_on
from appocc.simulation.truth.occupancy import occupancy
from appocc.simulation.truth.visibility import seen_shares

VERSION, SOURCE = "v1.0-simulation", "exact"
_START_US, _SCENE_US = 1_700_000_000_000_000, 3_600_000_000
# Boxes are annotated, and vehicles in the map told apart, within this range of the ego.
_ANNOTATED_M = 80.0
# Share of a vehicle's length that lies behind its rear axle.
_REAR_OVERHANG = 0.2


@dataclass(frozen=True)
class Recipe:
    """What is recorded of a scene.

    Attributes:
        frames: samples of a scene.
        hz: samples a second.
        rig: cameras.
        lidar: whether every sample has a LiDAR sweep.
        full_maps: whether depth, class and actor of every pixel are kept, beside those of every 8x8 pixels.
    """

    frames: int
    hz: float
    rig: CameraRig
    lidar: bool = True
    full_maps: bool = False

    def as_json(self) -> dict[str, Any]:
        """JSON values that tell recipes apart."""
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
        }


@dataclass(frozen=True)
class Place:
    """A town ready to be recorded.

    Attributes:
        town: what stands.
        log: who moves.
        renderer: of the town.
        signal_column: (S,) column of the log's signals for each lamp of the town, -1 where it has none.
        category: (A,) nuScenes category of each actor.
    """

    town: Town
    log: TrafficLog
    renderer: Renderer
    signal_column: IntArray
    category: ByteArray


@lru_cache(maxsize=1)
def build_place(source: TownSource, folder: Path) -> Place:
    """Build a town; a process keeps the one it built last."""
    plan, log = source.load(folder)
    town = build_town(plan)
    columns = {name: column for column, name in enumerate(log.signal_links)}
    signal_column = np.array([columns.get(name, -1) for name in signal_names(plan.network)], np.int64)
    return Place(town, log, Renderer(town), signal_column, category_indices(log.actors))


def record_scene(
    scenario: Scenario, place: Place, recipe: Recipe, writer: Writer, advance: Callable[[float], None]
) -> None:
    """Write a scene's files below the writer's root and its rows into the writer; `advance` is called a frame.

    The files of its map, which are the same in every scene of a town, are left to `write_map`.

    Raises:
        DataError: if a file cannot be written.
    """
    recorder = _Recorder(scenario, place, recipe, writer)
    samples = []
    for number in range(recipe.frames):
        samples.append(recorder.add_sample(number))
        advance(1)
    log = token_of("log", scenario.town)
    date = str(np.datetime64(_START_US // 1_000_000, "s").astype("datetime64[D]"))
    writer.add("log", log, logfile=scenario.town, vehicle="simulated", date_captured=date, location=scenario.town)
    description = description_of(scenario, place.log.actors[scenario.ego])
    writer.add_scene(scenario.name, description, log, samples)
    name = _mask_name(scenario.town)
    writer.add("map", token_of("map", scenario.town), category="semantic_prior", filename=name, log_tokens=[log])


class _Recorder:
    """Renders and writes the samples of a scene."""

    def __init__(self, scenario: Scenario, place: Place, recipe: Recipe, writer: Writer) -> None:
        self._scenario, self._place, self._recipe, self._writer = scenario, place, recipe, writer
        self._scene = token_of("scene", scenario.name)
        seed = np.random.SeedSequence([*scenario.random_seed, 1]).generate_state(1)
        self._paints: tuple[Paint, ...] = paints_of(place.log.actors, int(seed[0]))
        self._weather = drawn(scenario.weather, np.random.default_rng([*scenario.random_seed, 2]))
        self._world_from_town = transform(np.eye(3), [*(-place.town.ground.low_m), 0.0])
        self._calibration = {
            camera.channel: writer.add_sensor(scenario.name, camera.channel, camera.ego_from_cam, camera.intrinsic)
            for camera in recipe.rig
        }
        if recipe.lidar:
            self._calibration[LIDAR] = writer.add_sensor(scenario.name, LIDAR, EGO_FROM_LIDAR)
        self._painted: set[str] = set()

    def add_sample(self, number: int) -> str:
        """Record the frame of a number; returns the sample's token."""
        scenario, place = self._scenario, self._place
        seconds = number / self._recipe.hz
        timestamp = _START_US + scenario.number * _SCENE_US + round(seconds * 1e6)
        sample = token_of("sample", scenario.name, number)
        self._writer.add("sample", sample, timestamp=timestamp, scene_token=self._scene, prev="", next="")
        moment = place.log.at(scenario.start_s + seconds)
        pose = ego_pose(place.log.actors[scenario.ego], moment, scenario.ego)
        objects = objects_near(place.log.actors, moment, pose[:2, 3], _ANNOTATED_M, scenario.ego)
        mesh = assemble(place.log.actors, moment, self._paints, pose[:2, 3], scenario.ego)
        self._set(moment, mesh, pose)
        random = np.random.default_rng([*scenario.random_seed, 3, number])
        self._add_views(sample, timestamp, pose, random)
        points = self._add_sweep(sample, timestamp, pose, mesh, objects, random)
        self._add_boxes(sample, pose, mesh, objects, points)
        self._add_bev(sample, pose, objects)
        return sample

    def _set(self, moment: Moment, mesh: Mesh, pose: FloatArray) -> None:
        place = self._place
        lights = np.zeros(len(place.log.actors), np.uint8)
        lights[moment.index] = moment.lights
        letters = np.append(moment.signals, np.uint8(ord("O")))  # what has no column is off
        ego = Ego(pose, place.log.actors[self._scenario.ego].size_lwh_m)
        place.renderer.set_moment(mesh, lights, letters[place.signal_column], self._weather, ego)

    def _add_views(self, sample: str, timestamp: int, pose: FloatArray, random: np.random.Generator) -> None:
        """The pictures of a sample, all taken at its own time, and what is in their pixels."""
        views = self._place.renderer.views(self._recipe.rig, pose, random)
        for channel, view in views.items():
            filename = f"samples/{channel}/{self._scenario.name}__{channel}__{timestamp}.jpg"
            write_image(self._writer.root / filename, view.image)
            size = (view.image.shape[1], view.image.shape[0])
            self._add_file(sample, channel, pose, timestamp, filename, size)
        small = {channel: reduced(view.depth_m, view.kind) for channel, view in views.items()}
        save_view_targets(view_targets_path(self._writer.root, sample), small)
        if self._recipe.full_maps:
            full = {channel: ViewTargets(view.depth_m, view.kind) for channel, view in views.items()}
            save_view_targets(self._writer.root / "views_full" / f"{sample}.npz", full)

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
        return self._writer.add_file(sample, channel, calibration, world_from_ego, timestamp, name, size_px)

    def _add_sweep(
        self,
        sample: str,
        timestamp: int,
        pose: FloatArray,
        mesh: Mesh,
        objects: Objects,
        random: np.random.Generator,
    ) -> IntArray:
        """The LiDAR sweep with its labels; returns the points on each object, -1 where there is no LiDAR."""
        if not self._recipe.lidar:
            return np.full(len(objects), -1)
        place, root = self._place, self._writer.root
        found = sweep(place.renderer.tracer, place.town, mesh, place.category, pose, random)
        filename = f"samples/{LIDAR}/{self._scenario.name}__{LIDAR}__{timestamp}.pcd.bin"
        write_lidar(root / filename, found.points.astype(np.float64))
        token = self._add_file(sample, LIDAR, pose, timestamp, filename)
        labels = f"lidarseg/{VERSION}/{token}_lidarseg.bin"
        write_bytes(root / labels, found.category.tobytes())
        self._writer.add_extra("lidarseg", token, sample_data_token=token, filename=labels)
        return points_on(found.actor, objects.number)

    def _add_boxes(self, sample: str, pose: FloatArray, mesh: Mesh, objects: Objects, points: IntArray) -> None:
        seen = seen_shares(self._place.renderer.tracer, mesh, objects.number, self._recipe.rig, pose)
        boxes = annotate(objects, self._world_from_town, points, seen)
        for box, number, velocity in zip(boxes, objects.number, objects.velocity_mps, strict=True):
            self._writer.add_annotation(self._scene, sample, box, velocity_mps=velocity)
            if box.instance not in self._painted:
                self._painted.add(box.instance)
                self._add_paint(box.instance, int(number))

    def _add_paint(self, instance: str, number: int) -> None:
        paint, actor = self._paints[number], self._place.log.actors[number]
        token = token_of("instance", self._scene, instance)
        self._writer.add_extra(
            "paint", token, instance_token=token, rgb=list(paint.rgb), name=paint.name, body=actor.body
        )

    def _add_bev(self, sample: str, pose: FloatArray, objects: Objects) -> None:
        grid, place = BEVGrid.surround(), self._place
        truth = occupancy(place.town.ground, grid, pose, objects)
        above = birdseye(place.renderer, place.town, grid, pose)
        tokens = [token_of("instance", self._scene, actor.name) for actor in objects.actors]
        position = np.full(len(place.log.actors) + 1, -1, np.int32)
        position[objects.number] = np.arange(len(objects))
        meta = {"source": "simulated", "weather": self._scenario.weather, "instances": tokens}
        bev = BEVMap(grid, truth.occupancy, truth.valid, above.appearance, above.valid, meta)
        more: dict[str, NDArray[np.generic]] = {
            "instance": position[truth.vehicle],
            "appearance_covered": above.covered,
        }
        bev.save(bev_path(self._writer.root, SOURCE, sample), more)


def ego_pose(actor: Actor, moment: Moment, number: int) -> FloatArray:
    """(4, 4) town_from_ego of an actor: its rear axle on the ground, x forward."""
    row = int(np.flatnonzero(moment.index == number)[0])
    back = actor.size_lwh_m[0] * (0.5 - _REAR_OVERHANG)
    yaw = float(moment.yaw_rad[row])
    x, y = moment.xy_m[row] - back * np.array([np.cos(yaw), np.sin(yaw)])
    return transform(quaternion_from_yaw(yaw), [x, y, 0.0])


def write_map(town: Town, name: str, root: Path) -> None:
    """Write the vector map of a town, and the drivable-area mask of nuScenes' own tools, unless they are there.

    The world begins at the corner of the town's ground.

    Raises:
        DataError: if a file cannot be written.
    """
    mask = root / _mask_name(name)
    if mask.is_file():  # it is written last
        return
    low = town.ground.low_m
    lines, made = town.map, MapExpansion(name)
    for outline in lines.drivable:
        made.add_drivable(outline - low)
    for layer, found in (("lane_divider", lines.lane_dividers), ("road_divider", lines.road_dividers)):
        for line in found:
            made.add_line(layer, line - low)
    for outline in lines.stop_lines:
        made.add_stop_line(outline - low)
    write_json(root / "maps" / "expansion" / f"{name}.json", made.tables, indent=None)
    drivable = surface_table(ROAD_SURFACES)[town.ground.label[::-1]]
    write_image(mask, np.ascontiguousarray(drivable.astype(np.uint8) * 255))


def _mask_name(town: str) -> str:
    return f"maps/{token_of('map', town)}.png"
