"""What both layouts tell about a segment of a Waymo drive, in Waymo's own frames and numbers.

The vehicle frame has x ahead, y left, z up and its origin on the ground below the middle of the rear axle: it is the
ego frame. A camera frame has x ahead, y left, z up, too.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from appocc.checks import FloatArray, IntArray, check_transform
from appocc.errors import DataError, ShapeError
from appocc.geometry import nearest_rigid
from appocc.importers.waymo.roads import Roads


@dataclass(frozen=True, eq=False)
class WaymoCamera:
    """The calibration of a camera.

    Attributes:
        number: CameraName.
        intrinsic: (9,) f_u, f_v, c_u, c_v, k1, k2, p1, p2, k3; (0, 0) is the corner of the picture.
        ego_from_cam: (4, 4) pose of Waymo's camera frame.
        size_px: width, height.
    """

    number: int
    intrinsic: FloatArray
    ego_from_cam: FloatArray
    size_px: tuple[int, int]


@dataclass(frozen=True, eq=False)
class Laser:
    """The calibration of a LiDAR.

    Attributes:
        ego_from_laser: (4, 4) pose.
        inclinations_rad: (H,) rising beams; (2,) lowest and highest edge if the beams are uniform.
        uniform: whether the beams are uniform.
    """

    ego_from_laser: FloatArray
    inclinations_rad: FloatArray
    uniform: bool


@dataclass(frozen=True, eq=False)
class RangeImage:
    """A return of a LiDAR.

    Attributes:
        laser: LaserName.
        values: (H, W, 4) range in metres (none if not positive), intensity, elongation, no label zone.
        poses: (H, W, 6) roll, pitch, yaw, x, y, z of world_from_ego when a pixel was measured; None: as the frame's.
    """

    laser: int
    values: NDArray[np.float32]
    poses: NDArray[np.float32] | None


class PanopticLabel(NamedTuple):
    """A panoptic label of a picture: a PNG of class * divisor + instance, and the divisor; empty and 0 if missing."""

    png: bytes
    divisor: int


def no_label() -> PanopticLabel:
    """Return the panoptic label of a picture that has none."""
    return PanopticLabel(b"", 0)


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture of a camera.

    Attributes:
        camera: CameraName.
        time_us: time of its middle.
        world_from_ego: (4, 4) vehicle pose at this time.
        read: reads its JPEG.
        panoptic: reads its panoptic label.
    """

    camera: int
    time_us: int
    world_from_ego: FloatArray
    read: Callable[[], bytes]
    panoptic: Callable[[], PanopticLabel]


@dataclass(frozen=True, eq=False)
class Label:
    """A box in the vehicle frame of its frame: object, type, centre, length/width/height, heading.

    `speed_mps` (2,) is NaN where unknown, `points` -1.
    """

    instance: str
    kind: int
    centre_m: FloatArray
    size_lwh_m: tuple[float, float, float]
    heading_rad: float
    speed_mps: FloatArray
    points: int


@dataclass(frozen=True, eq=False)
class WaymoFrame:
    """A frame.

    Attributes:
        time_us: its start.
        world_from_ego: (4, 4) pose near its middle: that of the labels and points.
        map_from_world_m: (3,) what moves all its poses onto the map.
        pictures: pictures of the cameras.
        labels: boxes.
        no_label_zones: outlines (K, 2), world frame, in which nothing is labelled.
        returns: reads the range images; None if there are none.
    """

    time_us: int
    world_from_ego: FloatArray
    map_from_world_m: FloatArray
    pictures: tuple[Picture, ...]
    labels: tuple[Label, ...]
    no_label_zones: tuple[FloatArray, ...]
    returns: Callable[[], list[RangeImage]] | None


class Segment(Protocol):
    """A segment in either layout, read on demand."""

    @property
    def times_us(self) -> IntArray:
        """Rising times (N,) of the frames."""

    @property
    def cameras(self) -> tuple[WaymoCamera, ...]:
        """All calibrated cameras."""

    @property
    def lasers(self) -> Mapping[int, Laser]:
        """All calibrated LiDARs by LaserName; empty if the segment has no range images."""

    @property
    def place(self) -> str:
        """Location, such as location_sf; '' if unknown."""

    @property
    def conditions(self) -> str:
        """Time of day and weather; '' if unknown."""

    @property
    def notes(self) -> tuple[str, ...]:
        """Lines for people about what is missing."""

    def frames(self, indices: IntArray) -> Iterator[WaymoFrame]:
        """Yield some frames, in rising order; each may be read until the next one is asked for."""

    def roads(self) -> Roads | None:
        """Return the vector map in the world frame; None if there is none."""


def pose_of(path: Path, what: str, values: FloatArray) -> FloatArray:
    """Return the (4, 4) pose of 16 numbers, row by row.

    Raises:
        DataError: if they are none.
    """
    try:
        pose = np.asarray(values, np.float64).reshape(4, 4)
        check_transform(what, pose)
    except (ValueError, ShapeError) as error:
        raise DataError(f"{path}: {what}: expected a pose of 16 numbers ({error})") from error
    return nearest_rigid(pose)


def microseconds(path: Path, what: str, seconds: float) -> int:
    """Return a time in whole microseconds.

    Raises:
        DataError: if it is not between 1970 and 2100.
    """
    if not 0 < seconds < 4.1e9:
        raise DataError(f"{path}: {what}: expected seconds since 1970, got {seconds}")
    return round(seconds * 1e6)
