"""Files of ego poses: TUM, KITTI, CSV with a header, NMEA and GPX; the format is recognised by its content."""

from __future__ import annotations

import csv
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from appocc.checks import FloatArray, IntArray
from appocc.errors import AppoccError, DataError
from appocc.files import read_text
from appocc.geometry import nearest_rigid, quaternion_from_yaw, transform
from appocc.own_cameras.satellites import local_places, read_gpx, read_nmea
from appocc.own_cameras.times import seconds_text, seconds_to_us
from appocc.trajectory import Trajectory, headings_of_way

_TIMES = ("time", "timestamp", "t", "time_s", "timestamp_us", "timestamp_ns")
_TUM, _KITTI = 8, 12
_FLAT = "no headings were measured: they are the direction of motion, on level ground"
Table = list[tuple[int, list[str]]]


def read_trajectory(path: Path, clock: Callable[[int], IntArray]) -> Trajectory:
    """Read a file of poses.

    TUM: rows of `time x y z qx qy qz qw`. KITTI: rows of 12 numbers (3 x 4 matrix), one for each picture. CSV: a
    header with `time`, `x`, `y` (and `z`) or `lat`, `lon`, and `qx`, `qy`, `qz`, `qw` or `yaw_deg` or `yaw_rad`;
    without these, the heading is the direction of motion, as for NMEA ($..RMC) and GPX.

    Args:
        path: the file.
        clock: times of the first pictures of the recording, up to a number, for files without times.

    Raises:
        DataError: if the file is damaged, in another format, or its times do not rise.
    """
    text = read_text(path)
    if path.suffix.lower() == ".gpx" or text.lstrip().startswith("<"):
        return _of_satellites(path, *read_gpx(path, text))
    rows = [(n, line.strip()) for n, line in enumerate(text.split("\n"), start=1) if line.strip()]
    rows = [(n, line) for n, line in rows if not line.startswith("#")]
    if not rows:
        raise DataError(f"{path}: no poses")
    if any(line.startswith("$") for _, line in rows[:20]):
        return _of_satellites(path, *read_nmea(path, rows))
    if rows[0][1].lstrip('"')[:1].isalpha():
        return _read_csv(path, text)
    table = [(n, line.replace(",", " ").split()) for n, line in rows]
    width = len(table[0][1])
    if width == _TUM:
        return _read_tum(path, table)
    if width == _KITTI:
        return _read_kitti(path, table, clock)
    raise DataError(
        f"{path}: expected TUM (8 columns), KITTI (12 columns), CSV with a header, NMEA or GPX, got {width} columns"
    )


def _read_tum(path: Path, table: Table) -> Trajectory:
    numbers = _numbers(path, table, _TUM)
    times = _times(path, [(n, words[0]) for n, words in table])
    poses = _poses(path, [n for n, _ in table], numbers[:, 1:4], numbers[:, [7, 4, 5, 6]])
    return Trajectory(times, poses)


def _read_kitti(path: Path, table: Table, clock: Callable[[int], IntArray]) -> Trajectory:
    numbers = _numbers(path, table, _KITTI)
    times = clock(len(numbers))
    if len(times) < len(numbers):
        raise DataError(f"{path}: expected one pose for each of {len(times)} pictures, got {len(numbers)}")
    poses = np.tile(np.eye(4), (len(numbers), 1, 1))
    poses[:, :3] = numbers.reshape(-1, 3, 4)
    for (number, _), pose in zip(table, poses, strict=True):
        if not np.allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-2) or np.linalg.det(pose[:3, :3]) < 0:
            raise DataError(f"{path}:{number}: expected a rotation in the first 3 columns of the 3 x 4 matrix")
    return Trajectory(times, np.stack([nearest_rigid(pose) for pose in poses]))


