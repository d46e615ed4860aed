"""Poses of cameras from points on the ground whose places in the ego frame were measured."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from appocc.checks import FloatArray
from appocc.errors import DataError
from appocc.files import read_text
from appocc.geometry import apply, inverse, transform
from appocc.lenses import Lens
from appocc.rigs.mounting import mounting_fault

_FEWEST = 4
_COLUMNS = ("camera", "u", "v", "x", "y")


@dataclass(frozen=True, eq=False)
class MarkedPoints:
    """Points that a camera sees.

    Attributes:
        uv_px: (N, 2) pixels, centres at whole numbers.
        ego_m: (N, 3) places in the ego frame.
        lines: lines of the file, for messages.
    """

    uv_px: FloatArray
    ego_m: FloatArray
    lines: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Mounting:
    """Pose of a camera, fitted to points.

    Attributes:
        ego_from_cam: (4, 4) pose.
        error_px: root mean square of the distances between points and pixels.
        worst_px: largest distance.
        worst_line: line of that point in the file.
    """

    ego_from_cam: FloatArray
    error_px: float
    worst_px: float
    worst_line: int


def read_points(path: Path) -> dict[str, MarkedPoints]:
    """Read a CSV file with the columns camera, u, v, x, y and, if not all are on the ground, z; points by camera.

    Raises:
        DataError: if a column is missing or a value is no finite number.
    """
    try:
        reader = csv.reader(read_text(path).split("\n"), skipinitialspace=True)
        rows = [(reader.line_num, [word.strip() for word in row]) for row in reader if any(row)]
    except csv.Error as error:
        raise DataError(f"{path}: no valid CSV ({error})") from error
    header = [name.lower() for name in rows[0][1]] if rows else []
    if not set(_COLUMNS) <= set(header):
        raise DataError(f"{path}: expected columns {', '.join(_COLUMNS)} (and z), got {', '.join(header) or 'none'}")
    names = [*_COLUMNS[1:], *(["z"] if "z" in header else [])]
    found: dict[str, list[tuple[int, list[float]]]] = {}
    for line, row in rows[1:]:
        try:
            values = [float(row[header.index(name)]) for name in names]
            camera = row[header.index("camera")]
        except (ValueError, IndexError) as error:
            raise DataError(f"{path}:{line}: expected a camera and numbers ({error})") from error
        if not np.isfinite(values).all():
            raise DataError(f"{path}:{line}: expected finite numbers")
        found.setdefault(camera, []).append((line, values))
    return {camera: _marked(points) for camera, points in found.items()}


def _marked(points: list[tuple[int, list[float]]]) -> MarkedPoints:
    values = np.array([row for _, row in points])
    places = values[:, 2:] if values.shape[1] == 5 else np.pad(values[:, 2:], ((0, 0), (0, 1)))
    return MarkedPoints(values[:, :2], places, tuple(line for line, _ in points))


def fit_mounting(name: str, lens: Lens, points: MarkedPoints) -> Mounting:
    """Fit the pose of a camera: `cv2.solvePnP` on rays, then robust least squares of the errors in pixels.

    Raises:
        DataError: if there are too few points, they are in a line or not seen by the lens, or no pose fits.
    """
    if len(points.lines) < _FEWEST:
        raise DataError(f"{name}: expected at least {_FEWEST} points, got {len(points.lines)}")
    spread = np.linalg.svd(points.ego_m - points.ego_m.mean(axis=0), compute_uv=False)
    if spread[1] < 0.05 * spread[0]:
        raise DataError(f"{name}: the points are in a line: expected some to the sides of it")
    rays = lens.unproject(points.uv_px)
    blind = ~(rays[:, 2] > 0.05)
    if blind.any():
        line = points.lines[int(np.flatnonzero(blind)[0])]
        raise DataError(f"{name}: the pixel of line {line} is outside of the lens's picture")
    flat = rays[:, :2] / rays[:, 2:]
    try:
        done, turn, shift = cv2.solvePnP(points.ego_m, flat, np.eye(3), None, flags=cv2.SOLVEPNP_SQPNP)
    except cv2.error as error:
        raise DataError(f"{name}: no pose fits the points") from error
    start = np.concatenate([np.ravel(turn), np.ravel(shift)])

    def errors(numbers: FloatArray) -> FloatArray:
        pixels = lens.project(apply(_pose(numbers), points.ego_m))
        return np.nan_to_num(pixels - points.uv_px, nan=1e4).ravel()

    # A wrong point must stand out, and not bend the pose to itself.
    usable = done and np.isfinite(start).all()
    fitted = least_squares(errors, start, loss="soft_l1", x_scale="jac") if usable else None
    ego_from_cam = np.eye(4) if fitted is None else inverse(_pose(fitted.x))
    if fitted is None or ego_from_cam[2, 3] <= 0:
        raise DataError(
            f"{name}: no pose above the ground fits the points; are u, v and x, y of the same points, x ahead and y "
            "to the left?"
        )
    if fault := mounting_fault(ego_from_cam, upright=False):
        raise DataError(f"{name}: expected {fault[0]}, got {fault[1]} from the points; are x and y in metres?")
    distance = np.linalg.norm(errors(fitted.x).reshape(-1, 2), axis=1)
    worst = int(distance.argmax())
    error_px = float(np.sqrt((distance**2).mean()))
    return Mounting(ego_from_cam, error_px, float(distance[worst]), points.lines[worst])


def _pose(numbers: FloatArray) -> FloatArray:
    return transform(Rotation.from_rotvec(numbers[:3]).as_matrix(), numbers[3:])
