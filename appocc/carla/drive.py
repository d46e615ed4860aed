"""A drive through a CARLA town, as a log of key frames."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from random import Random
from typing import Any

import cv2
import numpy as np

from appocc.bevmap import bev_path
from appocc.camera import CameraRig
from appocc.carla.actors import Ego, spawn_ego, spawn_traffic
from appocc.carla.boxes import Seen, is_near, moving_objects, standing_objects, visible_share
from appocc.carla.frames import carla_transform, pose_of
from appocc.carla.roads import Roads
from appocc.carla.sensors import (
    EGO_FROM_LIDAR,
    Cut,
    Sensors,
    add_cameras,
    add_lidar,
    cut_of,
    depth_of,
    kinds_of,
    picture_of,
    points_of,
)
from appocc.carla.server import Server
from appocc.carla.truth import Above, exact_map
from appocc.checks import FloatArray
from appocc.colours import WORDS, word_probabilities
from appocc.importers.log import Frame, Image, Sweep
from appocc.nuscenes.dataset import LIDAR
from appocc.nuscenes.view_reduction import reduce_view
from appocc.nuscenes.view_targets import save_view_targets, view_targets_path
from appocc.nuscenes.writer import Writer, token_of, visibility_token
from appocc.rigs import SourceRig

SOURCE = "exact"
_START_US, _SCENE_US = 1_700_000_000_000_000, 3_600_000_000
# Simulated time before the first key frame, in which vehicles come down onto the road and drive off.
_SETTLING_S = 3.0
# The map of a drive reaches so far around its way.
_MAP_M = 100.0
_QUALITY = 95


@dataclass(frozen=True)
class DriveSettings:
    """What is recorded.

    Attributes:
        scenes: number of drives.
        frames: key frames of each.
        hz: key frames per second of simulated time.
        vehicles: number of other vehicles, as far as there are places for them.
        walkers: number of people.
        seed: random seed of places, vehicles and paints; the server's own behaviour is not repeatable.
    """

    scenes: int
    frames: int
    hz: float
    vehicles: int
    walkers: int
    seed: int


class Drive:
    """A drive, see `appocc.importers.Log`; its key frames can be read once."""

    def __init__(self, server: Server, roads: Roads, rig: CameraRig, settings: DriveSettings, number: int) -> None:
        """Prepare a drive; `number` is its place among all."""
        self._server, self._roads, self._settings, self._number = server, roads, settings, number
        self._rig = rig.with_cameras(cut_of(camera).camera for camera in rig)
        self._way: list[FloatArray] = []
        self._painted: set[str] = set()

    @property
    def name(self) -> str:
        """Name of the scene."""
        return f"scene-{self._number:04d}"

    @property
    def description(self) -> str:
        """Source of the drive."""
        return f"{self._server.town}, CARLA"

    @property
    def vehicle(self) -> str:
        """Simulated."""
        return "carla"

    @property
    def location(self) -> str:
        """Town and drive: each drive has a map of its own."""
        return f"{self._server.town}-{self.name}"

    @property
    def frames_in_total(self) -> int:
        """Number of key frames."""
        return self._settings.frames

    def rig(self) -> SourceRig:
        """Return the cameras as they are recorded."""
        return SourceRig.of_pinholes(self._rig)

    def ego_from_lidar(self) -> FloatArray:
        """Return the pose of the LiDAR."""
        return EGO_FROM_LIDAR

    def frames(self) -> Iterator[Frame]:
        """Drive, and yield the key frames."""
        server, settings = self._server, self._settings
        random = Random(f"{settings.seed}/{self._number}")
        server.traffic.set_random_device_seed(random.randrange(1 << 31))
        server.world.set_pedestrians_seed(random.randrange(1 << 31))
        ego = spawn_ego(server, random)
        spawn_traffic(server, random, settings.vehicles, settings.walkers)
        for _ in range(round(_SETTLING_S / server.delta_s)):
            server.tick()
        sensors = Sensors.none(server)
        cuts = add_cameras(sensors, self._rig, ego.actor, ego.vehicle_from_ego)
        add_lidar(sensors, ego.actor, ego.vehicle_from_ego, LIDAR)
        above = Above.added(sensors)
        steps = round(1 / settings.hz / server.delta_s)
        for number in range(settings.frames):
            for _ in range(steps - 1):
                sensors.read(server.tick())
            above.move(
                pose_of(ego.actor.get_transform()) @ ego.vehicle_from_ego, partial(carla_transform, server.carla)
            )
            yield self._frame(number, sensors.read(server.tick()), ego, cuts)
        server.clear()

    def write_map(self, writer: Writer, log: str) -> None:
        """Write the roads around the way that was driven."""
        way = np.array(self._way)
        self._roads.near(way.min(axis=0) - _MAP_M, way.max(axis=0) + _MAP_M).write(self.location, writer, log)

    def notes(self) -> tuple[str, ...]:
        """Return what is only nearly exact."""
        return ("lines are whole where CARLA paints dashes; colours from above are those of a camera 250 m up",)

    @cached_property
    def _standing(self) -> list[Seen]:
        return standing_objects(self._server.carla, self._server.world)

    def _frame(self, number: int, data: Mapping[str, Any], ego: Ego, cuts: Mapping[str, Cut]) -> Frame:
        world = self._server.world
        snapshot = world.get_snapshot()
        pose = pose_of(snapshot.find(ego.actor.id).get_transform()) @ ego.vehicle_from_ego
        self._way.append(pose[:2, 3])
        time_us = _START_US + self._number * _SCENE_US + round(number / self._settings.hz * 1e6)
        depths = {channel: cut.part(depth_of(data[f"{channel}/depth"])) for channel, cut in cuts.items()}
        views = [(cut.camera, depths[channel]) for channel, cut in cuts.items()]
        objects = self._objects(snapshot, ego, pose)
        shares = [visible_share(each.box, pose, views) for each in objects]
        boxes = tuple(
            replace(each.box, visibility=visibility_token(share)) for each, share in zip(objects, shares, strict=True)
        )
        images = tuple(
            Image(channel, time_us, pose, partial(_jpeg, cut.part(picture_of(data[f"{channel}/rgb"]))))
            for channel, cut in cuts.items()
        )
        kinds = {channel: cut.part(kinds_of(data[f"{channel}/kind"])) for channel, cut in cuts.items()}

        def more(writer: Writer, sample: str) -> None:
            targets = {
                channel: reduce_view(np.ascontiguousarray(depths[channel]), kinds[channel]) for channel in cuts
            }
            save_view_targets(view_targets_path(writer.root, sample), targets)
            scene = token_of("scene", self.name)
            instances = [token_of("instance", scene, box.instance) for box in boxes]
            made, extra = exact_map(pose, self._roads, boxes, instances, ego.body, data)
            made.save(bev_path(writer.root, SOURCE, sample), extra)
            self._add_paints(writer, objects, instances)

        return Frame(time_us, images, Sweep(time_us, pose, partial(points_of, data[LIDAR])), boxes, more)

    def _objects(self, snapshot: Any, ego: Ego, pose: FloatArray) -> list[Seen]:
        centre = pose[:3, 3]
        found = list(moving_objects(self._server.world.get_actors(), snapshot, int(ego.actor.id), centre))
        return found + [each for each in self._standing if is_near(each.box, centre)]

    def _add_paints(self, writer: Writer, objects: Sequence[Seen], instances: Sequence[str]) -> None:
        for each, token in zip(objects, instances, strict=True):
            if each.rgb is not None and token not in self._painted:
                self._painted.add(token)
                word = WORDS[int(word_probabilities(each.rgb).argmax())]
                writer.add_extra("paint", token, instance_token=token, rgb=list(each.rgb), name=word, body=each.body)


def _jpeg(picture: Any) -> bytes:
    coded = cv2.imencode(".jpg", picture[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])[1]
    return bytes(coded.tobytes())
