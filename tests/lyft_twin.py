"""A tiny scene in the published layout of Lyft Level 5, written by hand: tables in data/, images/, lidar/ and a map.

Unlike nuScenes: plain categories, tokens of 64 digits, times with fractions, no visibilities, points that are not
counted, a zoomed front camera, three LiDARs and a coloured map. The vehicle drives along x at 5 m/s.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from import_checks import ball_jpeg
from scipy.spatial.transform import Rotation

START_US, STEP_US, SPEED, SAMPLES = 1_546_560_000_000_000, 200_000, 5.0, 4
ORIGIN = np.array([100.0, 60.0, -20.0])
SIZE = (320, 240)
FORWARD = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])
# Channel -> number of the camera, yaw, focal length.
CAMERAS = {"CAM_FRONT": (0, 0.0, 220.0), "CAM_BACK": (3, np.pi, 220.0), "CAM_FRONT_ZOOMED": (6, 0.0, 700.0)}
LIDARS = {"LIDAR_TOP": (1, [1.2, 0.0, 1.8]), "LIDAR_FRONT_LEFT": (2, [3.4, 0.6, 0.6])}
CAR, CAR_WLH = np.array([22.0, -3.0, 0.8]), [1.9, 4.6, 1.6]
WHITE, ROAD, PAVEMENT, LINE = (255, 255, 255), (128, 128, 128), (211, 211, 211), (240, 200, 10)
Row = dict[str, Any]


def token(*names: object) -> str:
    """A token of 64 digits."""
    return "".join(f"{ord(c):02x}" for c in "-".join(map(str, names))).ljust(64, "0")[-64:]


def pose_fields(rotation: np.ndarray, place: Any) -> Row:
    """Translation and rotation (wxyz)."""
    turn = Rotation.from_matrix(rotation).as_quat(scalar_first=True)
    return {"translation": [float(x) for x in place], "rotation": turn.tolist()}


def linked(rows: list[Row]) -> list[Row]:
    """Rows with prev and next."""
    tokens = ["", *(row["token"] for row in rows), ""]
    return [row | {"prev": tokens[i], "next": tokens[i + 2]} for i, row in enumerate(rows)]


def write_lyft(root: Path) -> Path:
    """Write the scene below `root`."""
    for name in ("data", "images", "lidar", "maps"):
        (root / name).mkdir(parents=True)
    tables: dict[str, list[Row]] = {"attribute": [], "visibility": []}
    mounts = {}
    for channel, (_, yaw, _) in CAMERAS.items():
        turn = Rotation.from_euler("z", yaw).as_matrix()
        mounts[channel] = (turn @ FORWARD, turn @ [1.0, 0, 0] + [0.7, 0, 1.6])
    mounts |= {channel: (np.eye(3), np.array(place)) for channel, (_, place) in LIDARS.items()}
    tables["sensor"] = [
        {"token": token("s", c), "channel": c, "modality": "camera" if c in CAMERAS else "lidar"} for c in mounts
    ]
    tables["calibrated_sensor"] = [
        {
            "token": token("c", c),
            "sensor_token": token("s", c),
            "camera_intrinsic": intrinsic(c),
            **pose_fields(*mount),
        }
        for c, mount in mounts.items()
    ]
    tables["category"] = [{"token": token("k"), "name": "car", "description": "a car"}]
    log = token("log")
    tables["log"] = [{"token": log, "logfile": "", "vehicle": "a101", "date_captured": "2019-01-04"}]
    tables["log"][0]["location"] = "Palo Alto"
    scene = {"token": token("scene"), "name": "host-a101-lidar0-1", "description": "", "log_token": log}
    names = [token("sample", i) for i in range(SAMPLES)]
    ends = {"first_sample_token": names[0], "last_sample_token": names[-1], "nbr_samples": SAMPLES}
    tables["scene"] = [scene | ends]
    tables["sample"] = linked(
        [
            {"token": t, "timestamp": START_US + i * STEP_US + 0.25, "scene_token": scene["token"]}
            for i, t in enumerate(names)
        ]
    )
    tables["instance"] = [{"token": token("i"), "category_token": token("k"), "nbr_annotations": SAMPLES}]
    tables["instance"][0] |= {
        "first_annotation_token": token("a", 0),
        "last_annotation_token": token("a", SAMPLES - 1),
    }
    tables["sample_annotation"] = linked([annotation(i, names[i]) for i in range(SAMPLES)])
    tables["ego_pose"], tables["sample_data"] = [], []
    for channel, mount in mounts.items():
        tables["sample_data"] += linked([data(root, channel, mount, i, names[i], tables) for i in range(SAMPLES)])
    picture = {"token": token("map"), "category": "semantic_prior", "filename": "maps/map_raster_palette.png"}
    tables["map"] = [picture | {"log_tokens": [log]}]
    for name, rows in tables.items():
        (root / "data" / f"{name}.json").write_text(json.dumps(rows, indent=0))
    assert cv2.imwrite(str(root / "maps/map_raster_palette.png"), street()[:, :, ::-1])
    return root


def intrinsic(channel: str) -> list[list[float]]:
    """K, empty for LiDARs."""
    if channel not in CAMERAS:
        return []
    focal = CAMERAS[channel][2]
    return [[focal, 0, SIZE[0] / 2], [0, focal, SIZE[1] / 2], [0, 0, 1]]


def annotation(index: int, sample: str) -> Row:
    """The parked car."""
    row = {"token": token("a", index), "sample_token": sample, "instance_token": token("i"), "size": CAR_WLH}
    row |= pose_fields(np.eye(3), ORIGIN + CAR)
    return row | {"attribute_tokens": [], "visibility_token": "", "num_lidar_pts": -1, "num_radar_pts": 0}


def data(root: Path, channel: str, mount: Any, index: int, sample: str, tables: dict[str, list[Row]]) -> Row:
    """A picture or sweep, with its pose."""
    time = START_US + index * STEP_US + 0.25
    place = ORIGIN + np.array([SPEED * index * STEP_US * 1e-6, 0, 0])
    pose = {"token": token("p", channel, index), "timestamp": time, **pose_fields(np.eye(3), place)}
    tables["ego_pose"].append(pose)
    world_from_sensor = np.eye(4)
    world_from_sensor[:3, :3], world_from_sensor[:3, 3] = mount[0], mount[1] + place
    camera = channel in CAMERAS
    number = CAMERAS[channel][0] if camera else LIDARS[channel][0]
    name = (
        f"images/host-a101_cam{number}_{int(time)}.jpeg"
        if camera
        else f"lidar/host-a101_lidar{number}_{int(time)}.bin"
    )
    (root / name).write_bytes(jpeg(channel, world_from_sensor) if camera else sweep(world_from_sensor))
    row = {"token": token("d", channel, index), "sample_token": sample, "ego_pose_token": pose["token"]}
    row |= {"calibrated_sensor_token": token("c", channel), "timestamp": time, "is_key_frame": True, "filename": name}
    size = {"width": SIZE[0], "height": SIZE[1], "fileformat": "jpeg"}
    return row | (size if camera else {"width": None, "height": None, "fileformat": "bin"})


def jpeg(channel: str, world_from_cam: np.ndarray) -> bytes:
    """A picture of the balls."""
    k = np.array(intrinsic(channel))
    return ball_jpeg(lambda points: (points @ k.T)[:, :2] / points[:, 2:], SIZE, world_from_cam, ORIGIN)


def sweep(world_from_lidar: np.ndarray) -> bytes:
    """Points on the ground and on the car, in the LiDAR's frame."""
    rng = np.random.default_rng(5)
    ground = rng.uniform([-30, -30, 0], [60, 30, 0], (3000, 3))
    car = CAR + rng.uniform(-0.5, 0.5, (40, 3)) * [4.5, 1.8, 1.5]
    points = np.concatenate([ground, car]) + ORIGIN
    local = np.c_[points, np.ones(len(points))] @ np.linalg.inv(world_from_lidar).T
    local[:, 3] = 100.0
    return bytes(np.c_[local, np.full(len(local), -1.0)].astype(np.float32).tobytes())


def street() -> np.ndarray:
    """The map, 0.1 m a pixel from (0, 0): a road 12 m wide along y = 60 m, a white line, pavements 3 m wide."""
    picture = np.full((1200, 2000, 3), WHITE, np.uint8)
    for low, high, colour in ((51, 69, PAVEMENT), (54, 66, ROAD), (59.9, 60.1, LINE)):
        picture[round(1200 - high * 10) : round(1200 - low * 10)] = colour
    return picture
