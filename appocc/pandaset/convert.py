"""Conversion of PandaSet recordings to the nuScenes schema."""

from __future__ import annotations

import shutil
from collections.abc import Callable

import cv2
import numpy as np

from appocc.boxes import Boxes, is_vehicle
from appocc.checks import ByteArray, FloatArray
from appocc.files import read_image, write_bytes, write_image
from appocc.geometry import apply, interpolate_pose, inverse, mean_pose, quaternion_from_yaw, transform
from appocc.levelling import ego_from_level
from appocc.nuscenes.dataset import LIDAR
from appocc.nuscenes.lidar import write_lidar
from appocc.nuscenes.writer import CATEGORIES, Annotation, Writer, token_of
from appocc.pandaset.classes import attribute_of, category_of
from appocc.pandaset.recording import Cuboid, PandaFrame, PandaSweep, Recording, RoadRaster, drop_duplicate_cuboids

VERSION = "v1.0-pandaset"
# PandaSet's ego origin is 0.40 m above the road (median of its road points), nuScenes' ego origin is on the road.
# x and y are not changed: the distance of PandaSet's origin from the rear axle is unknown.
EGO_HEIGHT_M = 0.40
UNKNOWN_GREY = 127
# nuScenes' LiDAR frame has x to the right and y forward.
_OLD_EGO_FROM_LIDAR = transform(np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]]), [0.0, 0.0, 0.0])


def convert(recording: Recording, writer: Writer, advance: Callable[[int], None]) -> None:
    """Write the files of a recording below the writer's root and add its rows; `advance` is the progress callback.

    Raises:
        DataError: if an image or a sweep is missing or damaged.
    """
    name = recording.name
    scene, log = token_of("scene", name), token_of("log", name)
    date = _date(recording.frames[0].time_s)
    writer.add("log", log, logfile=name, vehicle="pandaset", date_captured=date, location="san-francisco")
    old_from_new = old_from_new_ego(recording)
    calibration, ego_from_cam = _calibrate(recording, old_from_new, writer)
    samples = []
    for frame in recording.frames:
        sample = token_of("sample", name, frame.index)
        timestamp = _us(frame.time_s)
        samples.append(writer.add("sample", sample, timestamp=timestamp, scene_token=scene, prev="", next=""))
        _add_images(recording, frame, sample, writer, calibration, ego_from_cam)
        points = _add_sweep(recording, frame, sample, old_from_new, writer, calibration[LIDAR])
        for box in _annotations(frame, points):
            writer.add_annotation(scene, sample, box)
        advance(1)
    writer.add_scene(name, recording.source, log, samples)
    if recording.road is not None:
        _add_road(recording.road, name, log, writer)
    else:
        writer.add_no_map(log)
    for index, label in recording.label_names.items():
        row = {"index": index, "name": label, "category": category_of(label)}
        if row not in [{k: r[k] for k in row} for r in writer.extra.get("pointlabels_category", [])]:
            writer.add_extra("pointlabels_category", token_of("pointlabel", index, label), **row)


def _us(time_s: float) -> int:
    return round(time_s * 1e6)


def _date(time_s: float) -> str:
    return str(np.datetime64(int(time_s), "s").astype("datetime64[D]"))


def old_from_new_ego(recording: Recording) -> FloatArray:
    """Return the (4, 4) pose of nuScenes' ego frame, on the road and level with it, in PandaSet's.

    PandaSet's LiDAR is mounted with a tilt (2 degrees in sequence 002). The ground is where annotated vehicles stand;
    with too few of them, it is `EGO_HEIGHT_M` below, without a tilt.
    """
    bottoms = []
    for frame in recording.frames:
        vehicles = [box for box in frame.cuboids if is_vehicle(category_of(box.label))]
        centres = np.array([box.centre_world_m for box in vehicles]).reshape(-1, 3)
        heights = np.array([box.size_lwh_m[2] for box in vehicles])
        bottoms.append(apply(inverse(frame.world_from_ego), centres - np.outer(heights / 2, [0.0, 0.0, 1.0])))
    level = ego_from_level(np.concatenate(bottoms))
    return transform(np.eye(3), [0.0, 0.0, -EGO_HEIGHT_M]) if level is None else level


def _calibrate(
    recording: Recording, old_from_new: FloatArray, writer: Writer
) -> tuple[dict[str, str], dict[str, FloatArray]]:
    """Add one calibrated_sensor per sensor; a camera pose is the mean over all images, relative to the ego.

    Images are up to 0.1 s earlier than the LiDAR timestamp, so the ego pose is interpolated to their times.
    """
    times = np.array([frame.time_s for frame in recording.frames])
    poses = np.stack([frame.world_from_ego @ old_from_new for frame in recording.frames])
    tokens = {LIDAR: writer.add_sensor(recording.name, LIDAR, inverse(old_from_new) @ _OLD_EGO_FROM_LIDAR)}
    mounted = {}
    for channel, intrinsic in recording.intrinsics.items():
        images = [m.images[channel] for m in recording.frames if channel in m.images]
        if not images:
            continue
        relative = [inverse(interpolate_pose(times, poses, i.time_s)) @ i.world_from_cam for i in images]
        mounted[channel] = mean_pose(np.stack(relative))
        tokens[channel] = writer.add_sensor(recording.name, channel, mounted[channel], intrinsic)
    return tokens, mounted


