"""The demo's dataset: the street rendered and written in the nuScenes schema."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from appocc.boxes import Boxes
from appocc.checks import FloatArray
from appocc.demo.bodies import Solid
from appocc.demo.ground import Ground, make_ground
from appocc.demo.maps import map_expansion, mask
from appocc.demo.render import picture, sweep
from appocc.demo.scene import BEAMS_RAD, EGO_FROM_LIDAR, VEHICLES, houses_along, rig, solids_at, street_from_ego
from appocc.demo.street import WORLD_FROM_STREET
from appocc.demo.vehicles import Vehicle
from appocc.files import write_image, write_json
from appocc.geometry import apply, transform
from appocc.nuscenes.dataset import LIDAR
from appocc.nuscenes.lidar import write_lidar
from appocc.nuscenes.maps import PX_PER_M
from appocc.nuscenes.writer import Annotation, Writer, token_of

VERSION, SCENE, LOCATION = "v1.0-demo", "plain-geometry", "plain-geometry-street"
DESCRIPTION = "synthetic street of plain boxes, ray cast; made by 'appocc demo', no simulator and no recording"
# Key frames come twice a second, LiDAR sweeps ten times.
SAMPLE_US, _SWEEP_US = 500_000, 100_000
_START_US = 1_700_000_000_000_000


@dataclass(frozen=True)
class Settings:
    """Size of the dataset: fewer and smaller pictures make it quicker.

    Attributes:
        samples: key frames, two a second.
        width_px: width of the pictures, which are 16:9.
        columns: LiDAR columns a turn.
        seed: of the ground's grain, the houses and the LiDAR's scatter.
    """

    samples: int = 11
    width_px: int = 528
    columns: int = 720
    seed: int = 0


def write_dataset(root: Path, settings: Settings, advance: Callable[[int], None]) -> None:
    """Write the whole dataset below `root`; the same settings give the same bytes. `advance` is called a key frame.

    Raises:
        DataError: if a file cannot be written.
    """
    writer = Writer(root, VERSION)
    scene, log = token_of("scene", SCENE), token_of("log", SCENE)
    writer.add("log", log, logfile=SCENE, vehicle="demo", date_captured="2023-11-14", location=LOCATION)
    maker = _Maker(writer, settings)
    samples = [token_of("sample", SCENE, number) for number in range(settings.samples)]
    for number, sample in enumerate(samples):
        timestamp = _START_US + number * SAMPLE_US
        writer.add("sample", sample, timestamp=timestamp, scene_token=scene, prev="", next="")
        since_last_us = SAMPLE_US if number else 0
        for earlier_us in range(since_last_us - _SWEEP_US, 0, -_SWEEP_US):
            maker.add_sweep(sample, timestamp - earlier_us, is_key_frame=False)
        points = maker.add_sweep(sample, timestamp, is_key_frame=True)
        maker.add_pictures(sample, timestamp)
        for vehicle in VEHICLES:
            writer.add_annotation(scene, sample, _annotation(vehicle, _seconds(timestamp), points))
        advance(1)
    writer.add_scene(SCENE, DESCRIPTION, log, samples)
    _write_maps(writer, log)
    writer.save()


def _seconds(timestamp_us: int) -> float:
    return (timestamp_us - _START_US) * 1e-6


class _Maker:
    """Renders and writes sensor files."""

    def __init__(self, writer: Writer, settings: Settings) -> None:
        random = np.random.default_rng(settings.seed)
        self._writer, self._settings = writer, settings
        self._ground: Ground = make_ground(random)
        self._houses: list[Solid] = houses_along(random)
        self._rig = rig(settings.width_px)
        self._calibration = {
            camera.channel: writer.add_sensor(SCENE, camera.channel, camera.ego_from_cam, camera.intrinsic)
            for camera in self._rig
        }
        self._calibration[LIDAR] = writer.add_sensor(SCENE, LIDAR, EGO_FROM_LIDAR)

    def add_pictures(self, sample: str, timestamp_us: int) -> None:
        """The six pictures of a sample, all taken at its own time."""
        time_s = _seconds(timestamp_us)
        solids, pose = solids_at(time_s, self._houses), street_from_ego(time_s)
        for camera in self._rig:
            filename = f"samples/{camera.channel}/{SCENE}__{camera.channel}__{timestamp_us}.jpg"
            write_image(self._writer.root / filename, picture(camera, pose, solids, self._ground))
            self._writer.add_file(
                sample,
                camera.channel,
                self._calibration[camera.channel],
                WORLD_FROM_STREET @ pose,
                timestamp_us,
                filename,
                (camera.width_px, camera.height_px),
            )

    def add_sweep(self, sample: str, timestamp_us: int, is_key_frame: bool) -> FloatArray:
        """A LiDAR sweep; returns its points (N, 3) in the world."""
        time_s = _seconds(timestamp_us)
        street_from_lidar = street_from_ego(time_s) @ EGO_FROM_LIDAR
        random = np.random.default_rng([self._settings.seed, timestamp_us])
        points = sweep(street_from_lidar, BEAMS_RAD, self._settings.columns, solids_at(time_s, self._houses), random)
        folder = "samples" if is_key_frame else "sweeps"
        filename = f"{folder}/{LIDAR}/{SCENE}__{LIDAR}__{timestamp_us}.pcd.bin"
        write_lidar(self._writer.root / filename, points)
        pose = WORLD_FROM_STREET @ street_from_ego(time_s)
        calibration = self._calibration[LIDAR]
        self._writer.add_file(sample, LIDAR, calibration, pose, timestamp_us, filename, is_key_frame=is_key_frame)
        return apply(WORLD_FROM_STREET @ street_from_lidar, points[:, :3])


def _annotation(vehicle: Vehicle, time_s: float, points_world: FloatArray) -> Annotation:
    length, width, height = vehicle.size_lwh_m
    lifted = transform(np.eye(3), [0.0, 0.0, height / 2])
    pose = WORLD_FROM_STREET @ vehicle.street_from_vehicle(time_s) @ lifted
    size = (width, length, height)
    box = Boxes(
        pose[None, :3, 3],
        np.array([size]),
        pose[None, :3, :3],
        (vehicle.category,),
        ("",),
        ("",),
        np.full((1, 2), np.nan),
        np.zeros(1, np.int64),
    )
    attribute = "vehicle.moving" if vehicle.speed_mps else "vehicle.parked"
    inside = int(box.inside(points_world, margin_m=0.05).sum())
    return Annotation(vehicle.name, vehicle.category, pose, size, attribute, inside)


def _write_maps(writer: Writer, log: str) -> None:
    """The vector map, and beside it the mask that nuScenes' own tools ask for."""
    write_json(writer.root / "maps" / "expansion" / f"{LOCATION}.json", map_expansion(), indent=None)
    token = token_of("map", SCENE)
    filename = f"maps/{token}.png"
    write_image(writer.root / filename, mask(PX_PER_M))
    writer.add("map", token, category="semantic_prior", filename=filename, log_tokens=[log])
