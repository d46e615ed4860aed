"""A tiny drive as a ROS 2 bag, written by rosbags' own writer: cameras of three lenses, LiDAR, tf and odometry."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from import_checks import ball_jpeg
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore
from scipy.spatial.transform import Rotation

TYPES = get_typestore(Stores.ROS2_HUMBLE)
START_NS = 1_700_000_000_000_000_000
SPEED, TURN = 5.0, 0.0
SIZE = (320, 240)
K = np.array([[260.0, 0, 158.5], [0, 261.0, 121.0], [0, 0, 1]])
HEIGHT = 0.4  # of base_link above the road
LIDAR = np.array([0.9, 0.0, 1.5])  # in base_link
POINT = np.array([10.0, -2.0, 0.5])  # in the world: on the road's frame, seen by the LiDAR
OPTICAL = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])


@dataclass(frozen=True)
class TwinCamera:
    """A camera: heading, place in base_link, lens."""

    yaw_deg: float
    place: tuple[float, float, float]
    model: str = "plumb_bob"
    d: Sequence[float] = ()

    @property
    def base_from_optical(self) -> np.ndarray:
        return mounted(Rotation.from_euler("z", self.yaw_deg, degrees=True).as_matrix() @ OPTICAL, self.place)

    def project(self, points_cam: np.ndarray) -> np.ndarray:
        """Pixels of points in the optical frame, by OpenCV."""
        none = np.zeros(3)
        if self.model == "equidistant":
            return cv2.fisheye.projectPoints(points_cam[:, None], none, none, K, np.array(self.d))[0].reshape(-1, 2)
        d = np.array(self.d) if len(self.d) else np.zeros(5)
        return cv2.projectPoints(points_cam, none, none, K, d)[0].reshape(-1, 2)


CAMERAS = {
    "front": TwinCamera(0, (1.6, 0.0, 1.0), "plumb_bob", (-0.24, 0.06, 0.001, -0.001, -0.01)),
    "rear_left": TwinCamera(150, (1.1, 0.2, 1.0), "rational_polynomial", (-0.2, 0.05, 0, 0, 0, 0.01, 0.0, 0.0)),
    "side": TwinCamera(90, (1.1, 0.4, 1.0), "equidistant", (0.02, -0.004, 0.001, 0.0)),
}

# Cutting views out of lenses takes most of the time of an import.
PINHOLE = {"front": TwinCamera(0, (1.6, 0.0, 1.0))}


def mounted(rotation: np.ndarray, place: Any) -> np.ndarray:
    """A pose."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, place
    return pose


def world_from_base(time_ns: int) -> np.ndarray:
    """Straight along x."""
    return mounted(np.eye(3), [SPEED * (time_ns - START_NS) * 1e-9, 0, HEIGHT])


def message(kind: str, **values: Any) -> Any:
    """A message of a type."""
    return TYPES.types[kind](**values)


