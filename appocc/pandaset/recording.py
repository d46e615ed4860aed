"""A PandaSet sequence in memory: what both readers (plain twin, published pickles) give to the converter.

Frames: `world` is PandaSet's; `ego` here is x forward, y left, z up at the height of PandaSet's LiDAR pose, which is
0.40 m above the road (nuScenes' ego lies on the road: the converter lowers it).
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

# PandaSet's camera folders and the nuScenes-style channels they become.
CHANNELS = {
    "front_camera": "CAM_FRONT",
    "front_left_camera": "CAM_FRONT_LEFT",
    "front_right_camera": "CAM_FRONT_RIGHT",
    "left_camera": "CAM_LEFT",
    "right_camera": "CAM_RIGHT",
    "back_camera": "CAM_BACK",
}


def _check_time(name: str, time_s: float) -> None:
    """Check seconds since 1970, up to the year 5138: more would not fit whole microseconds."""
    if not 0 <= time_s < 1e11:
        raise ShapeError(f"{name}: expected seconds since 1970, got {time_s:g}")


@dataclass(frozen=True)
class Image:
    """An image file with its own time and pose; PandaSet publishes rectified images, so no distortion applies."""

    path: Path
    time_s: float
    world_from_cam: FloatArray

    def __post_init__(self) -> None:
        """Check time and pose.

        Raises:
            ShapeError: if the time or the pose is none.
        """
        _check_time(f"{self.path.name} time", self.time_s)
        check_transform(f"{self.path.name} world_from_cam", self.world_from_cam)


@dataclass(frozen=True)
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
        """Check the numbers.

        Raises:
            ShapeError: if one is missing or not finite, or a size is not positive.
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


@dataclass(frozen=True)
class Sweep:
    """Points of the spinning LiDAR: (N, 3) metres in the ego frame, (N,) intensity 0..255, (N,) class labels."""

    points_ego_m: FloatArray
    intensity: ByteArray
    labels: ByteArray | None

    def __post_init__(self) -> None:
        """Check that there are points, and that each has a place, an intensity and, if any has, a label.

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


@dataclass(frozen=True)
class Moment:
    """One frame of the sequence: images by channel, boxes, and a function that reads its sweep (None: no LiDAR)."""

    index: int
    time_s: float
    world_from_ego: FloatArray
    images: dict[str, Image]
    cuboids: tuple[Cuboid, ...]
    read_sweep: Callable[[], Sweep] | None

    def __post_init__(self) -> None:
        """Check time and pose.

        Raises:
            ShapeError: if the time or the pose is none.
        """
        _check_time(f"frame {self.index} time", self.time_s)
        check_transform(f"frame {self.index} world_from_ego", self.world_from_ego)


@dataclass(frozen=True)
class RoadRaster:
    """A raster of ground classes: label (rows along +y, columns along +x), lower left corner, cell size."""

    label: ByteArray
    origin_m: tuple[float, float]
    cell_m: float

    def __post_init__(self) -> None:
        """Check that the raster can become a mask of 10 px a metre.

        Raises:
            ShapeError: if it has no cells, no place, or cells that are no whole multiple of 0.1 m.
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
        """Cells of 0.1 m along the side of one of these."""
        return round(self.cell_m / 0.1)


@dataclass(frozen=True)
class Recording:
    """A sequence: frames in order of time, intrinsics by channel, names of the point labels, maybe a road raster."""

    name: str
    moments: tuple[Moment, ...]
    intrinsics: dict[str, FloatArray]
    label_names: dict[int, str]
    road: RoadRaster | None
    source: str

    def __post_init__(self) -> None:
        """Check that time runs forward, that every camera has an intrinsic matrix, and that labels fit a byte.

        Raises:
            DataError: if not, or there are no frames.
        """
        times = [moment.time_s for moment in self.moments]
        if not times:
            raise DataError(f"sequence {self.name}: no frames")
        if sorted(set(times)) != times:
            raise DataError(f"sequence {self.name}: the frames' times do not rise")
        for channel in sorted({channel for moment in self.moments for channel in moment.images}):
            if channel not in self.intrinsics:
                raise DataError(f"sequence {self.name}: {channel} has images but no intrinsic matrix")
            check_intrinsic(f"{channel} intrinsic", self.intrinsics[channel])
        if any(not 0 <= index < 256 for index in self.label_names):
            raise DataError(f"sequence {self.name}: expected point labels 0..255, got {sorted(self.label_names)[-1]}")
        for label in self.label_names.values():
            category_of(label)


def without_twins(cuboids: tuple[Cuboid, ...]) -> tuple[Cuboid, ...]:
    """Drop the forward LiDAR's copy (sensor 1) of a box whose sibling is in the same frame; keep the others."""
    present = {cuboid.track for cuboid in cuboids}
    return tuple(c for c in cuboids if not (c.sensor == 1 and c.sibling in present))
