"""A street of flat colours made by casting rays, as a dataset: what its pictures and sweeps show is known exactly.

Street frame: x along the road, y left, z up; the road |y| < 4 is grey with a white stripe along y = 0, what lies
beside it is brown. The ego stands at x = 0, 1, 2 .. m every 0.5 s. The world is the street turned and moved.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from appocc.camera import Camera
from appocc.checks import BoolArray, ByteArray, FloatArray, IntArray
from appocc.geometry import apply, inverse, quaternion_from_yaw, transform
from appocc.nuscenes import Dataset
from appocc.nuscenes.lidar import write_lidar
from appocc.nuscenes.writer import CATEGORIES, Annotation, Writer, token_of

START_US, STEP_US = 1_600_000_000_000_000, 500_000
WORLD_FROM_STREET = transform(quaternion_from_yaw(np.pi / 6), [100.0, -50.0, 3.0])
GREY, WHITE, BROWN, SKY = (100, 105, 110), (230, 235, 240), (150, 110, 70), (200, 220, 255)
RED, BLUE, GREEN = (200, 30, 25), (30, 50, 190), (40, 160, 60)
STRIPE_M, KERB_M = 0.3, 4.0
EGO_FROM_LIDAR = transform(np.eye(3), [0.9, 0.0, 1.84])
_CAM_AXES = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])  # right, down, ahead of a camera that looks along +x
YAW = {"CAM_FRONT": 0.0, "CAM_LEFT": np.pi / 2, "CAM_BACK": np.pi, "CAM_RIGHT": -np.pi / 2}
GROUND, NOTHING = -1, -2


@dataclass(frozen=True)
class Solid:
    """An opaque body with its axes along the street's; annotated where it has a category."""

    low: tuple[float, float, float]
    high: tuple[float, float, float]
    rgb: tuple[int, int, int]
    category: str = ""
    name: str = ""


Street = Callable[[float], Sequence[Solid]]


def car(x: float, y: float, rgb: tuple[int, int, int], name: str) -> Solid:
    """A car of 4 m x 2 m x 1.5 m with its centre at (x, y)."""
    return Solid((x - 2, y - 1, 0.0), (x + 2, y + 1, 1.5), rgb, "vehicle.car", name)


def camera(channel: str = "CAM_FRONT", width: int = 320, height: int = 180) -> Camera:
    """A camera of 90 degrees, 1.5 m above the road."""
    focal = width / 2
    intrinsic = np.array([[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1]])
    turn = transform(quaternion_from_yaw(YAW[channel]), [0.0, 0.0, 0.0])
    return Camera(channel, width, height, intrinsic, turn @ transform(_CAM_AXES, [1.0, 0.0, 1.5]))


def cast(eye: FloatArray, rays: FloatArray, solids: Sequence[Solid]) -> tuple[FloatArray, IntArray]:
    """How far along each ray (N, 3) something is hit first (infinity: nothing), and what: its number or GROUND."""
    with np.errstate(divide="ignore"):
        best = np.where(rays[:, 2] < 0, -eye[2] / rays[:, 2], np.inf)
        which = np.where(np.isfinite(best), GROUND, NOTHING)
        for i, solid in enumerate(solids):
            slabs = np.sort(np.stack([(np.array(end) - eye) / rays for end in (solid.low, solid.high)]), axis=0)
            near, far = slabs[0].max(axis=1), slabs[1].min(axis=1)
            hit = (near <= far) & (near > 0) & (near < best)
            best[hit], which[hit] = near[hit], i
    return best, which


def ground_rgb(xy: FloatArray) -> ByteArray:
    """True colours (N, 3) of the ground at street points (N, 2)."""
    side = np.abs(xy[:, 1])
    rgb = np.where(side[:, None] < KERB_M, GREY, BROWN)
    return np.where(side[:, None] < STRIPE_M / 2, WHITE, rgb).astype(np.uint8)


def photograph(view: Camera, street_from_cam: FloatArray, solids: Sequence[Solid]) -> ByteArray:
    """The picture (H, W, 3) that a camera takes."""
    u, v = np.meshgrid(np.arange(view.width_px), np.arange(view.height_px))
    pixels = np.stack([u, v, np.ones_like(u)], axis=-1).reshape(-1, 3).astype(np.float64)
    eye, rays = street_from_cam[:3, 3], pixels @ np.linalg.inv(view.intrinsic).T @ street_from_cam[:3, :3].T
    distance, which = cast(eye, rays, solids)
    rgb = np.tile(np.array(SKY, np.uint8), (len(rays), 1))
    ground = which == GROUND
    rgb[ground] = ground_rgb((eye + rays[ground] * distance[ground, None])[:, :2])
    for i, solid in enumerate(solids):
        rgb[which == i] = solid.rgb
    return rgb.reshape(view.height_px, view.width_px, 3)


def beams(elevations_deg: FloatArray, columns: int) -> FloatArray:
    """Directions (N, 3) of a spinning LiDAR."""
    elevation, azimuth = np.meshgrid(np.deg2rad(elevations_deg), np.linspace(0, 2 * np.pi, columns, endpoint=False))
    level = np.cos(elevation)
    rays = np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)], axis=-1).reshape(-1, 3)
    return rays + 1e-9  # none runs exactly along an axis


