"""A recording with six cameras on a made street, small enough to serve in tests: maps, boxes, plain images."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from street import BLACK, RED, WHITE, WORLD_FROM_EGO, Street

from appocc.bevmap import bev_path
from appocc.files import write_image
from appocc.geometry import quaternion_from_yaw, transform
from appocc.nuscenes.writer import Annotation, Writer, token_of
from appocc.rigs import read_rig

SCENE, STEP_US, STEP_M = "<b>street</b>", 500_000, 1.0
SIZE_PX = (96, 54)
# Name, colour, place in the first ego frame, heading, metres along x per frame.
VEHICLES = (
    ("right", WHITE, (14.0, -6.0), 0.0, 0.0),
    ("left", WHITE, (18.0, 6.0), np.pi, 0.0),
    ("red", RED, (26.0, -6.0), 0.0, 0.0),
    ("leader", BLACK, (20.0, 0.0), 0.0, STEP_M),
)
THRESHOLDS = {"road": 0.5, "vehicle": 0.5, "lane": 0.5}


def write_recording(root: Path, frames: int = 4, name: str = SCENE) -> Path:
    """Write a recording of some key frames, with `exact` and `predicted` maps; return its root.

    The ego drives 1 m a frame, the red car and the two white ones stand, the black one drives ahead. The default
    name of the scene is HTML.
    """
    writer = Writer(root, "v1.0-made")
    rig = read_rig("paper_full")
    cameras = [camera.resized(*SIZE_PX) for camera in rig]
    calibrations = {
        camera.channel: writer.add_sensor(name, camera.channel, camera.ego_from_cam, camera.intrinsic)
        for camera in cameras
    }
    writer.add("log", "log", logfile="", vehicle="", date_captured="", location="nowhere")
    writer.add("map", "map", category="semantic_prior", filename="", log_tokens=["log"])
    samples = [token_of("sample", n) for n in range(frames)]
    scene = writer.add_scene(name, "made for tests", "log", samples)
    for n, sample in enumerate(samples):
        time_us = STEP_US * (n + 1)
        pose = WORLD_FROM_EGO @ transform(np.eye(3), [STEP_M * n, 0.0, 0.0])
        writer.add("sample", sample, timestamp=time_us, scene_token=scene, prev="", next="")
        for number, camera in enumerate(cameras):
            path = f"samples/{camera.channel}/{n}.jpg"
            writer.add_file(sample, camera.channel, calibrations[camera.channel], pose, time_us, path, SIZE_PX)
            image = np.full((SIZE_PX[1], SIZE_PX[0], 3), (40 * number, 90, 200 - 30 * number), np.uint8)
            write_image(root / path, image)
        _add_maps(writer, sample, n)
        _add_boxes(writer, scene, sample, n)
    writer.save()
    return root


def _street(n: int) -> Street:
    street = Street()
    for name, rgb, (x, y), yaw, step in VEHICLES:
        street.car(name, x + (step - STEP_M) * n, y, rgb, yaw, step * 1e6 / STEP_US)
    return street


def _add_maps(writer: Writer, sample: str, n: int) -> None:
    bev = _street(n).bev()
    replace(bev, meta={"source": "simulated"}).save(bev_path(writer.root, "exact", sample))
    sure = replace(bev, occupancy=bev.occupancy * np.float32(0.9), meta={"thresholds": THRESHOLDS})
    sure.save(bev_path(writer.root, "predicted", sample))


def _add_boxes(writer: Writer, scene: str, sample: str, n: int) -> None:
    pose = WORLD_FROM_EGO @ transform(np.eye(3), [STEP_M * n, 0.0, 0.0])
    for name, _, (x, y), yaw, step in VEHICLES:
        place = transform(quaternion_from_yaw(yaw), [x + (step - STEP_M) * n, y, 0.75])
        box = Annotation(
            instance=name,
            category="vehicle.car",
            world_from_box=pose @ place,
            size_wlh_m=(1.8, 4.4, 1.5),
            attribute="vehicle.moving" if step else "vehicle.parked",
            visibility="4",
        )
        writer.add_annotation(scene, sample, box)