def _add_images(
    recording: Recording,
    frame: PandaFrame,
    sample: str,
    writer: Writer,
    calibration: dict[str, str],
    ego_from_cam: dict[str, FloatArray],
) -> None:
    """Copy the images of a frame; each ego pose is chosen so that the camera pose is exactly PandaSet's."""
    for channel, image in frame.images.items():
        timestamp = _us(image.time_s)
        filename = f"samples/{channel}/{recording.name}__{channel}__{timestamp}.jpg"
        height, width = read_image(image.path).shape[:2]
        target = writer.root / filename
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(image.path, target)
        world_from_ego = image.world_from_cam @ inverse(ego_from_cam[channel])
        token = calibration[channel]
        writer.add_file(
            sample=sample,
            channel=channel,
            calibration=token,
            world_from_ego=world_from_ego,
            timestamp_us=timestamp,
            filename=filename,
            size_px=(width, height),
        )


def _add_sweep(
    recording: Recording, frame: PandaFrame, sample: str, old_from_new: FloatArray, writer: Writer, calibration: str
) -> FloatArray | None:
    """Write sweep and labels of a frame; return the points (N, 3) in the world frame, None without LiDAR."""
    if frame.read_sweep is None:
        return None
    sweep = frame.read_sweep()
    points_lidar = apply(inverse(_OLD_EGO_FROM_LIDAR), sweep.points_ego_m)
    # PandaSet does not publish the ring index: -1.
    columns = [points_lidar, sweep.intensity[:, None].astype(np.float64), np.full((len(points_lidar), 1), -1.0)]
    timestamp = _us(frame.time_s)
    filename = f"samples/{LIDAR}/{recording.name}__{LIDAR}__{timestamp}.pcd.bin"
    write_lidar(writer.root / filename, np.hstack(columns))
    token = writer.add_file(sample, LIDAR, calibration, frame.world_from_ego @ old_from_new, timestamp, filename)
    _add_labels(recording, sweep, token, writer)
    return apply(frame.world_from_ego, sweep.points_ego_m)


def _add_labels(recording: Recording, sweep: PandaSweep, data_token: str, writer: Writer) -> None:
    """Write the labels of a sweep as nuScenes-lidarseg and as PandaSet's classes, which include lane markings."""
    if sweep.labels is None or not recording.label_names:
        return
    category = np.zeros(256, np.uint8)
    for index, label in recording.label_names.items():
        category[index] = CATEGORIES.index(category_of(label))
    for table, labels in (("lidarseg", category[sweep.labels]), ("pointlabels", sweep.labels)):
        filename = f"{table}/{writer.version}/{data_token}_{table}.bin"
        write_bytes(writer.root / filename, labels.astype(np.uint8).tobytes())
        writer.add_extra(table, data_token, sample_data_token=data_token, filename=filename)


def _annotations(frame: PandaFrame, points_world: FloatArray | None) -> list[Annotation]:
    """Return the boxes of a frame without duplicates, with the number of LiDAR points in each (-1 without LiDAR)."""
    return [_annotation(cuboid, points_world) for cuboid in drop_duplicate_cuboids(frame.cuboids)]


def _annotation(cuboid: Cuboid, points_world: FloatArray | None) -> Annotation:
    pose = transform(quaternion_from_yaw(cuboid.yaw_world_rad), cuboid.centre_world_m)
    length, width, height = (float(v) for v in cuboid.size_lwh_m)
    box = Boxes(
        centre_m=pose[None, :3, 3],
        size_wlh_m=np.array([[width, length, height]]),
        rotation=pose[None, :3, :3],
        category=("",),
        instance=("",),
        token=("",),
        velocity_mps=np.full((1, 2), np.nan),
        lidar_points=np.zeros(1, np.int64),
    )
    return Annotation(
        instance=cuboid.track,
        category=category_of(cuboid.label),
        world_from_box=pose,
        size_wlh_m=(width, length, height),
        attribute=attribute_of(cuboid.label, cuboid.motion),
        lidar_points=-1 if points_world is None else int(box.inside(points_world).sum()),
    )


def road_mask(road: RoadRaster) -> ByteArray:
    """Return the mask image at 10 px per metre, top row = largest y: 255 road, 0 other ground, 127 unknown."""
    grey = np.array([UNKNOWN_GREY, 255], np.uint8)[np.minimum(road.label, 1)]
    grey[road.label > 1] = 0
    return cv2.resize(grey[::-1], None, fx=road.scale, fy=road.scale, interpolation=cv2.INTER_NEAREST).astype(
        np.uint8
    )


def _add_road(road: RoadRaster, name: str, log: str, writer: Writer) -> None:
    """Add the road raster as a map mask.

    PandaSet's world has negative coordinates, but the lower left corner of nuScenes' masks is (0, 0): the corner is
    stored as `origin_m`; readers without support for this field see a shifted mask.
    """
    token = token_of("map", name)
    filename = f"maps/{token}.png"
    write_image(writer.root / filename, road_mask(road))
    writer.add(
        "map",
        token,
        category="semantic_prior",
        filename=filename,
        log_tokens=[log],
        origin_m=list(road.origin_m),
        unknown_value=UNKNOWN_GREY,
        source="derived from the semantic labels of the accumulated LiDAR; no map is published",
    )
