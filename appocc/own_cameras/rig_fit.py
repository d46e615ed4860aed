"""Fit a rig: lenses from checkerboards, poses from points on the ground; written as a rig file."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml
from scipy.spatial.transform import Rotation

from appocc.errors import DataError, NotFoundError
from appocc.files import write_bytes
from appocc.own_cameras.checkerboard import Intrinsics, fit_intrinsics
from appocc.own_cameras.ground_points import Mounting, fit_mounting, read_points
from appocc.own_cameras.pictures import IMAGES
from appocc.rigs.poses import BODY_FROM_OPTICAL


@dataclass(frozen=True)
class FittedCamera:
    """A fitted camera.

    Attributes:
        intrinsics: its lens.
        mounting: its pose.
    """

    intrinsics: Intrinsics
    mounting: Mounting

    def as_yaml(self) -> dict[str, Any]:
        """Return the keys of the camera in a rig file."""
        lens, pose = self.intrinsics, self.mounting.ego_from_cam
        turn = Rotation.from_matrix(pose[:3, :3] @ BODY_FROM_OPTICAL.T)
        yaw, pitch, roll = (round(float(angle), 4) for angle in turn.as_euler("ZYX", degrees=True))
        values = [round(value, 6) for value in lens.coefficients]
        return {
            "size_px": list(lens.size_px),
            "intrinsic": [[round(float(value), 4) for value in row] for row in lens.intrinsic],
            **({"fisheye": {"coefficients": values}} if lens.fisheye else {"distortion": values}),
            "position_m": [round(float(value), 4) for value in pose[:3, 3]],
            "yaw_deg": yaw,
            "pitch_deg": pitch,
            "roll_deg": roll,
        }

    def as_json(self) -> dict[str, Any]:
        """Return the errors and counts as JSON values."""
        lens, pose = self.intrinsics, self.mounting
        boards = {"boards": lens.boards, "pictures": lens.pictures, "board_error_px": lens.error_px}
        return {
            **boards,
            "point_error_px": pose.error_px,
            "worst_point_px": pose.worst_px,
            "worst_line": pose.worst_line,
        }


def board_pictures(source: Path) -> dict[str, list[Path]]:
    """Return the pictures of checkerboards in the sub-folders of a folder, by camera.

    Raises:
        DataError: if there are none.
    """
    if not source.is_dir():
        raise DataError(f"{source}: no such folder")
    folders = {path.name: sorted(path.iterdir()) for path in sorted(source.iterdir()) if path.is_dir()}
    found = {name: [path for path in paths if path.suffix.lower() in IMAGES] for name, paths in folders.items()}
    found = {name: paths for name, paths in found.items() if paths}
    if not found:
        raise DataError(f"{source}: expected a folder of pictures of the checkerboard for each camera, got none")
    return found


def fit_rig(
    boards: Mapping[str, list[Path]],
    corners: tuple[int, int],
    points: Path,
    fisheyes: Collection[str],
    advance: Callable[[int], None] = lambda count: None,
) -> dict[str, FittedCamera]:
    """Fit all cameras, by name.

    Args:
        boards: pictures of the checkerboard by camera.
        corners: inner corners of the board, across and down.
        points: file of points, see `read_points`.
        fisheyes: cameras with a fisheye.
        advance: progress callback, for each picture.

    Raises:
        NotFoundError: if there is no camera of a name in `fisheyes` or in the file of points.
        DataError: if a camera has no points, or does not fit.
    """
    marked = read_points(points)
    for where, names in (("--fisheye", fisheyes), (str(points), marked)):
        for name in names:
            if name not in boards:
                raise NotFoundError(f"{where}: no pictures of camera '{name}'; there are {', '.join(boards)}")
    if lacking := [name for name in boards if name not in marked]:
        raise DataError(f"{points}: expected points of {lacking[0]}, got none")
    fitted = {}
    for name, paths in boards.items():
        intrinsics = fit_intrinsics(paths, corners, name in fisheyes, advance)
        fitted[name] = FittedCamera(intrinsics, fit_mounting(name, intrinsics.lens, marked[name]))
    return fitted


def write_rig(path: Path, cameras: Mapping[str, FittedCamera]) -> None:
    """Write a rig file.

    Raises:
        DataError: if it cannot be written.
    """
    values = {"cameras": {name: camera.as_yaml() for name, camera in cameras.items()}}
    head = "# Ego frame: x forward, y left, z up, origin on the ground below the middle of the rear axle.\n"
    text = yaml.safe_dump(values, sort_keys=False, default_flow_style=None, width=120)
    write_bytes(path, (head + text).encode())
