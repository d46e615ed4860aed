"""A tiny log in Argoverse 2's layout, written by pandas: sweeps at 10 Hz, two cameras at 20 Hz, a car, a map."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
from import_checks import ball_jpeg
from scipy.spatial.transform import Rotation

LOG = "0a1b2c3d-0000-1111-2222-333344445555"
START_NS = 315_966_253_660_357_000
ORIGIN = np.array([5000.0, 2000.0, 60.0])
SPEED = 5.0
SIZE = (320, 240)
K = np.array([[260.0, 0, 158.5], [0, 261.0, 121.0], [0, 0, 1]])
DISTORTION = np.array([-0.24, 0.06, 0.0, 0.0, -0.01])  # k1, k2, p1, p2, k3
FORWARD = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])
CAMERAS = {
    "ring_front_center": (FORWARD, [1.6, 0.0, 1.4]),
    "ring_rear_left": (Rotation.from_euler("z", 150, degrees=True).as_matrix() @ FORWARD, [1.1, 0.2, 1.4]),
}
AXLE_M = 0.33
LIDAR_M = [1.35, 0.0, 1.64]
CAR = np.array([20.0, 2.0, 0.8 - AXLE_M])  # in the ego frame of the start


def axle(time_ns: int) -> np.ndarray:
    """Pose of the rear axle in the city: straight along x."""
    pose = np.eye(4)
    pose[:3, 3] = ORIGIN + np.array([SPEED * (time_ns - START_NS) * 1e-9, 0, AXLE_M])
    return pose


def pose_columns(poses: list[np.ndarray]) -> dict[str, list[float]]:
    """Columns of poses as the tables have them."""
    turns = [Rotation.from_matrix(pose[:3, :3]).as_quat(scalar_first=True) for pose in poses]
    found = {name: [float(turn[i]) for turn in turns] for i, name in enumerate(("qw", "qx", "qy", "qz"))}
    return {**found, **{name: [float(p[i, 3]) for p in poses] for i, name in enumerate(("tx_m", "ty_m", "tz_m"))}}


def mounted(rotation: np.ndarray, place: list[float]) -> np.ndarray:
    """Pose of a sensor in the axle's frame."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, place
    return pose


def write_log(split: Path, log: str = LOG) -> Path:
    """Write the log below a split."""
    folder = split / log
    (folder / "calibration").mkdir(parents=True)
    (folder / "sensors/lidar").mkdir(parents=True)
    sweeps = [START_NS + i * 100_000_000 for i in range(6)]
    pictures = [START_NS + i * 50_000_000 + 7_000_000 for i in range(11)]
    times = sorted([*sweeps, *pictures])
    poses = pd.DataFrame({"timestamp_ns": times, **pose_columns([axle(t) for t in times])})
    poses.to_feather(folder / "city_SE3_egovehicle.feather")
    sensors = {name: mounted(*place) for name, place in CAMERAS.items()} | {"up_lidar": mounted(np.eye(3), LIDAR_M)}
    table = pd.DataFrame({"sensor_name": list(sensors), **pose_columns(list(sensors.values()))})
    table.to_feather(folder / "calibration/egovehicle_SE3_sensor.feather")
    rows = {"fx_px": K[0, 0], "fy_px": K[1, 1], "cx_px": K[0, 2], "cy_px": K[1, 2]}
    rows |= {"k1": DISTORTION[0], "k2": DISTORTION[1], "k3": DISTORTION[4]}
    lens = pd.DataFrame(
        {"sensor_name": list(CAMERAS), **{key: [value] * len(CAMERAS) for key, value in rows.items()}}
    )
    lens = lens.assign(height_px=np.uint16(SIZE[1]), width_px=np.uint16(SIZE[0]))
    lens.to_feather(folder / "calibration/intrinsics.feather")
    boxes = []
    for time in sweeps:
        box = np.eye(4)
        box[:3, 3] = CAR - [SPEED * (time - START_NS) * 1e-9, 0, 0]
        common = {"timestamp_ns": time, "length_m": 4.4, "width_m": 1.8, "height_m": 1.6}
        columns = {key: values[0] for key, values in pose_columns([box]).items()}
        boxes += [
            {**common, "track_uuid": uuid, "category": kind, "num_interior_pts": 30, **columns}
            for uuid, kind in (("car", "REGULAR_VEHICLE"), ("sign", "STOP_SIGN"))
        ]
        points = np.random.default_rng(time % 97).uniform(-0.5, 0.5, (30, 3)) * [4.2, 1.6, 1.4] + box[:3, 3]
        sweep = pd.DataFrame(points.astype(np.float16), columns=["x", "y", "z"])
        sweep = sweep.assign(intensity=np.uint8(9), laser_number=np.uint8(3), offset_ns=np.int32(5))
        sweep.to_feather(folder / f"sensors/lidar/{time}.feather")
    pd.DataFrame(boxes).to_feather(folder / "annotations.feather")
    for name, place in CAMERAS.items():
        (folder / "sensors/cameras" / name).mkdir(parents=True)
        for time in pictures:
            jpeg = ball_jpeg(project, SIZE, axle(time) @ mounted(*place), ORIGIN)
            (folder / f"sensors/cameras/{name}/{time}.jpg").write_bytes(jpeg)
    write_map(folder)
    return folder


def project(points_cam: np.ndarray) -> np.ndarray:
    """Pixels of points in the camera frame, by OpenCV."""
    return cv2.projectPoints(points_cam, np.zeros(3), np.zeros(3), K, DISTORTION)[0].reshape(-1, 2)


def write_map(folder: Path) -> None:
    """A road along x, 12 m wide, with a yellow line in its middle, a crossing, and a junction of two lanes."""

    def line(*points: tuple[float, float]) -> list[dict[str, float]]:
        return [{"x": ORIGIN[0] + x, "y": ORIGIN[1] + y, "z": ORIGIN[2]} for x, y in points]

    lane = {"id": 1, "is_intersection": False, "lane_type": "VEHICLE", "left_lane_mark_type": "DOUBLE_SOLID_YELLOW"}
    lane |= {"left_lane_boundary": line((-50, 0), (50, 0)), "right_lane_boundary": line((-50, -4), (50, -4))}
    lane |= {"right_lane_mark_type": "NONE"}
    other = lane | {"id": 2, "right_lane_boundary": line((-50, 4), (50, 4))}
    junction = lane | {"id": 3, "is_intersection": True, "left_lane_mark_type": "NONE"}
    junction |= {"left_lane_boundary": line((50, 4), (60, 4)), "right_lane_boundary": line((50, 0), (60, 0))}
    second = junction | {
        "left_lane_boundary": line((50, 0), (60, 0)),
        "right_lane_boundary": line((50, -4), (60, -4)),
    }
    archive = {
        "drivable_areas": {"1": {"id": 1, "area_boundary": line((-60, -6), (60, -6), (60, 6), (-60, 6))}},
        "lane_segments": {str(i): row for i, row in enumerate((lane, other, junction, second))},
        "pedestrian_crossings": {"7": {"id": 7, "edge1": line((30, -6), (30, 6)), "edge2": line((33, -6), (33, 6))}},
    }
    (folder / "map").mkdir()
    name = f"log_map_archive_{folder.name}____PIT_city_47896.json"
    (folder / "map" / name).write_text(json.dumps(archive))
