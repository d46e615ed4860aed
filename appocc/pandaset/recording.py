"""A PandaSet sequence in memory: what both readers (plain twin, published pickles) give to the converter.

Frames: `world` is PandaSet's; `ego` here is x forward, y left, z up at the height of PandaSet's LiDAR pose, which is
0.40 m above the road (nuScenes' ego lies on the road: the converter lowers it).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from appocc.checks import ByteArray, FloatArray, check_finite, check_shape, check_transform
from appocc.errors import DataError

# PandaSet's camera folders and the nuScenes-style channels they become.
CHANNELS = {
    "front_camera": "CAM_FRONT",
    "front_left_camera": "CAM_FRONT_LEFT",
    "front_right_camera": "CAM_FRONT_RIGHT",
    "left_camera": "CAM_LEFT",
    "right_camera": "CAM_RIGHT",
    "back_camera": "CAM_BACK",
}


@dataclass(frozen=True)
class Image:
    """An image file with its own time and pose; PandaSet publishes rectified images, so no distortion applies."""

    path: Path
    time_s: float
    world_from_cam: FloatArray

    def __post_init__(self) -> None:
        """Check the pose.

        Raises:
            ShapeError: if it is no pose.
        """
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
            ShapeError: if one is missing or not finite.
        """
        check_shape(f"cuboid {self.track} centre", self.centre_world_m, (3,))
        check_shape(f"cuboid {self.track} size", self.size_lwh_m, (3,))
        check_finite(f"cuboid {self.track} centre", self.centre_world_m)
        check_finite(f"cuboid {self.track} size", self.size_lwh_m)


@dataclass(frozen=True)
class Sweep:
    """Points of the spinning LiDAR: (N, 3) metres in the ego frame, (N,) intensity 0..255, (N,) class labels."""

    points_ego_m: FloatArray
    intensity: ByteArray
    labels: ByteArray | None


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
        """Check the pose.

        Raises:
            ShapeError: if it is no pose.
        """
        check_transform(f"frame {self.index} world_from_ego", self.world_from_ego)


@dataclass(frozen=True)
class RoadRaster:
    """A raster of ground classes: label (rows along +y, columns along +x), lower left corner, cell size."""

    label: ByteArray
    origin_m: tuple[float, float]
    cell_m: float


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
        """Check that time runs forward.

        Raises:
            DataError: if it does not, or there are no frames.
        """
        times = [moment.time_s for moment in self.moments]
        if not times:
            raise DataError(f"sequence {self.name}: no frames")
        if sorted(set(times)) != times:
            raise DataError(f"sequence {self.name}: the frames' times do not rise")


def without_twins(cuboids: tuple[Cuboid, ...]) -> tuple[Cuboid, ...]:
    """Drop the forward LiDAR's copy (sensor 1) of a box whose sibling is in the same frame; keep the others."""
    present = {cuboid.track for cuboid in cuboids}
    return tuple(c for c in cuboids if not (c.sensor == 1 and c.sibling in present))
