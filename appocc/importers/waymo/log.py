"""A segment of the Waymo Open Dataset as a log."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path

import numpy as np

from appocc.checks import ByteArray, FloatArray, IntArray
from appocc.ego_vehicle import EgoVehicle
from appocc.errors import DataError, ShapeError
from appocc.geometry import apply, inverse, transform
from appocc.importers.log import Frame, Image, Sweep, key_indices
from appocc.importers.waymo.panoptic import kinds_of
from appocc.importers.waymo.points import TOP, points_of
from appocc.importers.waymo.roads import write_roads
from appocc.importers.waymo.segment import Label, Picture, Segment, WaymoCamera, WaymoFrame
from appocc.lenses import DistortedLens
from appocc.nuscenes.label_zones import write_no_label_zones
from appocc.nuscenes.writer import Annotation, Writer
from appocc.rigs import SourceRig
from appocc.rigs.cutting import cut_rig
from appocc.rigs.source_camera import SourceCamera

# A Chrysler Pacifica.
EGO_VEHICLE = EgoVehicle(length_m=5.18, width_m=2.02, rear_overhang_m=1.1)
# CameraName -> name and channel.
_CAMERAS = {
    1: ("FRONT", "CAM_FRONT"),
    2: ("FRONT_LEFT", "CAM_FRONT_LEFT"),
    3: ("FRONT_RIGHT", "CAM_FRONT_RIGHT"),
    4: ("SIDE_LEFT", "CAM_SIDE_LEFT"),
    5: ("SIDE_RIGHT", "CAM_SIDE_RIGHT"),
}
# Label.Type -> category; signs (3) and unknown ones have none.
_CATEGORIES = {1: "vehicle.car", 2: "human.pedestrian.adult", 4: "vehicle.bicycle"}
_MOVING_MPS = 0.5
# Columns: right, down and ahead of a camera whose own frame is ahead, left, up.
_AHEAD_LEFT_UP_FROM_CAM = np.array([[0.0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
_NOTES = (
    "no camera looks behind",
    "cameras have a rolling shutter: a picture has the time and pose of its middle, its edges are some hundredths of "
    "a second off",
    "all vehicles but bicycles are one class of Waymo: cars, buses, trucks and motorcycles become vehicle.car",
    "left out, without a class in nuScenes: boxes of signs",
)


@dataclass(frozen=True)
class WaymoLog:
    """A log, see `appocc.importers.Log`.

    Attributes:
        name: name of the segment.
        source: its file, for messages.
        read: opens the segment in its layout; raises DataError.
        hz: key frames per second.
    """

    name: str
    source: Path
    read: Callable[[], Segment]
    hz: float

    @property
    def description(self) -> str:
        """Source of the log, time of day and weather."""
        return ", ".join(filter(None, (f"Waymo Open Dataset, {self.name}", self._segment.conditions)))

    @property
    def vehicle(self) -> str:
        """Recording platform."""
        return "waymo"

    @property
    def location(self) -> str:
        """Place and segment: each segment has a map of its own."""
        return f"{self._segment.place or 'unknown'}-{self.name}"

    @property
    def frames_in_total(self) -> int:
        """Number of key frames."""
        return len(self._keys)

    def rig(self) -> SourceRig:
        """Return all calibrated cameras."""
        cameras = tuple(self._camera(camera) for camera in self._segment.cameras if camera.number in _CAMERAS)
        if not cameras:
            raise DataError(f"{self.source}: expected a calibrated camera, got none")
        return cut_rig(cameras, EGO_VEHICLE)

    def ego_from_lidar(self) -> FloatArray | None:
        """Return the pose of the upper LiDAR; None without range images."""
        lasers = self._segment.lasers
        if lasers and TOP not in lasers:
            raise DataError(f"{self.source}: expected the calibration of the upper LiDAR ({TOP}), got none")
        return lasers[TOP].ego_from_laser if lasers else None

    def frames(self) -> Iterator[Frame]:
        """Yield the key frames."""
        # Opened again: what a segment keeps of its tables while it is read is let go at the end.
        for frame in self.read().frames(self._keys):
            onto_map = transform(np.eye(3), frame.map_from_world_m)
            images = tuple(
                self._image(each, onto_map @ each.world_from_ego)
                for each in frame.pictures
                if each.camera in _CAMERAS
            )
            pose = onto_map @ frame.world_from_ego
            swept = frame.returns is not None and bool(self._segment.lasers)
            sweep = Sweep(frame.time_us, pose, partial(self._points, frame)) if swept else None
            boxes = tuple(self._annotation(label, pose) for label in frame.labels if label.kind in _CATEGORIES)
            zones = [outline + frame.map_from_world_m[:2] for outline in frame.no_label_zones]
            more = partial(write_no_label_zones, outlines=zones) if zones else None
            yield Frame(frame.time_us, images, sweep, boxes, more)

    def write_map(self, writer: Writer, log: str) -> None:
        """Write the vector map, if there is one."""
        roads = self._segment.roads()
        if roads is not None:
            try:
                write_roads(roads, self.location, writer, log)
            except DataError:
                raise
            except ValueError as error:
                raise DataError(f"{self.source}: map: {error}") from error

    def notes(self) -> tuple[str, ...]:
        """Return what is assumed, missing or left out."""
        return (*self._segment.notes, *_NOTES)

    def __getstate__(self) -> dict[str, object]:
        """Leave what was read to the process that needs it."""
        return {name: getattr(self, name) for name in ("name", "source", "read", "hz")}

    @cached_property
    def _segment(self) -> Segment:
        return self.read()

    @cached_property
    def _keys(self) -> IntArray:
        return key_indices(self._segment.times_us, self.hz)

    def _camera(self, camera: WaymoCamera) -> SourceCamera:
        name, channel = _CAMERAS[camera.number]
        fx, fy, cx, cy, *distortion = camera.intrinsic.tolist()
        # Waymo counts pixels from the corner of the picture, we from the middle of the first one.
        intrinsic = np.array([[fx, 0, cx - 0.5], [0, fy, cy - 0.5], [0, 0, 1]])
        try:
            lens = DistortedLens(intrinsic, np.array(distortion))
            pose = camera.ego_from_cam @ _AHEAD_LEFT_UP_FROM_CAM
            return SourceCamera(name, channel, *camera.size_px, lens, pose)
        except ShapeError as error:
            raise DataError(f"{self.source}: camera {name}: {error}") from error

    def _image(self, picture: Picture, world_from_ego: FloatArray) -> Image:
        name = _CAMERAS[picture.camera][0]
        kinds = partial(self._kinds, f"panoptic label of {name} at {picture.time_us} us", picture)
        return Image(name, picture.time_us, world_from_ego, picture.read, kinds)

    def _kinds(self, what: str, picture: Picture) -> ByteArray | None:
        label = picture.panoptic()
        if not label.png:
            return None
        size_px = next(camera.size_px for camera in self._segment.cameras if camera.number == picture.camera)
        return kinds_of(f"{self.source}: {what}", label, size_px)

    def _points(self, frame: WaymoFrame) -> FloatArray:
        """Return the points (N, 5) of all LiDARs in the frame of the upper one."""
        images = frame.returns() if frame.returns is not None else []
        lasers = self._segment.lasers
        try:
            points = points_of(images, lasers, frame.world_from_ego)
        except ValueError as error:
            raise DataError(f"{self.source}: frame at {frame.time_us} us: {error}") from error
        points[:, :3] = apply(inverse(lasers[TOP].ego_from_laser), points[:, :3])
        return points

    def _annotation(self, label: Label, world_from_ego: FloatArray) -> Annotation:
        length, width, height = label.size_lwh_m
        if not (np.isfinite([*label.centre_m, label.heading_rad]).all() and min(label.size_lwh_m) > 0):
            raise DataError(f"{self.source}: box {label.instance}: expected finite numbers and a positive size")
        cos, sin = np.cos(label.heading_rad), np.sin(label.heading_rad)
        ego_from_box = transform(np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]]), label.centre_m)
        category = _CATEGORIES[label.kind]
        return Annotation(
            instance=label.instance,
            category=category,
            world_from_box=world_from_ego @ ego_from_box,
            size_wlh_m=(width, length, height),
            attribute=_attribute(category, float(np.hypot(*label.speed_mps))),
            lidar_points=label.points,
        )


def _attribute(category: str, speed_mps: float) -> str:
    """Return the attribute of a box: of a car by its speed (NaN if unknown); cyclists include the rider."""
    if category == "vehicle.bicycle":
        return "cycle.with_rider"
    if category != "vehicle.car" or np.isnan(speed_mps):
        return ""
    return "vehicle.moving" if speed_mps > _MOVING_MPS else "vehicle.stopped"
