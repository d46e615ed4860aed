"""Time and memory to convert a long ROS 2 bag: six cameras, LiDAR, odometry and tf, made here.

    python -m benchmarks.ros_bag FOLDER                 # 10,000 key frames, 7 GB of bag and of dataset
    python -m benchmarks.ros_bag FOLDER --samples 500

The bag stays in FOLDER and is used again. The dataset is written by `appocc convert ros` in a process of its own.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import cv2
import numpy as np

START_NS, STEP_NS, HZ = 1_700_000_000_000_000_000, 500_000_000, 2
SIZE, POINTS = (640, 360), 2000
CAMERAS = {"front": 0, "front_left": 55, "front_right": -55, "rear": 180, "rear_left": 110, "rear_right": -110}


def write_bag(path: Path, samples: int, plugin_name: str) -> None:
    """Write the bag with rosbags' writer."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    types = get_typestore(Stores.ROS2_HUMBLE)

    def made(kind: str, **values: Any) -> Any:
        return types.types[kind](**values)

    def header(time_ns: int, frame: str) -> Any:
        stamp = made("builtin_interfaces/msg/Time", sec=time_ns // 10**9, nanosec=time_ns % 10**9)
        return made("std_msgs/msg/Header", stamp=stamp, frame_id=frame)

    def quaternion(wxyz: Any) -> Any:
        return made("geometry_msgs/msg/Quaternion", w=wxyz[0], x=wxyz[1], y=wxyz[2], z=wxyz[3])

    def transform(time_ns: int, parent: str, child: str, xyz: Any, wxyz: Any) -> Any:
        place = made("geometry_msgs/msg/Vector3", x=float(xyz[0]), y=float(xyz[1]), z=float(xyz[2]))
        value = made("geometry_msgs/msg/Transform", translation=place, rotation=quaternion(wxyz))
        kind = "geometry_msgs/msg/TransformStamped"
        return made(kind, header=header(time_ns, parent), child_frame_id=child, transform=value)

    plugin = StoragePlugin[plugin_name.upper()]
    with Writer(path, version=9, storage_plugin=plugin) as writer:
        known: dict[str, Any] = {}

        def write(topic: str, kind: str, time_ns: int, value: Any) -> None:
            if topic not in known:
                known[topic] = writer.add_connection(topic, kind, typestore=types)
            writer.write(known[topic], time_ns, types.serialize_cdr(value, kind))

        mounts = [
            transform(START_NS, "base_link", name, (1.0, 0.0, 1.5), _optical(np.radians(yaw)))
            for name, yaw in CAMERAS.items()
        ]
        write("/tf_static", "tf2_msgs/msg/TFMessage", START_NS, made("tf2_msgs/msg/TFMessage", transforms=mounts))
        random = np.random.default_rng(1)
        noise = cv2.resize(random.integers(0, 255, (90, 160, 3)).astype(np.uint8), SIZE)
        for number in range(samples):
            time_ns = START_NS + number * STEP_NS
            for step in range(25):  # 50 transforms a second
                at = time_ns + step * 20_000_000
                moved = transform(at, "odom", "base_link", (number * 2.5 + step * 0.1, 0, 0), (1, 0, 0, 0))
                write("/tf", "tf2_msgs/msg/TFMessage", at, made("tf2_msgs/msg/TFMessage", transforms=[moved]))
            for name in CAMERAS:
                picture = cv2.imencode(".jpg", np.roll(noise, number, axis=1), [cv2.IMWRITE_JPEG_QUALITY, 60])[1]
                for late in range(2):  # twice the rate of the key frames
                    at = time_ns + late * STEP_NS // 2
                    write(f"/{name}/camera_info", "sensor_msgs/msg/CameraInfo", at, _info(made, header(at, name)))
                    value = made(
                        "sensor_msgs/msg/CompressedImage",
                        header=header(at, name),
                        format="jpeg",
                        data=picture.ravel(),
                    )
                    write(f"/{name}/image_raw/compressed", "sensor_msgs/msg/CompressedImage", at, value)
            cloud = random.normal(size=(POINTS, 3)).astype(np.float32)
            fields = [
                made("sensor_msgs/msg/PointField", name=axis, offset=4 * i, datatype=7, count=1)
                for i, axis in enumerate("xyz")
            ]
            value = made(
                "sensor_msgs/msg/PointCloud2",
                header=header(time_ns, "base_link"),
                height=1,
                width=POINTS,
                fields=fields,
                is_bigendian=False,
                point_step=12,
                row_step=12 * POINTS,
                data=cloud.view(np.uint8).ravel(),
                is_dense=True,
            )
            write("/points", "sensor_msgs/msg/PointCloud2", time_ns, value)


def _optical(yaw: float) -> Any:
    """Quaternion wxyz of a level camera's optical frame."""
    from scipy.spatial.transform import Rotation

    ahead = Rotation.from_matrix([[0, 0, 1], [-1, 0, 0], [0, -1, 0]])
    return (Rotation.from_euler("z", yaw) * ahead).as_quat(scalar_first=True).tolist()


def _info(made: Any, header: Any) -> Any:
    k = np.array([[400.0, 0, SIZE[0] / 2], [0, 400.0, SIZE[1] / 2], [0, 0, 1]])
    return made(
        "sensor_msgs/msg/CameraInfo",
        header=header,
        height=SIZE[1],
        width=SIZE[0],
        distortion_model="plumb_bob",
        d=np.zeros(5),
        k=k.ravel(),
        r=np.eye(3).ravel(),
        p=np.column_stack([k, np.zeros(3)]).ravel(),
        binning_x=0,
        binning_y=0,
        roi=made("sensor_msgs/msg/RegionOfInterest", x_offset=0, y_offset=0, height=0, width=0, do_rectify=False),
    )


def main() -> None:
    """Write the bag if it is not there, convert it and print figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--samples", type=int, default=10_000)
    parser.add_argument("--storage", choices=("sqlite3", "mcap"), default="sqlite3")
    asked = parser.parse_args()
    bag, out = asked.folder / f"bag_{asked.samples}_{asked.storage}", asked.folder / "out"
    if not bag.is_dir():
        write_bag(bag, asked.samples, asked.storage)
    shutil.rmtree(out, ignore_errors=True)
    size = sum(path.stat().st_size for path in bag.iterdir())
    begin = time.perf_counter()
    process = subprocess.Popen(
        [sys.executable, "-m", "cli.main", "convert", "ros", str(bag), str(out), "--hz", str(HZ)]
    )
    _, status, usage = os.wait4(process.pid, 0)
    seconds = time.perf_counter() - begin
    print(
        f"{asked.samples} key frames, {size / 1e9:.2f} GB {asked.storage}: exit {os.waitstatus_to_exitcode(status)}, "
        f"{seconds:.0f} s, at most {usage.ru_maxrss / 1e6:.2f} GB of memory"
    )


if __name__ == "__main__":
    main()
