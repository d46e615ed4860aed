"""Frames and cameras of KITTI's recording vehicle, from its calibration files."""

from __future__ import annotations

import re
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from appocc.checks import BoolArray, FloatArray, IntArray
from appocc.errors import DataError, ShapeError
from appocc.files import MOST_TEXT_BYTES, read_image, read_text
from appocc.geometry import transform
from appocc.importers.kitti.categories import CATEGORIES, RIDDEN
from appocc.importers.kitti.log import EGO_VEHICLE
from appocc.lenses import DistortedLens
from appocc.nuscenes.writer import Annotation
from appocc.rigs import SourceRig
from appocc.rigs.cutting import cut_rig
from appocc.rigs.source_camera import SourceCamera

# KITTI's drawing of the sensors has the IMU 0.05 m behind the rear axle, 0.32 m left of the middle, 0.93 m high.
EGO_FROM_IMU = transform(np.eye(3), [-0.05, 0.32, 0.93])
CHANNELS = {"image_02": "CAM_FRONT", "image_03": "CAM_STEREO_RIGHT"}
_NAMED = 8
_TIME = re.compile(r"(\d{4}-\d\d-\d\d \d\d:\d\d:\d\d)(?:\.(\d{1,9}))?")


def pinhole_rig(
    ego_from_rect: FloatArray, projections: Mapping[str, FloatArray], pictures: Mapping[str, Path]
) -> SourceRig:
    """Return the rig of rectified cameras, as large as their pictures.

    Args:
        ego_from_rect: (4, 4) pose of the rectified reference camera (number 0).
        projections: name -> P (3, 4), pixels of points of that frame: K (x + K^-1 P[:, 3]).
        pictures: name -> a picture of the camera.

    Raises:
        DataError: if a projection is none of a camera, or a picture is not readable.
    """
    cameras = []
    for name, projection in projections.items():
        rect_from_cam = transform(np.eye(3), -np.linalg.solve(projection[:, :3], projection[:, 3]))
        pose = ego_from_rect @ rect_from_cam
        cameras.append(pinhole(name, CHANNELS[name], projection[:, :3], pictures[name], pose))
    return cut_rig(tuple(cameras), EGO_VEHICLE)


def pinhole(name: str, channel: str, intrinsic: FloatArray, picture: Path, ego_from_cam: FloatArray) -> SourceCamera:
    """Return a rectified camera, as large as a picture of it.

    Raises:
        DataError: if K is none, or the picture is not readable.
    """
    try:
        lens = DistortedLens(intrinsic.copy(), np.zeros(4))
    except ShapeError as error:
        raise DataError(f"{name}: {error}") from error
    return SourceCamera(name, channel, *size_of(picture), lens, ego_from_cam)


def read_times(path: Path) -> IntArray:
    """Return the times (N,) in microseconds of a file with a line `2011-09-26 13:02:25.964389445` for each frame.

    Raises:
        DataError: if a line is no time.
    """
    times = []
    for number, line in enumerate(read_text(path, MOST_TEXT_BYTES).splitlines(), start=1):
        if not line.strip():
            continue
        found = _TIME.fullmatch(line.strip())
        try:
            moment = datetime.strptime(found[1], "%Y-%m-%d %H:%M:%S") if found else None
        except ValueError:
            moment = None
        if found is None or moment is None:
            raise DataError(
                f"{path}: line {number}: expected a time such as 2011-09-26 13:02:25.96, got '{line[:40]}'"
            )
        seconds = int(moment.replace(tzinfo=UTC).timestamp())
        times.append(seconds * 1_000_000 + int((found[2] or "").ljust(9, "0")[:6]))
    return np.array(times, np.int64)


def rising(times_us: IntArray) -> BoolArray:
    """Return which times (N,) are later than all before them."""
    latest = np.maximum.accumulate(np.concatenate([[-1], times_us]))
    return np.asarray(times_us > latest[:-1])


def size_of(path: Path) -> tuple[int, int]:
    """Return the width and height of a picture.

    Raises:
        DataError: if it is not readable.
    """
    height, width = read_image(path).shape[:2]
    return width, height


def annotation(
    instance: str, kind: str, world_from_bottom: FloatArray, size_wlh_m: tuple[float, float, float]
) -> Annotation | None:
    """Return a box given the pose of its bottom centre (x along the length, z up); None without a category."""
    category = CATEGORIES.get(kind)
    if category is None:
        return None
    return Annotation(
        instance=instance,
        category=category,
        world_from_box=world_from_bottom @ transform(np.eye(3), [0.0, 0.0, size_wlh_m[2] / 2]),
        size_wlh_m=size_wlh_m,
        attribute="cycle.with_rider" if kind in RIDDEN else "",
    )


def left_out(kinds: set[str]) -> tuple[str, ...]:
    """Return the note about types without a category."""
    unknown = sorted(kinds - set(CATEGORIES) - {"DontCare"})
    more = ", ..." if len(unknown) > _NAMED else ""
    return (
        (f"left out, without a class in nuScenes: boxes of {', '.join(unknown[:_NAMED])}{more}",) if unknown else ()
    )
