"""A simulated dataset of three key frames on a made street, whose vehicles are known by heart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from street import BLACK, BLUE, GREEN, RED, WHITE, WORLD_FROM_EGO, Street

from appocc.bevmap import VEHICLE, bev_path
from appocc.geometry import quaternion_from_yaw, transform
from appocc.nuscenes.writer import Annotation, Writer, token_of
from benchmarks.grounding_truth.key_frames import TrueFrame, Vehicle

NAMES = {RED: "red", BLUE: "blue", WHITE: "white", BLACK: "black", GREEN: "green"}
CAR, VAN, TRUCK = (1.8, 4.4, 1.5), (2.0, 5.4, 2.3), (2.0, 5.4, 1.9)
Row = tuple[str, str, tuple[int, int, int], float, float, float, float]  # name, body, colour, x, y, yaw, speed
# The ego drives at y = 0 on a road from y = -8 to 8; parked rows on both sides, traffic in the lanes.
FRAMES: tuple[tuple[Row, ...], ...] = (
    (
        ("red", "sedan", RED, 14.0, -6.6, 0.0, 0.0),
        ("blue", "van", BLUE, 26.0, -6.6, 0.0, 0.0),
        ("facing", "suv", WHITE, 20.0, 6.6, np.pi, 0.0),
        ("mover", "hatchback", GREEN, 34.0, 0.0, 0.0, 4.0),
    ),
    (
        ("one", "sedan", WHITE, 14.0, -6.6, 0.0, 0.0),
        ("two", "hatchback", WHITE, 16.0, 6.6, np.pi, 0.0),
        ("slow", "pickup", BLUE, 14.0, 0.0, 0.0, 3.0),
        ("hidden", "sedan", BLACK, -20.0, -6.6, 0.0, 0.0),
    ),
    (),
)


def write_town(root: Path) -> None:
    """Write a dataset in the form of simulated ones: a key frame each of FRAMES."""
    writer = Writer(root, "v1.0-simulation")
    calibration = writer.add_sensor("scene", "LIDAR_TOP", np.eye(4))
    writer.add("log", "log", logfile="", vehicle="", date_captured="", location="nowhere")
    writer.add("map", "map", category="semantic_prior", filename="", log_tokens=["log"])
    samples = [token_of("sample", n) for n in range(len(FRAMES))]
    scene = writer.add_scene("scene", "", "log", samples)
    for n, (sample, rows) in enumerate(zip(samples, FRAMES, strict=True)):
        writer.add("sample", sample, timestamp=2_000_000 * (n + 1), scene_token=scene, prev="", next="")
        writer.add_file(sample, "LIDAR_TOP", calibration, WORLD_FROM_EGO, 2_000_000 * (n + 1), "none.bin")
        add_frame(writer, scene, sample, rows)
    writer.save()


def add_frame(writer: Writer, scene: str, sample: str, rows: Sequence[Row]) -> None:
    """The map, the boxes and the paints of a key frame."""
    street, owner = Street(), np.full((200, 200), -1, np.int32)
    for n, (name, body, rgb, x, y, yaw, speed) in enumerate(rows):
        size = {"van": VAN, "pickup": TRUCK}.get(body, CAR)
        before = street.occupancy[VEHICLE] > 0
        street.car(name, x, y, rgb, yaw, speed, size)
        owner[(street.occupancy[VEHICLE] > 0) & ~before] = n
        pose = WORLD_FROM_EGO @ transform(quaternion_from_yaw(yaw), [x, y, size[2] / 2])
        category = "vehicle.truck" if body == "pickup" else "vehicle.car"
        state = "vehicle.parked" if not speed else "vehicle.moving"
        level = "1" if name == "hidden" else "4"
        box = Annotation(
            instance=name,
            category=category,
            world_from_box=pose,
            size_wlh_m=size,
            attribute=state,
            visibility=level,
        )
        velocity = WORLD_FROM_EGO[:2, :2] @ (speed * np.array([np.cos(yaw), np.sin(yaw)]))
        writer.add_annotation(scene, sample, box, velocity)
        token = token_of("instance", scene, name)
        writer.add_extra("paint", token, instance_token=token, rgb=list(rgb), name=NAMES[rgb], body=body)
    bev = street.bev()
    bev = replace(bev, meta={"instances": [token_of("instance", scene, row[0]) for row in rows]})
    bev.save(bev_path(writer.root, "exact", sample), {"instance": owner})


def vehicle(moment: TrueFrame, name: str) -> Vehicle:
    """The one of a row of FRAMES."""
    scene = token_of("scene", "scene")
    return next(v for v in moment.vehicles if v.instance == token_of("instance", scene, name))
