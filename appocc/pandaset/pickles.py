"""Reader of published PandaSet sequences: JSON poses and pickled pandas DataFrames.

Reading a pickle runs code, so this reader is used only for files that the user trusts. Peculiarities of the format,
converted here: the yaw of a cuboid is the heading of its WIDTH axis (length axis = yaw + 90 degrees), dimensions.x is
the width and .y the length; points are in the WORLD frame and from both LiDARs (d = 0 is the spinning LiDAR).
"""

from __future__ import annotations

import importlib
import io
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from appocc.checks import FloatArray
from appocc.errors import AppoccError, DataError
from appocc.files import read_file, read_json
from appocc.geometry import apply, inverse, transform
from appocc.pandaset.recording import CHANNELS, Cuboid, PandaFrame, PandaImage, PandaSweep, Recording

# PandaSet's LiDAR pose has x to the right and y forward; its ego here has x forward and y left.
_LIDAR_FROM_EGO = np.array([[0.0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])


def read_pickles(sequence: Path, lidar: Path | None) -> Recording:
    """Read a published sequence folder (camera/, lidar/, annotations/).

    `lidar` is a folder with NN.pkl.gz files that replaces the lidar/ folder of the sequence. Frames without images on
    disk are skipped.

    Raises:
        DataError: if pandas is not installed, or a file is missing or damaged.
    """
    folder = lidar / "orig" if lidar and (lidar / "orig").is_dir() else lidar or sequence / "lidar"
    try:
        times = read_json(sequence / "lidar" / "timestamps.json")
        poses = [_pose(row) @ _LIDAR_FROM_EGO for row in read_json(sequence / "lidar" / "poses.json")]
        cameras = {channel: _camera(sequence / "camera" / name) for name, channel in CHANNELS.items()}
        frames = []
        for i, (time, pose) in enumerate(zip(times, poses, strict=True)):
            images = {channel: rows[i] for channel, (_, rows) in cameras.items() if rows[i].path.is_file()}
            if images:
                frames.append(_read_frame(sequence, folder, i, float(time), pose, images))
        names = read_json(sequence / "annotations" / "semseg" / "classes.json")
        return Recording(
            sequence.name,
            tuple(frames),
            {channel: intrinsic for channel, (intrinsic, _) in cameras.items()},
            {int(index): str(name) for index, name in names.items()},
            None,
            f"PandaSet sequence {sequence.name}",
        )
    except AppoccError as error:
        raise DataError(f"{sequence}: {error}") from error
    except (KeyError, TypeError, IndexError, ValueError, OverflowError, AttributeError) as error:
        raise DataError(f"{sequence}: not a published PandaSet sequence ({error!r})") from error


def _pose(row: dict[str, dict[str, float]]) -> FloatArray:
    """Return the 4x4 pose of an entry {position, heading}."""
    p, q = row["position"], row["heading"]
    return transform([q["w"], q["x"], q["y"], q["z"]], [p["x"], p["y"], p["z"]])


def _camera(folder: Path) -> tuple[FloatArray, list[PandaImage]]:
    """Return the intrinsic matrix and all images of a camera folder."""
    k = read_json(folder / "intrinsics.json")
    intrinsic = np.array([[k["fx"], 0, k["cx"]], [0, k["fy"], k["cy"]], [0, 0, 1]], dtype=np.float64)
    times, poses = read_json(folder / "timestamps.json"), read_json(folder / "poses.json")
    rows = zip(times, poses, strict=True)
    return intrinsic, [PandaImage(folder / f"{i:02d}.jpg", float(t), _pose(row)) for i, (t, row) in enumerate(rows)]


def _read_frame(
    sequence: Path, lidar: Path, i: int, time_s: float, world_from_ego: FloatArray, images: dict[str, PandaImage]
) -> PandaFrame:
    """Read frame i."""
    points = lidar / f"{i:02d}.pkl.gz"
    labels = sequence / "annotations" / "semseg" / f"{i:02d}.pkl.gz"
    cuboids = _unpickled(sequence / "annotations" / "cuboids" / f"{i:02d}.pkl.gz")
    return PandaFrame(
        i,
        time_s,
        world_from_ego,
        images,
        tuple(_cuboid(row) for row in cuboids.to_dict("records")),
        partial(_sweep, points, labels, world_from_ego) if points.is_file() else None,
    )


def _cuboid(row: dict[str, Any]) -> Cuboid:
    """Convert one row of a cuboid table."""
    motion, sibling = row.get("attributes.object_motion"), row.get("cuboids.sibling_id")
    return Cuboid(
        track=str(row["uuid"]),
        label=str(row["label"]),
        centre_world_m=np.array([row[f"position.{axis}"] for axis in "xyz"], dtype=np.float64),
        size_lwh_m=np.array([row[f"dimensions.{axis}"] for axis in "yxz"], dtype=np.float64),
        yaw_world_rad=float(row["yaw"]) + np.pi / 2,
        motion=motion if isinstance(motion, str) else None,
        sensor=int(row["cuboids.sensor_id"]),
        sibling=sibling if isinstance(sibling, str) and sibling != "-" else None,
    )


def _sweep(points: Path, labels: Path, world_from_ego: FloatArray) -> PandaSweep:
    """Read the rows of the spinning LiDAR from a point table, transformed from the world frame to the ego frame.

    Raises:
        DataError: if a table is missing or damaged, or the number of labels is wrong.
    """
    table = _unpickled(points)
    found = _unpickled(labels) if labels.is_file() else None
    try:
        spinning = table["d"].to_numpy() == 0
        xyz = table[["x", "y", "z"]].to_numpy(dtype=np.float64)[spinning]
        intensity = table["i"].to_numpy()[spinning].astype(np.uint8)
        classes = None if found is None else found["class"].to_numpy()
    except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
        raise DataError(f"{points}: not a PandaSet point table, or its labels are none ({error!r})") from error
    if classes is not None and len(classes) != len(spinning):
        raise DataError(f"{labels}: expected {len(spinning)} labels, one per point, got {len(classes)}")
    labels_of_points = None if classes is None else classes[spinning].astype(np.uint8)
    return PandaSweep(apply(inverse(world_from_ego), xyz), intensity, labels_of_points)


def _unpickled(path: Path) -> Any:
    """Read a pickled DataFrame.

    Raises:
        DataError: if pandas is missing, or the file is missing or damaged.
    """
    try:
        pandas = importlib.import_module("pandas")
    except ImportError as error:
        raise DataError("reading pickles needs pandas: pip install '.[pandaset]'") from error
    packed = read_file(path)
    try:
        return pandas.read_pickle(io.BytesIO(packed), compression="gzip")
    except Exception as error:  # a damaged pickle can raise anything
        raise DataError(f"{path}: cannot be unpickled ({type(error).__name__}: {error})") from error