def header(time_ns: int, frame: str) -> Any:
    """A header."""
    stamp = message("builtin_interfaces/msg/Time", sec=time_ns // 10**9, nanosec=time_ns % 10**9)
    return message("std_msgs/msg/Header", stamp=stamp, frame_id=frame)


def placed(pose: np.ndarray, kind: str) -> dict[str, Any]:
    """Translation or position, and rotation or orientation."""
    x, y, z, w = Rotation.from_matrix(pose[:3, :3]).as_quat()
    turn = message("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w)
    names = ("translation", "rotation") if kind == "Vector3" else ("position", "orientation")
    place = message(f"geometry_msgs/msg/{kind}", **dict(zip("xyz", pose[:3, 3].tolist(), strict=True)))
    return dict(zip(names, (place, turn), strict=True))


def transforms(time_ns: int, *edges: tuple[str, str, np.ndarray]) -> Any:
    """A TFMessage of (parent, child, parent_from_child)."""
    made = [
        message(
            "geometry_msgs/msg/TransformStamped",
            header=header(time_ns, parent),
            child_frame_id=child,
            transform=message("geometry_msgs/msg/Transform", **placed(pose, "Vector3")),
        )
        for parent, child, pose in edges
    ]
    return message("tf2_msgs/msg/TFMessage", transforms=made)


def odometry(time_ns: int, pose: np.ndarray, child: str = "base_link") -> Any:
    """An Odometry message in the frame odom."""
    zero = message("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=0.0)
    none = np.zeros(36)
    return message(
        "nav_msgs/msg/Odometry",
        header=header(time_ns, "odom"),
        child_frame_id=child,
        pose=message(
            "geometry_msgs/msg/PoseWithCovariance",
            pose=message("geometry_msgs/msg/Pose", **placed(pose, "Point")),
            covariance=none,
        ),
        twist=message(
            "geometry_msgs/msg/TwistWithCovariance",
            twist=message("geometry_msgs/msg/Twist", linear=zero, angular=zero),
            covariance=none,
        ),
    )


def camera_info(time_ns: int, frame: str, camera: TwinCamera, k: np.ndarray = K) -> Any:
    """A CameraInfo."""
    roi = message("sensor_msgs/msg/RegionOfInterest", x_offset=0, y_offset=0, height=0, width=0, do_rectify=False)
    return message(
        "sensor_msgs/msg/CameraInfo",
        header=header(time_ns, frame),
        height=SIZE[1],
        width=SIZE[0],
        distortion_model=camera.model,
        d=np.array(camera.d, np.float64),
        k=k.ravel().copy(),
        r=np.eye(3).ravel(),
        p=np.column_stack([k, np.zeros(3)]).ravel(),
        binning_x=0,
        binning_y=0,
        roi=roi,
    )


def compressed(time_ns: int, frame: str, data: bytes, form: str = "jpeg") -> Any:
    """A CompressedImage."""
    pixels = np.frombuffer(data, np.uint8)
    return message("sensor_msgs/msg/CompressedImage", header=header(time_ns, frame), format=form, data=pixels)


def image(time_ns: int, frame: str, pixels: np.ndarray, encoding: str, pad: int = 0) -> Any:
    """An Image of (H, W, C) or (H, W) pixels, with unused bytes after each row."""
    rows = np.pad(pixels.reshape(len(pixels), -1), ((0, 0), (0, pad)))
    return message(
        "sensor_msgs/msg/Image",
        header=header(time_ns, frame),
        height=pixels.shape[0],
        width=pixels.shape[1],
        encoding=encoding,
        is_bigendian=0,
        step=rows.shape[1],
        data=rows.ravel(),
    )


def cloud(time_ns: int, frame: str, points: np.ndarray) -> Any:
    """A PointCloud2 of x, y, z, intensity (float32) and ring (uint16), 32 bytes a point."""
    kinds = {"x": (0, "<f4"), "y": (4, "<f4"), "z": (8, "<f4"), "intensity": (16, "<f4"), "ring": (20, "<u2")}
    rows = np.zeros(
        len(points),
        np.dtype(
            {
                "names": list(kinds),
                "formats": [kind for _, kind in kinds.values()],
                "offsets": [at for at, _ in kinds.values()],
                "itemsize": 32,
            }
        ),
    )
    for column, name in enumerate(kinds):
        rows[name] = points[:, column]
    fields = [
        message("sensor_msgs/msg/PointField", name=name, offset=at, datatype={"<f4": 7, "<u2": 4}[kind], count=1)
        for name, (at, kind) in kinds.items()
    ]
    return message(
        "sensor_msgs/msg/PointCloud2",
        header=header(time_ns, frame),
        height=1,
        width=len(points),
        fields=fields,
        is_bigendian=False,
        point_step=32,
        row_step=32 * len(points),
        data=rows.view(np.uint8).ravel(),
        is_dense=False,
    )


@dataclass
class Messages:
    """Messages with their topic and time of recording."""

    found: list[tuple[int, str, Any]] = field(default_factory=list)

    def add(self, topic: str, time_ns: int, made: Any, late_ns: int = 3_000_000) -> None:
        """Add a message that is recorded some time after its stamp."""
        self.found.append((time_ns + late_ns, topic, made))

    def write(self, path: Path, plugin: StoragePlugin = StoragePlugin.SQLITE3) -> Path:
        """Write the bag."""
        with Writer(path, version=9, storage_plugin=plugin) as writer:
            kinds: Mapping[str, str] = {topic: made.__msgtype__ for _, topic, made in self.found}
            known = {topic: writer.add_connection(topic, kind, typestore=TYPES) for topic, kind in kinds.items()}
            for time, topic, made in self.found:
                writer.write(known[topic], time, TYPES.serialize_cdr(made, made.__msgtype__))
        return path


def jpeg(camera: TwinCamera, time_ns: int) -> bytes:
    """What a camera sees of the balls."""
    return ball_jpeg(camera.project, SIZE, world_from_base(time_ns) @ camera.base_from_optical, np.zeros(3))


def drive(
    seconds: float = 1.0,
    with_odometry: bool = True,
    picture: Callable[[TwinCamera, int], bytes] = jpeg,
    cameras: Mapping[str, TwinCamera] = PINHOLE,
) -> Messages:
    """One second at 10 pictures and sweeps a second, poses at 50 Hz by odometry and by tf from map over odom."""
    made = Messages()
    static = [("base_link", f"{name}_optical", each.base_from_optical) for name, each in cameras.items()]
    static += [("base_link", "lidar", mounted(np.eye(3), LIDAR))]
    made.add("/tf_static", START_NS, transforms(START_NS, *static))
    map_from_odom = mounted(np.eye(3), [100.0, 50.0, 0])
    for step in range(round(seconds * 50) + 1):
        time = START_NS + step * 20_000_000
        pose = world_from_base(time)
        made.add("/tf", time, transforms(time, ("map", "odom", map_from_odom), ("odom", "base_link", pose)))
        if with_odometry:
            made.add("/odom", time, odometry(time, pose))
    for step in range(round(seconds * 10) + 1):
        time = START_NS + step * 100_000_000
        for number, (name, each) in enumerate(cameras.items()):
            taken = time + number * 7_000_000
            if taken > START_NS + seconds * 1e9:
                continue
            made.add(f"/sensing/{name}/camera_info", taken, camera_info(taken, f"{name}_optical", each))
            made.add(
                f"/sensing/{name}/image_raw/compressed",
                taken,
                compressed(taken, f"{name}_optical", picture(each, taken)),
                late_ns=30_000_000,
            )
        seen = POINT - world_from_base(time)[:3, 3] - LIDAR
        points = np.array([[*seen, 77, 3], [np.nan, 0, 0, 1, 1]])
        made.add("/points", time, cloud(time, "lidar", points))
    return made
