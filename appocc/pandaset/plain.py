"""Reader of plain copies of PandaSet sequences: frames.json, images, npz sweeps; no pickles."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from appocc.checks import FloatArray, check_finite, check_numbers, check_transform
from appocc.errors import AppoccError, DataError
from appocc.files import inside, read_file, read_json, zip_arrays
from appocc.geometry import nearest_rigid
from appocc.pandaset.recording import CHANNELS, Cuboid, PandaFrame, PandaImage, PandaSweep, Recording, RoadRaster


def read_plain(source: Path, lidar: Path | None) -> Recording:
    """Read a folder with a frames.json; `lidar` is the folder with npz/NN.npz, None: without LiDAR.

    Raises:
        DataError: if a file is missing, damaged or invalid.
    """
    path = source / "frames.json"
    data, labels, road = read_json(path), _label_names(source), _road(source)
    try:
        rows = data["frames"]
        intrinsics = {CHANNELS[name]: np.array(k, dtype=np.float64) for name, k in data["intrinsics"].items()}
        frames = tuple(_frame(source, row, lidar) for row in rows if row["has_images"])
        name = PurePosixPath(next(iter(rows[0]["cameras"].values()))["file"]).parts[0]
        return Recording(name, frames, intrinsics, labels, road, str(data.get("source", "")))
    except AppoccError as error:
        raise DataError(f"{path}: {error}") from error
    except (KeyError, TypeError, IndexError, ValueError, OverflowError, AttributeError, StopIteration) as error:
        raise DataError(f"{path}: not a plain copy of a PandaSet sequence ({error!r})") from error


def _frame(source: Path, frame: dict[str, Any], lidar: Path | None) -> PandaFrame:
    """Convert one entry of `frames`."""
    images = {
        CHANNELS[name]: PandaImage(inside(source, camera["file"]), float(camera["t"]), _pose(camera, "T_world_cam"))
        for name, camera in frame["cameras"].items()
    }
    return PandaFrame(
        int(frame["i"]),
        float(frame["t_lidar"]),
        _pose(frame, "T_world_ego"),
        images,
        tuple(_cuboid(box) for box in frame["boxes"]),
        _sweep_of(frame, lidar),
    )


def _sweep_of(frame: dict[str, Any], lidar: Path | None) -> Callable[[], PandaSweep] | None:
    """Return the reader of the sweep of a frame; its `lidar_npz` may name another folder but no other file."""
    stated, name = frame["lidar_npz"], f"{int(frame['i']):02d}.npz"
    if stated is not None and PurePosixPath(stated).name != name:
        raise DataError(f"frame {frame['i']}: lidar_npz: expected a path to {name}, got {str(stated)[:80]!r}")
    return None if stated is None or lidar is None else partial(_sweep, lidar / "npz" / name)


def _pose(row: dict[str, Any], name: str) -> FloatArray:
    """Return the 4x4 pose of a field, corrected for rounding to the nearest rigid transform."""
    pose = np.array(row[name], dtype=np.float64)
    check_transform(name, pose)
    return nearest_rigid(pose)


def _cuboid(box: dict[str, Any]) -> Cuboid:
    """Convert one entry of `boxes`, whose yaw is the heading of the length axis."""
    return Cuboid(
        track=str(box["track"]),
        label=str(box["class"]),
        centre_world_m=np.array(box["centre_world"], dtype=np.float64),
        size_lwh_m=np.array(box["size_lwh"], dtype=np.float64),
        yaw_world_rad=float(box["yaw_world"]),
        motion=None if box["motion"] is None else str(box["motion"]),
        sensor=int(box["sensor_id"]),
        sibling=None if box["sibling"] is None else str(box["sibling"]),
    )


def _sweep(path: Path) -> PandaSweep:
    """Read the points of one npz file, centimetres in the ego frame."""
    packed = read_file(path)
    try:
        with zip_arrays(packed) as data:
            check_numbers("points", data["xyz_cm_ego"])
            return PandaSweep(data["xyz_cm_ego"].astype(np.float64) / 100, data["intensity"], data["semseg"])
    except Exception as error:  # damage surfaces as nearly any error of zipfile, zlib and numpy
        raise DataError(f"{path}: damaged sweep ({error})") from error


def _label_names(source: Path) -> dict[int, str]:
    """Return the names of the point labels from the first classes.json below the folder."""
    path = next(iter(sorted(source.glob("*/annotations/semseg/classes.json"))), None)
    if path is None:
        return {}
    names = read_json(path)
    try:
        return {int(index): str(name) for index, name in names.items()}
    except (ValueError, AttributeError) as error:
        raise DataError(f"{path}: expected names of labels by number ({error!r})") from error


def _road(source: Path) -> RoadRaster | None:
    """Read the road raster next to frames.json; None if there is none."""
    path = source / "road_world.npz"
    if not path.is_file():
        return None
    packed = read_file(path)
    try:
        with zip_arrays(packed) as data:
            check_numbers("label", data["label"])
            check_finite("label", data["label"])
            origin = (float(data["x0"]), float(data["y0"]))
            return RoadRaster(data["label"].astype(np.uint8), origin, float(data["resolution"]))
    except Exception as error:  # as above
        raise DataError(f"{path}: damaged road raster ({error})") from error
