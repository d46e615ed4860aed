"""A small PandaSet recording made by hand, in both forms: the plain copy, and the published form with pickles.

Six frames at 10 Hz, every second with images (0, 2, 4), the last of these without LiDAR. The ego (0.40 m above the
road) drives and turns; cameras fire before the LiDAR, each by its own time, and shake a little in their mounts.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from appocc.checks import FloatArray
from appocc.geometry import apply, inverse, quaternion_from_rotation, quaternion_from_yaw, transform

START_S = 1557539956.5
WIDTH, HEIGHT = 64, 36
CLASSES = {"5": "Vegetation", "6": "Ground", "7": "Road", "8": "Lane Line Marking", "11": "Sidewalk", "13": "Car"}
# Camera: yaw of its mount, how long before the LiDAR it fires.
CAMERAS = {
    "front_camera": (0.0, 0.050),
    "front_left_camera": (1.0, 0.080),
    "front_right_camera": (-1.0, 0.035),
    "left_camera": (1.6, 0.090),
    "right_camera": (-1.6, 0.019),
    "back_camera": (3.1, 0.100),
}
_CAM_AXES = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])
# PandaSet's LiDAR pose has x to the right and y forward.
EGO_FROM_PANDA_LIDAR = transform(np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]]), np.zeros(3))
# Track, class, place and heading of the length axis at first, speed, (length, width, height), motion, sensor, twin.
OBJECTS: list[tuple[str, str, list[float], float, float, list[float], str | None, int, str | None]] = [
    ("car", "Car", [12.0, 3.0, 0.9], 0.4, 0.0, [4.6, 1.8, 1.5], "Parked", -1, None),
    ("mover", "Pickup Truck", [-8.0, -3.0, 0.4], 0.2, 6.0, [5.4, 2.0, 1.9], "Moving", 0, "mover-twin"),
    ("mover-twin", "Pickup Truck", [-7.5, -3.0, 0.4], 0.2, 6.0, [5.4, 2.0, 1.9], "Moving", 1, "mover"),
    ("walker", "Pedestrian", [9.0, -6.0, 0.4], 1.5, 1.0, [0.6, 0.7, 1.8], None, 1, "nowhere"),
    ("cycle", "Motorcycle", [6.0, -5.0, 0.1], -0.9, 0.0, [2.0, 0.8, 1.3], "Stopped", -1, None),
]


def world_from_ego(time_s: float) -> FloatArray:
    """Pose of PandaSet's ego, `time_s` after the start."""
    yaw = 0.3 + 0.1 * time_s
    pose = transform(quaternion_from_yaw(yaw), [4.0 * time_s, 1.0 * time_s, 0.05 * time_s])
    nod = 0.01 * np.sin(7 * time_s)
    pose[:3, :3] = pose[:3, :3] @ np.array([[np.cos(nod), 0, np.sin(nod)], [0, 1, 0], [-np.sin(nod), 0, np.cos(nod)]])
    return pose


def world_from_cam(name: str, frame: int) -> FloatArray:
    """Pose of a camera when it takes its image of a frame."""
    yaw, before_s = CAMERAS[name]
    mount = transform(quaternion_from_yaw(yaw), [0.7, 0.5 * np.sin(yaw), 1.5]) @ transform(_CAM_AXES, np.zeros(3))
    rng = np.random.default_rng([frame, int(before_s * 1000)])
    shake = transform(np.array([1.0, *rng.normal(0, 0.001, 3)]), rng.normal(0, 0.004, 3))
    return world_from_ego(0.1 * frame - before_s) @ mount @ shake


def _picture(frame: int, name: str) -> bytes:
    rng = np.random.default_rng([frame, len(name)])
    done, data = cv2.imencode(".jpg", rng.integers(0, 255, (HEIGHT, WIDTH, 3), dtype=np.uint8))
    assert done
    return data.tobytes()


