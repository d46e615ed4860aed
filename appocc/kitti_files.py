"""KITTI's text files: calibrations, poses of the GPS and IMU (oxts), and labels of the tracking benchmark.

A calibration has rows of a name and numbers. An oxts row starts with latitude and longitude in degrees, altitude in
metres, and roll, pitch and yaw in radians. Positions are in a Mercator projection at the latitude of the first row,
relative to that row, after Geiger et al., "Vision meets robotics: the KITTI dataset", IJRR 2013. The world frame has
x east, y north and z up; the IMU's has x ahead, y left and z up.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from appocc.boxes import LARGEST_M
from appocc.checks import FloatArray
from appocc.errors import DataError
from appocc.geometry import nearest_rigid, transform
from appocc.text_tables import parse_integer, parse_numbers, read_rows

# Columns of a label; the box is left, top, right, bottom in pixels, then h, w, l and the bottom centre in metres.
LABEL = (
    *("frame", "id", "type", "truncated", "occluded", "alpha"),
    *("x1", "y1", "x2", "y2", "h", "w", "l", "x", "y", "z", "ry"),
)
# Names of the transforms in the two versions of KITTI's calibration files.
RECTIFY = ("R_rect", "R0_rect")
CAM_FROM_LIDAR = ("Tr_velo_cam", "Tr_velo_to_cam")
LIDAR_FROM_IMU = ("Tr_imu_velo", "Tr_imu_to_velo")
_EARTH_M = 6378137.0
_OXTS_COLUMNS, _MAX_LATITUDE = 6, 89.0


@dataclass(frozen=True)
class CalibrationFile:
    """The rows of a calibration file.

    Attributes:
        path: path of the file.
        rows: name -> place for error messages, and the words after the name.
    """

    path: Path
    rows: Mapping[str, tuple[str, list[str]]]

    def numbers(self, names: str | tuple[str, ...], *shape: int) -> FloatArray:
        """Return the numbers of a row under the first of its names, in a shape.

        Raises:
            DataError: if there is no such row, or it has other than as many finite numbers.
        """
        names = (names,) if isinstance(names, str) else names
        name = next((name for name in names if name in self.rows), None)
        if name is None:
            raise DataError(f"{self.path}: expected a line {names[0]}, got none")
        place, words = self.rows[name]
        if len(words) != np.prod(shape):
            raise DataError(f"{place}: expected {np.prod(shape)} numbers after {name}, got {len(words)}")
        return np.array(parse_numbers(place, words)).reshape(shape)

    def pose(self, names: str | tuple[str, ...]) -> FloatArray:
        """Return the (4, 4) pose of a row of its upper 3x4, with an exact rotation.

        Raises:
            DataError: as `numbers`, or if it is no rotation.
        """
        return rigid(self.path, self.numbers(names, 3, 4))


def read_calibration(path: Path) -> CalibrationFile:
    """Read a calibration file; colons after names are optional.

    Raises:
        DataError: if it cannot be read.
    """
    return CalibrationFile(path, {columns[0].rstrip(":"): (place, columns[1:]) for place, columns in read_rows(path)})


def rigid(path: Path | str, matrix: FloatArray) -> FloatArray:
    """Return the (4, 4) rigid pose nearest to the upper (3, 4) of a rounded one.

    Raises:
        DataError: if it is farther from a rotation than by rounding.
    """
    rotation = matrix[:, :3]
    if np.abs(rotation @ rotation.T - np.eye(3)).max() > 1e-2 or np.linalg.det(rotation) < 0:
        raise DataError(f"{path}: expected a rotation, got {rotation.round(3).tolist()}")
    return nearest_rigid(np.vstack([matrix, [0, 0, 0, 1]]))


def oxts_poses(rows: Iterable[tuple[str, list[str]]]) -> FloatArray:
    """Return world_from_imu (N, 4, 4) of oxts rows, each with its place for error messages.

    Raises:
        DataError: if a row is too short or has no numbers, or a latitude is not on the map.
    """
    poses: list[FloatArray] = []
    scale, origin_m = 1.0, np.zeros(3)
    for place, columns in rows:
        if len(columns) < _OXTS_COLUMNS:
            raise DataError(f"{place}: expected at least {_OXTS_COLUMNS} columns, got {len(columns)}")
        latitude, longitude, altitude_m, roll, pitch, yaw = parse_numbers(place, columns[:_OXTS_COLUMNS])
        if abs(latitude) > _MAX_LATITUDE:
            raise DataError(f"{place}: expected a latitude of up to {_MAX_LATITUDE:g} degrees, got {latitude:g}")
        if not poses:
            scale = float(np.cos(np.radians(latitude)))
        east_m = scale * _EARTH_M * np.radians(longitude)
        north_m = scale * _EARTH_M * np.log(np.tan(np.radians(90 + latitude) / 2))
        position_m = np.array([east_m, north_m, altitude_m])
        if not poses:
            origin_m = position_m
        poses.append(transform(_rotation(roll, pitch, yaw), position_m - origin_m))
    return np.array(poses).reshape(-1, 4, 4)


def _rotation(roll_rad: float, pitch_rad: float, yaw_rad: float) -> FloatArray:
    """Return the rotation (3, 3) by roll about x, then pitch about y, then yaw about z."""
    (cr, cp, cy), (sr, sp, sy) = ([f(angle) for angle in (roll_rad, pitch_rad, yaw_rad)] for f in (np.cos, np.sin))
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    return np.asarray(about_z @ about_y @ about_x)


def read_labels(path: Path) -> Iterator[tuple[int, str, list[float]]]:
    """Yield the frame, the type and the other numbers of each row of a label file: the columns `LABEL` without type.

    Raises:
        DataError: if a row is damaged, or an object has two in a frame.
    """
    taken: set[tuple[int, int]] = set()
    for place, columns in read_rows(path):
        name = check_columns(place, columns, LABEL).pop(2)
        row = parse_numbers(place, columns)
        frame = parse_integer(place, "frame", row[0], 0)
        if name != "DontCare":
            key = frame, parse_integer(place, "id", row[1], 0)
            if key in taken:
                raise DataError(f"{place}: expected one label of object {key[1]} in frame {frame}, got two")
            taken.add(key)
            for state, number in zip(("truncated", "occluded"), row[2:4], strict=True):
                parse_integer(place, state, number, -1)
            check_size(place, row[9:12])
        yield frame, name, row


def check_columns(place: str, columns: list[str], names: Sequence[str]) -> list[str]:
    """Return the columns of a row.

    Raises:
        DataError: if there are other than as many as names.
    """
    if len(columns) != len(names):
        raise DataError(f"{place}: expected {len(names)} columns ({' '.join(names)}), got {len(columns)}")
    return columns


def check_size(place: str, h_w_l: Sequence[float]) -> None:
    """Check height, width and length in metres.

    Raises:
        DataError: if one is not positive, or larger than any object.
    """
    if min(h_w_l) <= 0:
        raise DataError(f"{place}: expected positive h, w and l, got {min(h_w_l):g} m")
    if max(h_w_l) > LARGEST_M:
        raise DataError(f"{place}: expected h, w and l up to {LARGEST_M:g} m, got {max(h_w_l):g} m")
