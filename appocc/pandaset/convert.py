"""A PandaSet recording written in the nuScenes schema."""

from __future__ import annotations

import shutil
from collections.abc import Callable

import cv2
import numpy as np

from appocc.boxes import Boxes
from appocc.checks import ByteArray, FloatArray
from appocc.files import read_image, write_bytes, write_image
from appocc.geometry import apply, interpolate_pose, inverse, mean_pose, quaternion_from_yaw, transform
from appocc.nuscenes.dataset import LIDAR
from appocc.nuscenes.lidar import write_lidar
from appocc.nuscenes.writer import CATEGORIES, Annotation, Writer, token_of
from appocc.pandaset.classes import attribute_of, category_of
from appocc.pandaset.recording import Cuboid, Moment, Recording, RoadRaster, Sweep, without_twins

VERSION = "v1.0-pandaset"
# PandaSet's ego lies 0.40 m above the road (median of its road points); nuScenes' lies on it.
# x and y are kept: how far PandaSet's origin is from the rear axle is not known.
EGO_HEIGHT_M = 0.40
UNKNOWN_GREY = 127
_OLD_FROM_NEW_EGO = transform(np.eye(3), [0.0, 0.0, -EGO_HEIGHT_M])
# nuScenes' LiDAR frame has x to the right and y forward.
_EGO_FROM_LIDAR = transform(np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]]), [0.0, 0.0, EGO_HEIGHT_M])


def convert(recording: Recording, writer: Writer, advance: Callable[[int], None]) -> None:
    """Write a recording's files below the writer's root and its rows into the writer; `advance` is called a frame.

    Raises:
        DataError: if an image or a sweep is missing or damaged.
    """
    name = recording.name
    scene, log = token_of("scene", name), token_of("log", name)
    date = _date(recording.moments[0].time_s)
    writer.add("log", log, logfile=name, vehicle="pandaset", date_captured=date, location="san-francisco")
    calibration, ego_from_cam = _calibrate(recording, writer)
    samples = []
    for moment in recording.moments:
        sample = token_of("sample", name, moment.index)
        timestamp = _us(moment.time_s)
        samples.append(writer.add("sample", sample, timestamp=timestamp, scene_token=scene, prev="", next=""))
        _add_images(recording, moment, sample, writer, calibration, ego_from_cam)
        points = _add_sweep(recording, moment, sample, writer, calibration[LIDAR])
        for box in _annotations(moment, points):
            writer.add_annotation(scene, sample, box)
        advance(1)
    writer.add_scene(name, recording.source, log, samples)
    if recording.road is not None:
        _add_road(recording.road, name, log, writer)
    for index, label in recording.label_names.items():
        row = {"index": index, "name": label, "category": category_of(label)}
        if row not in [{k: r[k] for k in row} for r in writer.extra.get("pointlabels_category", [])]:
            writer.add_extra("pointlabels_category", token_of("pointlabel", index, label), **row)


def _us(time_s: float) -> int:
    return round(time_s * 1e6)


def _date(time_s: float) -> str:
    return str(np.datetime64(int(time_s), "s").astype("datetime64[D]"))


def world_from_new_ego(moment: Moment) -> FloatArray:
    """(4, 4) pose of nuScenes' ego (on the road) at the time of the LiDAR."""
    return moment.world_from_ego @ _OLD_FROM_NEW_EGO


def _calibrate(recording: Recording, writer: Writer) -> tuple[dict[str, str], dict[str, FloatArray]]:
    """One calibrated_sensor a sensor: the mean camera pose relative to the ego at each image's own time.

    Cameras fire up to 0.1 s before the LiDAR stamp, so the ego pose is interpolated to the image's time first.
    """
    times = np.array([moment.time_s for moment in recording.moments])
    poses = np.stack([world_from_new_ego(moment) for moment in recording.moments])
    tokens = {LIDAR: writer.add_sensor(recording.name, LIDAR, _EGO_FROM_LIDAR)}
    mounted = {}
    for channel, intrinsic in recording.intrinsics.items():
        images = [m.images[channel] for m in recording.moments if channel in m.images]
        if not images:
            continue
        relative = [inverse(interpolate_pose(times, poses, i.time_s)) @ i.world_from_cam for i in images]
        mounted[channel] = mean_pose(np.stack(relative))
        tokens[channel] = writer.add_sensor(recording.name, channel, mounted[channel], intrinsic)
    return tokens, mounted