def scan(eye: FloatArray, solids: Sequence[Solid], rays: FloatArray) -> tuple[FloatArray, IntArray]:
    """Street points (N, 3) that a LiDAR sees within 60 m, and what each lies on."""
    distance, which = cast(eye, rays, solids)
    near = distance < 60
    return eye + rays[near] * distance[near, None], which[near]


def street_from_ego(time_s: float) -> FloatArray:
    """The ego drives at 2 m/s along the road, 1 m right of its middle."""
    return transform(np.eye(3), [2.0 * time_s, -1.0, 0.0])


@dataclass(frozen=True)
class Plan:
    """What a made dataset holds; times in seconds from its start.

    The pictures of a key frame show the street as its sweep and boxes do, however early they are stamped: a spinning
    LiDAR fires the cameras as it passes, and is stamped at the end of its turn.
    """

    street: Street
    samples: int = 2
    cameras: tuple[str, ...] = tuple(YAW)
    with_lidar: tuple[int, ...] = (0, 1)
    sweeps_s: tuple[float, ...] = ()
    camera_delay_s: float = 0.0
    annotated: bool = True
    labelled: bool = True
    elevations_deg: tuple[float, ...] = tuple(np.linspace(-30, 8, 48).tolist())


def make(root: Path, plan: Plan) -> Dataset:
    """Write a plan's dataset below `root` and open it."""
    writer = Writer(root, "v1.0-made")
    log, scene = token_of("log"), token_of("scene", "made")
    writer.add("log", log, logfile="made", vehicle="", date_captured="2020-09-13", location="made-town")
    mounts = {c: writer.add_sensor("made", c, camera(c).ego_from_cam, camera(c).intrinsic) for c in plan.cameras}
    mounts["LIDAR_TOP"] = writer.add_sensor("made", "LIDAR_TOP", EGO_FROM_LIDAR)
    samples = []
    for k in range(plan.samples):
        time_s = k * STEP_US * 1e-6
        samples.append(writer.add("sample", token_of("sample", k), timestamp=_us(time_s), scene_token=scene))
        for channel in plan.cameras:
            _add_picture(writer, plan, samples[-1], channel, mounts[channel], time_s)
        if k in plan.with_lidar:
            _add_scan(writer, plan, samples[-1], mounts["LIDAR_TOP"], time_s, key=True)
        for solid in plan.street(time_s) if plan.annotated else ():
            if solid.category:
                writer.add_annotation(scene, samples[-1], _annotation(solid))
    for time_s in plan.sweeps_s:
        owner = samples[min(int(np.ceil(time_s * 1e6 / STEP_US)), plan.samples - 1)]
        _add_scan(writer, plan, owner, mounts["LIDAR_TOP"], time_s, key=False)
    writer.add_scene("made", "a made street", log, samples)
    writer.save()
    return Dataset(root)


def _us(time_s: float) -> int:
    return START_US + round(time_s * 1e6)


def _annotation(solid: Solid) -> Annotation:
    low, high = np.array(solid.low), np.array(solid.high)
    length, width, height = high - low
    pose = WORLD_FROM_STREET @ transform(np.eye(3), (low + high) / 2)
    return Annotation(
        instance=solid.name,
        category=solid.category,
        world_from_box=pose,
        size_wlh_m=(float(width), float(length), float(height)),
    )


def _add_picture(writer: Writer, plan: Plan, sample: str, channel: str, mount: str, time_s: float) -> None:
    view, stamp_s = camera(channel), time_s + plan.camera_delay_s
    name = f"samples/{channel}/{_us(stamp_s)}.png"
    picture = photograph(view, street_from_ego(stamp_s) @ view.ego_from_cam, plan.street(time_s))
    path = writer.root / name
    path.parent.mkdir(parents=True, exist_ok=True)
    assert cv2.imwrite(str(path), picture[..., ::-1])
    pose = WORLD_FROM_STREET @ street_from_ego(stamp_s)
    writer.add_file(
        sample=sample,
        channel=channel,
        calibration=mount,
        world_from_ego=pose,
        timestamp_us=_us(stamp_s),
        filename=name,
        size_px=(view.width_px, view.height_px),
    )


def _add_scan(writer: Writer, plan: Plan, sample: str, mount: str, time_s: float, key: bool) -> None:
    street_from_lidar = street_from_ego(time_s) @ EGO_FROM_LIDAR
    rays = beams(np.array(plan.elevations_deg), 720)
    points, which = scan(street_from_lidar[:3, 3], plan.street(time_s), rays)
    name = f"{'samples' if key else 'sweeps'}/LIDAR_TOP/{_us(time_s)}.pcd.bin"
    write_lidar(writer.root / name, np.pad(apply(inverse(street_from_lidar), points), ((0, 0), (0, 2))))
    pose = WORLD_FROM_STREET @ street_from_ego(time_s)
    token = writer.add_file(sample, "LIDAR_TOP", mount, pose, _us(time_s), name, is_key_frame=key)
    if plan.labelled and key:
        label_name = f"lidarseg/{writer.version}/{token}_lidarseg.bin"
        path = writer.root / label_name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(_labels(points, which == GROUND).tobytes())
        writer.add_extra("lidarseg", token, sample_data_token=token, filename=label_name)


def _labels(points: FloatArray, ground: BoolArray) -> ByteArray:
    road = ground & (np.abs(points[:, 1]) < KERB_M)
    other = CATEGORIES.index("static.other")
    return np.where(road, CATEGORIES.index("flat.driveable_surface"), other).astype(np.uint8)
