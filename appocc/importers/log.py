"""What every importer reads: a log of key frames with encoded images, LiDAR sweeps and boxes, read on demand."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from appocc.checks import ByteArray, FloatArray, IntArray
from appocc.nuscenes.writer import Annotation, Writer
from appocc.rigs import SourceRig


@dataclass(frozen=True, eq=False)
class Image:
    """An image of a key frame.

    Attributes:
        camera: name in the rig of the log.
        time_us: time of exposure, microseconds since 1970.
        world_from_ego: (4, 4) pose of the ego vehicle at this time.
        read: returns the JPEG or PNG file's bytes; raises DataError if they are missing.
        kinds: returns the (H, W) uint8 `ViewClass` of each pixel, as large as the rig says, `UNKNOWN_KIND` where not
            labelled, or None if the image has no labels; raises DataError if they are damaged.
    """

    camera: str
    time_us: int
    world_from_ego: FloatArray
    read: Callable[[], bytes]
    kinds: Callable[[], ByteArray | None] = lambda: None


@dataclass(frozen=True, eq=False)
class Sweep:
    """A LiDAR sweep of a key frame, all points at its time (motion compensated).

    Attributes:
        time_us: microseconds since 1970.
        world_from_ego: (4, 4) pose of the ego vehicle at this time.
        read: returns the points (N, 5) in the LiDAR frame of the log: x, y, z in metres, intensity 0..255, ring (-1
            if unknown); raises DataError if they are missing.
    """

    time_us: int
    world_from_ego: FloatArray
    read: Callable[[], FloatArray]


@dataclass(frozen=True, eq=False)
class Frame:
    """A key frame.

    Attributes:
        time_us: microseconds since 1970.
        images: at most one per camera; a missing camera has none.
        sweep: LiDAR sweep, if there is one.
        boxes: annotated objects in the world frame.
        more: writes further files and rows of the key frame, given the writer and the sample's token; None for none.
    """

    time_us: int
    images: tuple[Image, ...]
    sweep: Sweep | None = None
    boxes: tuple[Annotation, ...] = ()
    more: Callable[[Writer, str], None] | None = None


class Log(Protocol):
    """A recording that becomes one scene; it can be pickled, and reads its files on demand."""

    @property
    def name(self) -> str:
        """Name of the scene, unique in the dataset, fit for a file name."""

    @property
    def description(self) -> str:
        """What the scene is, for people."""

    @property
    def vehicle(self) -> str:
        """Recording vehicle or platform."""

    @property
    def location(self) -> str:
        """Place; the name of the vector map, if there is one."""

    @property
    def frames_in_total(self) -> int:
        """Number of key frames, for the progress bar; 0 if unknown."""

    def rig(self) -> SourceRig:
        """Return the cameras, with `ego_from_cam` in the ego frame: x ahead, y left, z up, origin on the road."""

    def ego_from_lidar(self) -> FloatArray | None:
        """Return the (4, 4) pose of the LiDAR frame of the sweeps; None without LiDAR."""

    def frames(self) -> Iterator[Frame]:
        """Yield the key frames in order of time, one in memory at a time."""

    def write_map(self, writer: Writer, log: str) -> None:
        """Write the map below the root of the writer and add its row for the log with this token; or do nothing."""

    def notes(self) -> tuple[str, ...]:
        """Return lines for people: what the format lacks or what was assumed."""


def key_indices(times_us: IntArray, hz: float) -> IntArray:
    """Return the indices of key frames among increasing times (N,): the nearest to each multiple of 1 / hz.

    Multiples count from the first time; one without a frame within half an interval has no key frame.
    """
    steps = (times_us - times_us[:1]) * hz / 1e6
    nearest = np.rint(steps)
    order = np.lexsort((np.abs(steps - nearest), nearest))
    first = np.unique(nearest[order], return_index=True)[1]
    return np.asarray(order[first], np.int64)