class PandaTwin:
    """The recording in memory; change `data` or `sweeps` as a test likes, then write."""

    def __init__(self, root: Path) -> None:
        """Make it, and write the plain form."""
        self.root = root
        self.source, self.lidar = root / "panda", root / "panda_lidar"
        self.data: dict[str, Any] = {
            "source": "made by hand",
            "intrinsics": {name: [[30.5, 0, 31.0], [0, 30.25, 17.5], [0, 0, 1]] for name in CAMERAS},
            "frames": [self._frame(i) for i in range(6)],
        }
        self.sweeps = {i: self._sweep(i) for i in (0, 2)}
        self.write()

    def _frame(self, i: int) -> dict[str, Any]:
        time_s = 0.1 * i
        return {
            "i": i,
            "t_lidar": START_S + time_s,
            "has_images": i % 2 == 0,
            "lidar_npz": f"../x/{i:02d}.npz" if i in (0, 2) else None,
            "T_world_ego": np.round(world_from_ego(time_s), 6).tolist(),
            "cameras": {
                name: {
                    "file": f"002/camera/{name}/{i:02d}.jpg",
                    "t": START_S + time_s - before_s,
                    "T_world_cam": np.round(world_from_cam(name, i), 6).tolist(),
                }
                for name, (_, before_s) in CAMERAS.items()
            },
            "boxes": [self._box(i, *row) for row in OBJECTS],
        }

    @staticmethod
    def _box(
        i: int, track: str, label: str, place: list[float], yaw: float, speed: float, *rest: Any
    ) -> dict[str, Any]:
        size, motion, sensor, sibling = rest
        way = 0.1 * i * speed
        return {
            "track": track,
            "class": label,
            "centre_world": [place[0] + way * float(np.cos(yaw)), place[1] + way * float(np.sin(yaw)), place[2]],
            "size_lwh": size,
            "yaw_world": yaw,
            "motion": motion,
            "sensor_id": sensor,
            "sibling": sibling,
        }

    @staticmethod
    def _sweep(i: int) -> dict[str, Any]:
        """Points on the road, and 25 in the parked car."""
        rng = np.random.default_rng(i)
        pose = world_from_ego(0.1 * i)
        road = np.column_stack([rng.uniform(-20, 20, (300, 2)), np.full(300, -0.4)])
        in_car = np.array([12.0, 3.0, 0.9]) + rng.uniform(-0.5, 0.5, (25, 3))
        points = np.vstack([road, apply(inverse(pose), in_car)])
        return {
            "xyz_cm_ego": np.round(points * 100).astype(np.int16),
            "intensity": rng.integers(0, 256, 325).astype(np.uint8),
            "semseg": np.concatenate([rng.choice([6, 7, 8, 11], 300), np.full(25, 13)]).astype(np.uint8),
        }

    def write(self) -> Path:
        """(Re)write the plain form; its folder."""
        self._images(self.source)
        (self.source / "frames.json").write_text(json.dumps(self.data))
        labels = self.source / "002/annotations/semseg"
        labels.mkdir(parents=True, exist_ok=True)
        (labels / "classes.json").write_text(json.dumps(CLASSES))
        (self.lidar / "npz").mkdir(parents=True, exist_ok=True)
        for i, sweep in self.sweeps.items():
            np.savez_compressed(self.lidar / "npz" / f"{i:02d}.npz", **sweep)
        label = np.zeros((60, 80), np.uint8)  # 12 m in y, 16 m in x, from (-4, -5)
        label[:30, :20], label[30:, :20], label[:30, 20:50] = 1, 2, 4
        np.savez_compressed(self.source / "road_world.npz", label=label, x0=-4, y0=-5, resolution=0.2)
        return self.source

    def _images(self, folder: Path) -> None:
        for i in (0, 2, 4):
            for name in CAMERAS:
                path = folder / "002" / "camera" / name / f"{i:02d}.jpg"
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(_picture(i, name))

    def publish(self) -> Path:
        """Write the published form, with pickles, from the same numbers; the folder of its sequences."""
        folder = self.root / "published"
        self._images(folder)
        sequence = folder / "002"
        frames = self.data["frames"]
        lidar_poses = [np.array(f["T_world_ego"]) @ EGO_FROM_PANDA_LIDAR for f in frames]
        self._json(sequence / "lidar" / "poses.json", [_published_pose(pose) for pose in lidar_poses])
        self._json(sequence / "lidar" / "timestamps.json", [f["t_lidar"] for f in frames])
        for name in CAMERAS:
            camera = sequence / "camera" / name
            k = self.data["intrinsics"][name]
            values = {"fx": k[0][0], "fy": k[1][1], "cx": k[0][2], "cy": k[1][2]}
            self._json(camera / "intrinsics.json", values)
            self._json(camera / "timestamps.json", [f["cameras"][name]["t"] for f in frames])
            poses = [np.array(f["cameras"][name]["T_world_cam"]) for f in frames]
            self._json(camera / "poses.json", [_published_pose(pose) for pose in poses])
        self._json(sequence / "annotations" / "semseg" / "classes.json", CLASSES)
        self._pickles(sequence)
        return folder

    def _pickles(self, sequence: Path) -> None:
        import pandas as pd

        for i, frame in enumerate(self.data["frames"]):
            cuboids = sequence / "annotations" / "cuboids" / f"{i:02d}.pkl.gz"
            cuboids.parent.mkdir(parents=True, exist_ok=True)
            pd.DataFrame([_published_box(box) for box in frame["boxes"]]).to_pickle(cuboids)
        for i, sweep in self.sweeps.items():
            xyz = apply(np.array(self.data["frames"][i]["T_world_ego"]), sweep["xyz_cm_ego"] / 100)
            rows = pd.DataFrame(xyz, columns=list("xyz"))
            rows["i"], rows["t"], rows["d"] = sweep["intensity"].astype(np.float64), 0.0, 0
            forward = rows.iloc[:40].assign(d=1)  # the other LiDAR's points lie in the same table
            labels = pd.DataFrame({"class": np.concatenate([sweep["semseg"], np.full(40, 5)]).astype(np.int64)})
            pd.concat([rows, forward]).to_pickle(sequence / "lidar" / f"{i:02d}.pkl.gz")
            labels.to_pickle(sequence / "annotations" / "semseg" / f"{i:02d}.pkl.gz")

    @staticmethod
    def _json(path: Path, value: Any) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(value))


def _published_pose(pose: FloatArray) -> dict[str, dict[str, float]]:
    w, x, y, z = quaternion_from_rotation(pose[:3, :3]).tolist()
    position = dict(zip("xyz", pose[:3, 3].tolist(), strict=True))
    return {"position": position, "heading": {"w": w, "x": x, "y": y, "z": z}}


def _published_box(box: dict[str, Any]) -> dict[str, Any]:
    """A row of a cuboid table: yaw is the heading of the width axis, dimensions.x the width."""
    length, width, height = box["size_lwh"]
    x, y, z = box["centre_world"]
    return {
        "uuid": box["track"],
        "label": box["class"],
        "yaw": box["yaw_world"] - np.pi / 2,
        "position.x": x,
        "position.y": y,
        "position.z": z,
        "dimensions.x": width,
        "dimensions.y": length,
        "dimensions.z": height,
        "attributes.object_motion": box["motion"],
        "cuboids.sensor_id": box["sensor_id"],
        "cuboids.sibling_id": box["sibling"] or "-",
    }
