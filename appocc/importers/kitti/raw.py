"""KITTI's raw recordings: `DATE/DATE_drive_NNNN_sync` with calibrations beside it."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from appocc.checks import FloatArray, IntArray
from appocc.errors import DataError
from appocc.files import MOST_TEXT_BYTES, read_text
from appocc.geometry import inverse, transform
from appocc.importers.kitti.geometry import (
    CHANNELS,
    EGO_FROM_IMU,
    annotation,
    left_out,
    pinhole_rig,
    read_times,
    rising,
)
from appocc.importers.kitti.log import Recording
from appocc.kitti_files import check_size, oxts_poses, read_calibration, rigid
from appocc.nuscenes.writer import Annotation
from appocc.text_tables import read_rows
from appocc.trajectory import Trajectory
from appocc.xml_file import parse_xml

# A frame has an oxts row within 10 ms, but for the first and last ones.
_NEAR_US = 100_000
_SIZE, _PLACE = ("h", "w", "l"), ("tx", "ty", "tz", "rz")


class Tracklet(NamedTuple):
    """An object over time: its box in the Velodyne's frame, from its first frame on.

    Attributes:
        instance: name.
        kind: type of KITTI.
        first: number of the first frame.
        size_wlh_m: width, length, height.
        places: (M, 4) bottom centre x, y, z and heading about z in each frame.
    """

    instance: str
    kind: str
    first: int
    size_wlh_m: tuple[float, float, float]
    places: FloatArray


def read_raw(folder: Path) -> Recording:
    """Read a drive.

    Raises:
        DataError: if a file is missing or damaged.
    """
    calibration = folder.parent
    cams = read_calibration(calibration / "calib_cam_to_cam.txt")
    cam_from_velo = _pose(calibration / "calib_velo_to_cam.txt")
    velo_from_imu = _pose(calibration / "calib_imu_to_velo.txt")
    ego_from_velo = EGO_FROM_IMU @ inverse(velo_from_imu)
    rect_from_cam = transform(cams.numbers("R_rect_00", 3, 3), [0, 0, 0])
    ego_from_rect = ego_from_velo @ inverse(rect_from_cam @ cam_from_velo)
    pictures = {name: path for name in CHANNELS if (path := next(_files(folder, name, "png"), None)) is not None}
    if not pictures:
        raise DataError(f"{folder}: expected pictures image_02/data/*.png, got none")
    projections = {name: cams.numbers(f"P_rect_{name[-2:]}", 3, 4) for name in pictures}
    times = read_times(folder / next(iter(pictures)) / "timestamps.txt")
    numbers, times, poses = _frames(folder, times)
    has_sweeps = next(_files(folder, "velodyne_points", "bin"), None) is not None
    path = folder / "tracklet_labels.xml"
    tracklets = read_tracklets(path) if path.is_file() else ()
    notes = left_out({each.kind for each in tracklets}) if path.is_file() else ("no tracklet_labels.xml: no boxes",)
    return Recording(
        numbers=numbers,
        times_us=times,
        world_from_ego=poses,
        rig=pinhole_rig(ego_from_rect, projections, pictures),
        ego_from_velo=ego_from_velo if has_sweeps else None,
        picture=partial(_picture, folder),
        sweep=partial(_sweep, folder),
        boxes=partial(_boxes, tracklets, ego_from_velo),
        notes=notes,
    )


def read_tracklets(path: Path) -> tuple[Tracklet, ...]:
    """Read `tracklet_labels.xml`: h, w, l, and for each frame from first_frame on tx, ty, tz and rz.

    Raises:
        DataError: if it is no such file, or a number is missing or not plausible.
    """
    root = parse_xml(path, read_text(path, MOST_TEXT_BYTES))
    tracklets = []
    for number, item in enumerate(root.findall("./tracklets/item")):
        place = f"{path}: tracklet {number}"
        try:
            height, width, length = (float(item.findtext(name, "")) for name in _SIZE)
            first = int(item.findtext("first_frame", ""))
            rows = [[float(pose.findtext(name, "")) for name in _PLACE] for pose in item.findall("./poses/item")]
        except ValueError as error:
            raise DataError(
                f"{place}: expected h, w, l, first_frame, and poses of tx, ty, tz, rz ({error})"
            ) from error
        check_size(place, (height, width, length))
        places = np.array(rows).reshape(-1, 4)
        if not np.isfinite(places).all():
            raise DataError(f"{place}: expected finite poses, got some that are not")
        kind = item.findtext("objectType", "").strip()
        tracklets.append(Tracklet(str(number), kind, first, (width, length, height), places))
    if root.find("./tracklets") is None:
        raise DataError(f"{path}: expected KITTI's tracklets, got <{root.tag}>")
    return tuple(tracklets)


def _frames(folder: Path, times: IntArray) -> tuple[IntArray, IntArray, FloatArray]:
    """Return the numbers (N,), times (N,) and ego poses (N, 4, 4) of the frames with a pose, given all times."""
    paths = sorted(_files(folder, "oxts", "txt"))
    if not paths:
        raise DataError(f"{folder}: expected poses oxts/data/*.txt, got none")
    clock = read_times(folder / "oxts" / "timestamps.txt")
    measured = np.array([int(path.stem) for path in paths])
    if measured[-1] >= len(clock):
        raise DataError(f"{folder / 'oxts' / 'timestamps.txt'}: expected {measured[-1] + 1} times, got {len(clock)}")
    poses = oxts_poses(row for path in paths for row in list(read_rows(path))[:1]) @ inverse(EGO_FROM_IMU)
    if len(poses) < len(paths):
        raise DataError(f"{folder / 'oxts' / 'data'}: expected a row in each file, got {len(poses)} in {len(paths)}")
    kept = rising(clock[measured])
    trajectory = Trajectory(clock[measured][kept], poses[kept])
    begin, end = trajectory.times_us[[0, -1]].tolist()
    numbers = np.flatnonzero(rising(times) & (times > begin - _NEAR_US) & (times < end + _NEAR_US))
    found = [trajectory.at(int(np.clip(time, begin, end))) for time in times[numbers]]
    known = [index for index, pose in enumerate(found) if pose is not None]
    if not known:
        raise DataError(f"{folder}: expected poses at the times of the pictures, got none within 0.1 s")
    return numbers[known], times[numbers[known]], np.array([found[index] for index in known])


def _boxes(
    tracklets: tuple[Tracklet, ...], ego_from_velo: FloatArray, number: int, world_from_ego: FloatArray
) -> tuple[Annotation, ...]:
    found = []
    for each in tracklets:
        if 0 <= number - each.first < len(each.places):
            x, y, z, yaw = each.places[number - each.first]
            turn = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
            pose = world_from_ego @ ego_from_velo @ transform(turn, [x, y, z])
            found.append(annotation(each.instance, each.kind, pose, each.size_wlh_m))
    return tuple(box for box in found if box is not None)


def _pose(path: Path) -> FloatArray:
    """Return the (4, 4) pose of the rows R and T of a file."""
    rows = read_calibration(path)
    return rigid(path, np.column_stack([rows.numbers("R", 3, 3), rows.numbers("T", 3)]))


def _files(folder: Path, sensor: str, ending: str) -> Iterator[Path]:
    return (path for path in (folder / sensor / "data").glob(f"*.{ending}") if path.stem.isdecimal())


def _picture(folder: Path, name: str, number: int) -> Path:
    return folder / name / "data" / f"{number:010d}.png"


def _sweep(folder: Path, number: int) -> Path:
    return folder / "velodyne_points" / "data" / f"{number:010d}.bin"