def _add_images(
    recording: Recording,
    moment: Moment,
    sample: str,
    writer: Writer,
    calibration: dict[str, str],
    ego_from_cam: dict[str, FloatArray],
) -> None:
    """Copy the images of a frame; each one's ego pose is solved so that its camera pose is exactly PandaSet's."""
    for channel, image in moment.images.items():
        timestamp = _us(image.time_s)
        filename = f"samples/{channel}/{recording.name}__{channel}__{timestamp}.jpg"
        height, width = read_image(image.path).shape[:2]
        target = writer.root / filename
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(image.path, target)
        world_from_ego = image.world_from_cam @ inverse(ego_from_cam[channel])
        token = calibration[channel]
        writer.add_file(sample, channel, token, world_from_ego, timestamp, filename, (width, height))


def _add_sweep(
    recording: Recording, moment: Moment, sample: str, writer: Writer, calibration: str
) -> FloatArray | None:
    """Write the sweep of a frame and its labels; returns its points (N, 3) in the world, None without LiDAR."""
    if moment.read_sweep is None:
        return None
    sweep = moment.read_sweep()
    points_ego = sweep.points_ego_m + np.array([0.0, 0.0, EGO_HEIGHT_M])
    points_lidar = apply(inverse(_EGO_FROM_LIDAR), points_ego)
    # PandaSet does not publish the ring of a point: -1.
    columns = [points_lidar, sweep.intensity[:, None].astype(np.float64), np.full((len(points_lidar), 1), -1.0)]
    timestamp = _us(moment.time_s)
    filename = f"samples/{LIDAR}/{recording.name}__{LIDAR}__{timestamp}.pcd.bin"
    write_lidar(writer.root / filename, np.hstack(columns))
    token = writer.add_file(sample, LIDAR, calibration, world_from_new_ego(moment), timestamp, filename)
    _add_labels(recording, sweep, token, writer)
    return apply(moment.world_from_ego, sweep.points_ego_m)


def _add_labels(recording: Recording, sweep: Sweep, data_token: str, writer: Writer) -> None:
    """Labels of a sweep: as nuScenes-lidarseg, and PandaSet's own beside it (they alone tell lane markings)."""
    if sweep.labels is None or not recording.label_names:
        return
    category = np.zeros(256, np.uint8)
    for index, label in recording.label_names.items():
        category[index] = CATEGORIES.index(category_of(label))
    for table, labels in (("lidarseg", category[sweep.labels]), ("pointlabels", sweep.labels)):
        filename = f"{table}/{writer.version}/{data_token}_{table}.bin"
        write_bytes(writer.root / filename, labels.astype(np.uint8).tobytes())
        writer.add_extra(table, data_token, sample_data_token=data_token, filename=filename)


def _annotations(moment: Moment, points_world: FloatArray | None) -> list[Annotation]:
    """Boxes of a frame without twins, with the number of LiDAR points in each (-1, unknown, without LiDAR)."""
    return [_annotation(cuboid, points_world) for cuboid in without_twins(moment.cuboids)]


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
        cuboid.track,
        category_of(cuboid.label),
        pose,
        (width, length, height),
        attribute_of(cuboid.label, cuboid.motion),
        -1 if points_world is None else int(box.inside(points_world).sum()),
    )


def road_mask(road: RoadRaster) -> ByteArray:
    """Mask picture at 10 px a metre, top row = largest y: 255 road, 0 other ground, 127 not known."""
    grey = np.array([UNKNOWN_GREY, 255], np.uint8)[np.minimum(road.label, 1)]
    grey[road.label > 1] = 0
    return cv2.resize(grey[::-1], None, fx=road.scale, fy=road.scale, interpolation=cv2.INTER_NEAREST).astype(
        np.uint8
    )


def _add_road(road: RoadRaster, name: str, log: str, writer: Writer) -> None:
    """The road raster as a map mask.

    The world of PandaSet has negative coordinates, which nuScenes' masks (lower left corner at 0, 0) cannot hold: the
    corner is recorded as `origin_m`; readers that do not know the field see the mask shifted.
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
