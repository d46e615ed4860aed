"""A dataset small enough to know by heart: one scene, three samples, two cameras and a LiDAR, two objects.

Written by hand, without the package's own writer, so that reader and writer can be judged by it. The ego drives
along world +y at 5 m/s, starting at (100, 200, 0); a parked car stands 10 m ahead of its start, a pedestrian walks
along at 1 m/s.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np

Row = dict[str, Any]

START_US = 1_600_000_000_000_000
STEP_US = 500_000
SPEED_MPS = 5.0
WIDTH_PX, HEIGHT_PX = 32, 20
INTRINSIC = [[20.0, 0.0, 15.5], [0.0, 20.0, 9.5], [0.0, 0.0, 1.0]]
HALF = 0.5**0.5
# A turn by +90 degrees about z: the ego's x axis lies along world +y.
WORLD_FROM_EGO_WXYZ = [HALF, 0.0, 0.0, HALF]
# Camera axes (right, down, ahead) of a camera that looks along ego +x, and of one that looks along -x.
AHEAD_WXYZ, BEHIND_WXYZ = [0.5, -0.5, 0.5, -0.5], [0.5, -0.5, -0.5, 0.5]
POINTS = np.array([[1, 0, -1.8, 10, 0], [0, 5, -1.8, 20, 1], [-2, 9, 0, 30, 2]], dtype=np.float32)


def token(*names: object) -> str:
    """A readable token of 32 characters."""
    return "-".join(str(name) for name in names).ljust(32, "0")


class TinyDataset:
    """The tables as plain dicts (change them as a test likes, then `write`) and the files below `root`."""

    version = "v1.0-tiny"

    def __init__(self, root: Path) -> None:
        """Make tables and files."""
        self.root = root
        self.tables: dict[str, list[Row]] = {}
        self._make_fixed_tables()
        self._make_scene()
        self._make_annotations()
        self.write()

    def write(self) -> Path:
        """(Re)write all tables; the root."""
        folder = self.root / self.version
        folder.mkdir(parents=True, exist_ok=True)
        for name, rows in self.tables.items():
            (folder / f"{name}.json").write_text(json.dumps(rows, indent=0))
        return self.root

    def row(self, table: str, wanted: str) -> Row:
        """The row of a token."""
        return next(row for row in self.tables[table] if row["token"] == wanted)

    def _make_fixed_tables(self) -> None:
        log, names = token("log"), ("vehicle.car", "human.pedestrian.adult")
        channels = {"CAM_FRONT": AHEAD_WXYZ, "CAM_BACK": BEHIND_WXYZ, "LIDAR_TOP": [1.0, 0.0, 0.0, 0.0]}
        self.tables = {
            "attribute": [{"token": token("attribute"), "name": "vehicle.parked", "description": ""}],
            "category": [{"token": token("category", n), "name": n, "description": ""} for n in names],
            "visibility": [{"token": "4", "level": "v80-100", "description": ""}],
            "sensor": [
                {"token": token("sensor", c), "channel": c, "modality": "camera" if "CAM" in c else "lidar"}
                for c in channels
            ],
            "calibrated_sensor": [
                {
                    "token": token("mount", c),
                    "sensor_token": token("sensor", c),
                    "translation": [1.5, 0.0, 1.6] if "CAM" in c else [1.0, 0.0, 1.8],
                    "rotation": wxyz,
                    "camera_intrinsic": INTRINSIC if "CAM" in c else [],
                }
                for c, wxyz in channels.items()
            ],
            "log": [
                {"token": log, "logfile": "x", "vehicle": "v", "date_captured": "2020-09-13", "location": "nowhere"}
            ],
            "map": [
                {
                    "token": token("map"),
                    "category": "semantic_prior",
                    "filename": "maps/drivable.png",
                    "log_tokens": [log],
                }
            ],
        }
        self._write_image("maps/drivable.png", np.full((30, 40), 255, np.uint8))

    def _make_scene(self) -> None:
        samples, scene = [token("sample", i) for i in range(3)], token("scene")
        self.tables["scene"] = [
            {
                "token": scene,
                "log_token": token("log"),
                "nbr_samples": 3,
                "first_sample_token": samples[0],
                "last_sample_token": samples[-1],
                "name": "scene-tiny",
                "description": "a made-up street",
            }
        ]
        self.tables["sample"] = linked(
            {"token": t, "timestamp": START_US + i * STEP_US, "scene_token": scene} for i, t in enumerate(samples)
        )
        self.tables["ego_pose"] = []
        self.tables["sample_data"] = []
        for channel in ("CAM_FRONT", "CAM_BACK", "LIDAR_TOP"):
            # Key frames at 0, 0.5 and 1 s, a sweep at 0.25 s; cameras fire 10 ms before the LiDAR.
            moments = [(0.0, samples[0], True), (0.25, samples[1], False), (0.5, samples[1], True)]
            moments.append((1.0, samples[2], True))
            offset_s = 0.0 if channel == "LIDAR_TOP" else -0.01
            files = [self._file(channel, sample, at + offset_s, key) for at, sample, key in moments]
            self.tables["sample_data"] += linked(files)

    def _file(self, channel: str, sample: str, at_s: float, key: bool) -> Row:
        """A sensor file with its ego pose."""
        time_us = START_US + round(at_s * 1e6)
        name = token(channel, time_us - START_US)
        self.tables["ego_pose"].append(
            {
                "token": name,
                "timestamp": time_us,
                "rotation": WORLD_FROM_EGO_WXYZ,
                "translation": [100.0, 200.0 + SPEED_MPS * at_s, 0.0],
            }
        )
        camera = channel.startswith("CAM")
        path = f"{'samples' if key else 'sweeps'}/{channel}/{time_us}{'.jpg' if camera else '.pcd.bin'}"
        if camera:
            self._write_image(path, np.full((HEIGHT_PX, WIDTH_PX, 3), (40, 80, 160), np.uint8))
        else:
            self._write(path, POINTS.tobytes())
        return {
            "token": name,
            "sample_token": sample,
            "ego_pose_token": name,
            "calibrated_sensor_token": token("mount", channel),
            "timestamp": time_us,
            "fileformat": "jpg" if camera else "pcd",
            "is_key_frame": key,
            "height": HEIGHT_PX if camera else 0,
            "width": WIDTH_PX if camera else 0,
            "filename": path,
        }

    def _make_annotations(self) -> None:
        self.tables["instance"], self.tables["sample_annotation"] = [], []
        objects = (
            ("car", "vehicle.car", 3, [100.0, 210.0, 0.8], 0.0, [1.9, 4.6, 1.6]),
            ("walker", "human.pedestrian.adult", 2, [95.0, 205.0, 0.9], 1.0, [0.6, 0.5, 1.8]),
        )
        for name, category, count, place, speed, size in objects:
            rows = linked(
                {
                    "token": token(name, i),
                    "sample_token": token("sample", i),
                    "instance_token": token(name),
                    "visibility_token": "4",
                    "attribute_tokens": [token("attribute")] if name == "car" else [],
                    "translation": [place[0], place[1] + speed * i * STEP_US * 1e-6, place[2]],
                    "size": size,
                    "rotation": WORLD_FROM_EGO_WXYZ,
                    "num_lidar_pts": 7,
                    "num_radar_pts": 0,
                }
                for i in range(count)
            )
            self.tables["sample_annotation"] += rows
            self.tables["instance"].append(
                {
                    "token": token(name),
                    "category_token": token("category", category),
                    "nbr_annotations": count,
                    "first_annotation_token": rows[0]["token"],
                    "last_annotation_token": rows[-1]["token"],
                }
            )

    def _write(self, name: str, data: bytes) -> None:
        path = self.root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)

    def _write_image(self, name: str, bgr: np.typing.NDArray[np.uint8]) -> None:
        done, data = cv2.imencode(Path(name).suffix, bgr)
        assert done
        self._write(name, data.tobytes())


def linked(rows: Any) -> list[Row]:
    """Rows in order of time with `prev` and `next` filled in."""
    chain = list(rows)
    tokens = ["", *(row["token"] for row in chain), ""]
    return [{**row, "prev": tokens[i], "next": tokens[i + 2]} for i, row in enumerate(chain)]
