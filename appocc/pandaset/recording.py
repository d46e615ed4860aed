"""PandaSet sequence in memory, from either reader (plain copy, published pickles).

Coordinate frames: `world` is PandaSet's; `ego` is x forward, y left, z up at the height of PandaSet's LiDAR pose,
0.40 m above the road (the converter lowers it to the road, as in nuScenes).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from appocc.checks import (
    ByteArray,
    FloatArray,
    check_dtype,
    check_finite,
    check_intrinsic,
    check_place,
    check_shape,
    check_transform,
)
from appocc.errors import DataError, ShapeError
from appocc.pandaset.classes import category_of

# nuScenes-style channel of each PandaSet camera folder.
CHANNELS = {
    "front_camera": "CAM_FRONT",
    "front_left_camera": "CAM_FRONT_LEFT",
    "front_right_camera": "CAM_FRONT_RIGHT",
    "left_camera": "CAM_LEFT",
    "right_camera": "CAM_RIGHT",
    "back_camera": "CAM_BACK",
}
# The shortest start of a token that can name it: the first group of its digits.
_LEAST_PREFIX = 8


def _check_time(name: str, time_s: float) -> None:
    """Check seconds since 1970, up to the year 5138, so that microseconds are exact."""
    if not 0 <= time_s < 1e11:
        raise ShapeError(f"{name}: expected seconds since 1970, got {time_s:g}")


@dataclass(frozen=True, eq=False)
class PandaImage:
    """An image file with time and pose; PandaSet's images are rectified, without distortion."""

    path: Path
    time_s: float
    world_from_cam: FloatArray

    def __post_init__(self) -> None:
        """Check time and pose.

        Raises:
            ShapeError: if time or pose is invalid.
        """
        _check_time(f"{self.path.name} time", self.time_s)
        check_transform(f"{self.path.name} world_from_cam", self.world_from_cam)


@dataclass(frozen=True, kw_only=True, eq=False)
class Cuboid:
    """An annotated box; yaw is the heading of its LENGTH axis, size is (length, width, height)."""

    track: str
    label: str
    centre_world_m: FloatArray
    size_lwh_m: FloatArray
    yaw_world_rad: float
    motion: str | None
    sensor: int
    sibling: str | None

    def __post_init__(self) -> None:
        """Check shapes and values.

        Raises:
            ShapeError: if a value is not finite, or a size is not positive.
            DataError: if PandaSet has no such class.
        """
        check_shape(f"cuboid {self.track} centre", self.centre_world_m, (3,))
        check_shape(f"cuboid {self.track} size", self.size_lwh_m, (3,))
        category_of(self.label)
        check_place(f"cuboid {self.track} centre", self.centre_world_m)
        check_place(f"cuboid {self.track} size", self.size_lwh_m)
        check_finite(f"cuboid {self.track} yaw", np.array(self.yaw_world_rad))
        if self.size_lwh_m.min() <= 0:
            raise ShapeError(f"cuboid {self.track} size: expected positive sizes, got {self.size_lwh_m.tolist()}")


@dataclass(frozen=True, eq=False)
class PandaSweep:
    """Points of the spinning LiDAR: (N, 3) metres in the ego frame, (N,) intensity 0..255, (N,) class labels."""

    points_ego_m: FloatArray
    intensity: ByteArray
    labels: ByteArray | None

    def __post_init__(self) -> None:
        """Check that there are points, with an intensity and, if there are labels, a label each.

        Raises:
            ShapeError: if not.
        """
        check_shape("points", self.points_ego_m, (None, 3))
        check_place("points", self.points_ego_m)
        if not len(self.points_ego_m):
            raise ShapeError("points: expected some, got none")
        for name, values in (("intensity", self.intensity), ("labels", self.labels)):
            if values is not None:
                check_shape(name, values, (len(self.points_ego_m),))
                check_dtype(name, values, np.uint8)


@dataclass(frozen=True, eq=False)
class PandaFrame:
    """One frame of a sequence: images by channel, boxes, and a function that reads its sweep (None: no LiDAR)."""

    index: int
    time_s: float
    world_from_ego: FloatArray
    images: dict[str, PandaImage]
    cuboids: tuple[Cuboid, ...]
    read_sweep: Callable[[], PandaSweep] | None

    def __post_init__(self) -> None:
        """Check time and pose.

        Raises:
            ShapeError: if time or pose is invalid.
        """
        _check_time(f"frame {self.index} time", self.time_s)
        check_transform(f"frame {self.index} world_from_ego", self.world_from_ego)


@dataclass(frozen=True, eq=False)
class RoadRaster:
    """Raster of ground classes: label (rows along +y, columns along +x), lower left corner, cell size."""

    label: ByteArray
    origin_m: tuple[float, float]
    cell_m: float

    def __post_init__(self) -> None:
        """Check that the raster can be converted to a mask of 10 px per metre.

        Raises:
            ShapeError: if it has no cells, an invalid origin, or a cell size that is not a multiple of 0.1 m.
        """
        check_shape("label", self.label, (None, None))
        if not self.label.size:
            raise ShapeError(f"label: expected some cells, got {self.label.shape}")
        check_place("origin", np.array(self.origin_m))
        check_place("resolution", np.array(self.cell_m))
        if not 1 <= self.scale <= 100 or abs(self.scale * 0.1 - self.cell_m) > 1e-6:
            raise ShapeError(f"resolution: expected a multiple of 0.1 m up to 10 m, got {self.cell_m} m")

    @property
    def scale(self) -> int:
        """Number of mask pixels (0.1 m) along the side of a cell."""
        return round(self.cell_m / 0.1)


@dataclass(frozen=True, eq=False)
class Recording:
    """A sequence: frames in order of time, intrinsics by channel, label names, and optionally a road raster."""

    name: str
    frames: tuple[PandaFrame, ...]
    intrinsics: dict[str, FloatArray]
    label_names: dict[int, str]
    road: RoadRaster | None
    source: str

    def __post_init__(self) -> None:
        """Check that times increase, every camera has an intrinsic matrix, and labels fit a byte.

        Raises:
            DataError: if not, or there are no frames.
        """
        times = [frame.time_s for frame in self.frames]
        if not times:
            raise DataError(f"sequence {self.name}: no frames")
        if sorted(set(times)) != times:
            raise DataError(f"sequence {self.name}: the times of the frames do not increase")
        for channel in sorted({channel for frame in self.frames for channel in frame.images}):
            if channel not in self.intrinsics:
                raise DataError(f"sequence {self.name}: {channel} has images but no intrinsic matrix")
            check_intrinsic(f"{channel} intrinsic", self.intrinsics[channel])
        if any(not 0 <= index < 256 for index in self.label_names):
            raise DataError(f"sequence {self.name}: expected point labels 0..255, got {sorted(self.label_names)[-1]}")
        for label in self.label_names.values():
            category_of(label)


def drop_duplicate_cuboids(cuboids: tuple[Cuboid, ...]) -> tuple[Cuboid, ...]:
    """Drop the duplicates from the forward LiDAR (sensor 1) whose sibling is in the same frame.

    Some siblings are cut short: the start of a token names it if no other one in the frame starts alike.
    """
    present = {cuboid.track for cuboid in cuboids}
    return tuple(c for c in cuboids if not (c.sensor == 1 and _names_one(c.sibling, present)))


def _names_one(sibling: str | None, present: set[str]) -> bool:
    """Return whether a sibling is one of the tokens that are present, or the start of exactly one."""
    if sibling is None or sibling in present:
        return sibling is not None
    return len(sibling) >= _LEAST_PREFIX and sum(track.startswith(sibling) for track in present) == 1
