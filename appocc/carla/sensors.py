"""Sensors of the ego vehicle: six cameras with depth and classes, a LiDAR, and a camera far above."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from queue import Empty, SimpleQueue
from typing import Any, NamedTuple

import numpy as np

from appocc.camera import Camera, CameraRig
from appocc.carla.frames import BODY_FROM_CAM, carla_transform
from appocc.carla.server import Server
from appocc.checks import ByteArray, Float32Array, FloatArray
from appocc.errors import DataError
from appocc.geometry import inverse, transform
from appocc.nuscenes.view_targets import ViewClass

EGO_FROM_LIDAR = transform(np.eye(3), [0.94, 0.0, 1.84])
_WAIT_S = 30.0
_FARTHEST_M = 1000.0
# Square pixels are asked for up to this share.
_SQUARE = 1e-3
_LIDAR = {"channels": 32, "range": 80.0, "upper_fov": 10.0, "lower_fov": -30.0}
_LIDAR_EXACT = {"dropoff_general_rate": 0.0, "dropoff_intensity_limit": 1.0, "dropoff_zero_intensity": 0.0}
_LIDAR_COLUMNS = 1080
# Our classes by CARLA's tags (carla.CityObjectLabel), which are those of Cityscapes from 0.9.14 on.
_KINDS = {
    ViewClass.ROAD: (1,),
    ViewClass.LANE_MARKING: (24,),
    ViewClass.PAVEMENT: (2,),
    ViewClass.TERRAIN: (10, 25, 23),
    ViewClass.BUILDING: (3, 4, 5, 26, 28),
    ViewClass.VEGETATION: (9,),
    ViewClass.POLE_OR_SIGN: (6, 7, 8),
    ViewClass.VEHICLE: (14, 15, 16, 17),
    ViewClass.TWO_WHEELER: (18, 19),
    ViewClass.PERSON: (12, 13),
    ViewClass.SKY: (11,),
}


class Cut(NamedTuple):
    """A camera of the rig as CARLA takes it: a larger picture with the axis in its middle, of which a part is cut.

    Attributes:
        camera: the camera as it is recorded.
        size_px: width and height of the larger picture.
        fov_deg: its horizontal field of view.
        corner_px: column and row of the part.
    """

    camera: Camera
    size_px: tuple[int, int]
    fov_deg: float
    corner_px: tuple[int, int]

    def part(self, picture: Any) -> Any:
        """Return the part of a picture (H, W, ...)."""
        column, row = self.corner_px
        return picture[row : row + self.camera.height_px, column : column + self.camera.width_px]


def cut_of(camera: Camera) -> Cut:
    """Return how a camera is taken; its axis moves by up to half a pixel.

    Raises:
        DataError: if its pixels are not square.
    """
    k = camera.intrinsic
    focal = float(k[0, 0])
    if abs(k[1, 1] - focal) > _SQUARE * focal or abs(k[0, 1]) > _SQUARE * focal:
        raise DataError(f"{camera.channel}: expected square pixels, as CARLA's cameras have, got K = {k.tolist()}")
    size, corner = [], []
    for centre, count in ((k[0, 2], camera.width_px), (k[1, 2], camera.height_px)):
        whole = round(2 * max(centre, count - 1 - centre)) + 1
        size.append(whole)
        corner.append(min(max(round((whole - 1) / 2 - centre), 0), whole - count))
    axis = [(whole - 1) / 2 - start for whole, start in zip(size, corner, strict=True)]
    intrinsic = np.array([[focal, 0.0, axis[0]], [0.0, focal, axis[1]], [0.0, 0.0, 1.0]])
    fov = float(np.degrees(2 * np.arctan(size[0] / 2 / focal)))
    return Cut(replace(camera, intrinsic=intrinsic), (size[0], size[1]), fov, (corner[0], corner[1]))


@dataclass(eq=False)
class Sensors:
    """Sensors that give data at every tick, by name."""

    server: Server
    _queues: dict[str, SimpleQueue[Any]]

    @classmethod
    def none(cls, server: Server) -> Sensors:
        """Start without sensors."""
        return cls(server, {})

    def add(
        self, name: str, kind: str, attributes: Mapping[str, object], pose: FloatArray, parent: Any = None
    ) -> Any:
        """Spawn a sensor at a (4, 4) pose in the world or of its parent; return the actor.

        Raises:
            DataError: if the server cannot.
        """
        blueprint = self.server.world.get_blueprint_library().find(kind)
        for key, value in attributes.items():
            if blueprint.has_attribute(key):
                blueprint.set_attribute(key, str(value))
        actor = self.server.spawn(blueprint, carla_transform(self.server.carla, pose), parent)
        if actor is None:
            raise DataError(f"{name}: expected a place for the sensor {kind}, got none")
        queue: SimpleQueue[Any] = SimpleQueue()
        self.server.before_destroying(actor.stop)
        self._queues[name] = queue
        actor.listen(queue.put)
        return actor

    def read(self, frame: int) -> dict[str, Any]:
        """Return the data of all sensors of a frame, by name; earlier data are dropped.

        Raises:
            DataError: if a sensor gives none.
        """
        return {name: self._read_one(name, queue, frame) for name, queue in self._queues.items()}

    def _read_one(self, name: str, queue: SimpleQueue[Any], frame: int) -> Any:
        try:
            while (data := queue.get(timeout=_WAIT_S)).frame < frame:
                pass
        except Empty as error:
            raise DataError(f"{name}: expected data of frame {frame} within {_WAIT_S:g} s, got none") from error
        if data.frame != frame:
            raise DataError(f"{name}: expected data of frame {frame}, got those of {data.frame}")
        return data


def add_cameras(sensors: Sensors, rig: CameraRig, vehicle: Any, vehicle_from_ego: FloatArray) -> dict[str, Cut]:
    """Add the cameras of a rig, each with depth and classes (NAME/rgb, NAME/depth, NAME/kind); return their cuts."""
    cuts = {camera.channel: cut_of(camera) for camera in rig}
    for channel, cut in cuts.items():
        pose = vehicle_from_ego @ cut.camera.ego_from_cam @ inverse(BODY_FROM_CAM)
        common = {"image_size_x": cut.size_px[0], "image_size_y": cut.size_px[1], "fov": cut.fov_deg}
        for part, kind in (("rgb", "rgb"), ("depth", "depth"), ("kind", "semantic_segmentation")):
            more = {"motion_blur_intensity": 0.0} if part == "rgb" else {}
            sensors.add(f"{channel}/{part}", f"sensor.camera.{kind}", common | more, pose, vehicle)
    return cuts


def add_lidar(sensors: Sensors, vehicle: Any, vehicle_from_ego: FloatArray, name: str) -> None:
    """Add a LiDAR of 32 beams that turns once in a tick, without noise."""
    turns = 1 / sensors.server.delta_s
    rate = {"rotation_frequency": turns, "points_per_second": round(_LIDAR["channels"] * _LIDAR_COLUMNS * turns)}
    pose = vehicle_from_ego @ EGO_FROM_LIDAR
    sensors.add(name, "sensor.lidar.ray_cast", _LIDAR | _LIDAR_EXACT | rate, pose, vehicle)


def picture_of(image: Any) -> ByteArray:
    """Return the (H, W, 3) uint8 RGB of a carla.Image."""
    return np.ascontiguousarray(_bgra(image)[:, :, 2::-1])


def depth_of(image: Any) -> Float32Array:
    """Return the (H, W) float32 depth along the axis, metres, of a depth camera's image; infinite in the sky."""
    blue, green, red = (_bgra(image)[:, :, i].astype(np.float32) for i in range(3))
    depth = (red + 256 * green + 65536 * blue) * np.float32(_FARTHEST_M / (256**3 - 1))
    depth[depth >= 0.999 * _FARTHEST_M] = np.inf
    return np.asarray(depth, np.float32)


def kinds_of(image: Any) -> ByteArray:
    """Return the (H, W) uint8 `ViewClass` of a semantic segmentation camera's image."""
    table = np.full(256, ViewClass.OTHER, np.uint8)
    for kind, tags in _KINDS.items():
        table[list(tags)] = kind
    return table[_bgra(image)[:, :, 2]]


def points_of(measurement: Any) -> FloatArray:
    """Return the points (N, 5) of a carla.LidarMeasurement in our axes: x, y, z, intensity 0..255, ring."""
    rows = np.frombuffer(measurement.raw_data, "<f4").reshape(-1, 4).astype(np.float64)
    counts = [measurement.get_point_count(channel) for channel in range(measurement.channels)]
    rings = np.repeat(np.arange(len(counts), dtype=np.float64), counts)
    if len(rings) != len(rows):
        rings = np.full(len(rows), -1.0)
    return np.column_stack([rows[:, :3] * [1, -1, 1], np.clip(rows[:, 3], 0, 1) * 255, rings])


def _bgra(image: Any) -> ByteArray:
    return np.frombuffer(image.raw_data, np.uint8).reshape(image.height, image.width, 4)