def _read_csv(path: Path, text: str) -> Trajectory:
    lines = ["" if line.startswith("#") else line for line in text.split("\n")]
    reader = csv.reader(lines, skipinitialspace=True)
    try:
        rows = [(reader.line_num, row) for row in reader if any(row)]
    except csv.Error as error:
        raise DataError(f"{path}: no valid CSV ({error})") from error
    header = [name.strip().lower() for name in rows[0][1]]
    names = {{"latitude": "lat", "longitude": "lon"}.get(name, name): i for i, name in enumerate(header)}
    time = next((name for name in _TIMES if name in names), None)
    place = next((key for key in (("x", "y"), ("lat", "lon")) if set(key) <= set(names)), None)
    if time is None or place is None:
        raise DataError(f"{path}: expected columns time, x, y or time, lat, lon, got {', '.join(header)}")
    table = rows[1:]
    if not table:
        raise DataError(f"{path}: no poses below the header")
    wanted = [*place, *(n for n in ("z", "qw", "qx", "qy", "qz", "yaw_deg", "yaw_rad") if n in names)]
    if missing := [n for n, row in table if len(row) < len(header)]:
        raise DataError(f"{path}:{missing[0]}: expected {len(header)} columns, as in the header")
    picked = _numbers(path, [(n, [row[names[name]] for name in wanted]) for n, row in table], len(wanted))
    column = {name: picked[:, i] for i, name in enumerate(wanted)}
    times = _times(path, [(n, row[names[time]]) for n, row in table])
    if place == ("lat", "lon"):
        xy, height = local_places(path, column["lat"], column["lon"]), np.zeros(len(times))
    else:
        xy, height = np.stack([column["x"], column["y"]], axis=1), column.get("z", np.zeros(len(times)))
    note = ""
    if {"qw", "qx", "qy", "qz"} <= set(column):
        turns = np.stack([column[name] for name in ("qw", "qx", "qy", "qz")], axis=1)
    elif "yaw_deg" in column or "yaw_rad" in column:
        turns = quaternion_from_yaw(column["yaw_rad"] if "yaw_rad" in column else np.radians(column["yaw_deg"]))
    else:
        unclear = next((name for name in header if name.startswith(("yaw", "qw", "qx", "qy", "qz"))), None)
        if unclear is not None:
            raise DataError(f"{path}: expected headings as yaw_deg, yaw_rad or qw, qx, qy, qz, got '{unclear}'")
        turns, note = quaternion_from_yaw(headings_of_way(xy, str(path))), _FLAT
    return Trajectory(times, _poses(path, [n for n, _ in table], np.column_stack([xy, height]), turns), note)


def _of_satellites(
    path: Path, times: list[tuple[int, str]], latitude: FloatArray, longitude: FloatArray
) -> Trajectory:
    xy = local_places(path, latitude, longitude)
    turns = quaternion_from_yaw(headings_of_way(xy, str(path)))
    lines = [n for n, _ in times]
    return Trajectory(_times(path, times), _poses(path, lines, np.pad(xy, ((0, 0), (0, 1))), turns), _FLAT)


def _numbers(path: Path, table: Table, width: int) -> FloatArray:
    for number, words in table:
        if len(words) != width:
            raise DataError(f"{path}:{number}: expected {width} numbers, got {len(words)}")
    values = np.empty((len(table), width))
    for i, (number, words) in enumerate(table):
        try:
            values[i] = [float(word) for word in words]
        except ValueError as error:
            raise DataError(f"{path}:{number}: expected numbers ({error})") from error
        if not np.isfinite(values[i]).all():
            raise DataError(f"{path}:{number}: expected finite numbers, got {' '.join(words)}")
    return values


def _times(path: Path, words: Sequence[tuple[int, str]]) -> IntArray:
    times = np.zeros(len(words), np.int64)
    for i, (number, word) in enumerate(words):
        try:
            times[i] = seconds_to_us(word.strip())
        except ValueError as error:
            raise DataError(f"{path}:{number}: {error}") from error
        if i and times[i] <= times[i - 1]:
            before = seconds_text(int(times[i - 1]))
            raise DataError(f"{path}:{number}: times out of order: expected one after {before}, got {word}")
    return times


def _poses(path: Path, lines: Sequence[int], places: FloatArray, turns_wxyz: FloatArray) -> FloatArray:
    poses = np.empty((len(places), 4, 4))
    length = np.linalg.norm(turns_wxyz, axis=1)
    for i, number in enumerate(lines):
        if abs(length[i] - 1) > 0.05:
            raise DataError(f"{path}:{number}: expected a unit quaternion, got one of length {length[i]:.3g}")
        try:
            poses[i] = transform(turns_wxyz[i] / length[i], places[i])
        except AppoccError as error:
            raise DataError(f"{path}:{number}: {error}") from error
    return poses
