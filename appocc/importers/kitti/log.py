"""A log of any of KITTI's layouts: what its files are, and how they become key frames."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path

import numpy as np

from appocc.checks import FloatArray, IntArray
from appocc.ego_vehicle import EgoVehicle
from appocc.errors import DataError
from appocc.files import read_file
from appocc.importers.log import Frame, Image, Sweep, key_indices
from appocc.nuscenes.writer import Annotation, Writer
from appocc.rigs import SourceRig

# The recording vehicle, a VW Passat B6 estate.
EGO_VEHICLE = EgoVehicle(length_m=4.77, width_m=1.82, rear_overhang_m=1.05, turning_circle_m=11.4)
_POINT_BYTES = 16
_UNCOMPENSATED = "LiDAR points are as published: not compensated for the motion during a sweep"


@dataclass(frozen=True, eq=False)
class Recording:
    """What a layout's files say about a log of N frames.

    The cameras are triggered when the LiDAR looks ahead: all files of a frame have its time and pose.

    Attributes:
        numbers: (N,) rising numbers of the frames, which name their files.
        times_us: (N,) rising times.
        world_from_ego: (N, 4, 4) poses.
        rig: cameras, named as their folders.
        ego_from_velo: (4, 4) pose of the Velodyne; None without sweeps.
        picture: the file of a camera in a frame, which may be missing.
        sweep: the file of the Velodyne in a frame, which may be missing.
        boxes: annotated objects in a frame, given its pose, in the world frame.
        notes: lines for people.
    """

    numbers: IntArray
    times_us: IntArray
    world_from_ego: FloatArray
    rig: SourceRig
    ego_from_velo: FloatArray | None
    picture: Callable[[str, int], Path]
    sweep: Callable[[int], Path]
    boxes: Callable[[int, FloatArray], tuple[Annotation, ...]] = lambda number, pose: ()
    notes: tuple[str, ...] = field(default=())


@dataclass(frozen=True)
class KittiLog:
    """A log, see `appocc.importers.Log`.

    Attributes:
        name: name of the drive or sequence.
        layout: name of the layout, for people.
        read: reads calibration, poses and annotations; raises DataError.
        hz: key frames per second.
    """

    name: str
    layout: str
    read: Callable[[], Recording]
    hz: float

    @property
    def description(self) -> str:
        """Source of the log."""
        return f"{self.layout}, {self.name}"

    @property
    def vehicle(self) -> str:
        """Recording platform."""
        return "kitti"

    @property
    def location(self) -> str:
        """Place of all recordings."""
        return "karlsruhe"

    @property
    def frames_in_total(self) -> int:
        """Number of key frames."""
        return len(self._keys)

    def rig(self) -> SourceRig:
        """Return the cameras that have pictures."""
        return self._recording.rig

    def ego_from_lidar(self) -> FloatArray | None:
        """Return the pose of the Velodyne; None without sweeps."""
        return self._recording.ego_from_velo

    def frames(self) -> Iterator[Frame]:
        """Yield the key frames; one without any file is left out."""
        found = self._recording
        for index in self._keys.tolist():
            number, time_us, pose = int(found.numbers[index]), int(found.times_us[index]), found.world_from_ego[index]
            paths = ((name, found.picture(name, number)) for name in found.rig.names)
            images = tuple(
                Image(name, time_us, pose, partial(read_file, path)) for name, path in paths if path.is_file()
            )
            path = found.sweep(number)
            sweep = Sweep(time_us, pose, partial(read_velodyne, path)) if path.is_file() else None
            if images or sweep is not None:
                yield Frame(time_us, images, sweep, found.boxes(number, pose))

    def write_map(self, writer: Writer, log: str) -> None:
        """Write nothing: KITTI has no maps."""

    def notes(self) -> tuple[str, ...]:
        """Return what is assumed or left out."""
        points = () if self._recording.ego_from_velo is None else (_UNCOMPENSATED,)
        return (*self._recording.notes, *points)

    def __getstate__(self) -> dict[str, object]:
        """Leave what was read to the process that needs it."""
        return {name: getattr(self, name) for name in ("name", "layout", "read", "hz")}

    @cached_property
    def _recording(self) -> Recording:
        return self.read()

    @cached_property
    def _keys(self) -> IntArray:
        return key_indices(self._recording.times_us, self.hz)


def read_velodyne(path: Path) -> FloatArray:
    """Return the points (N, 5) of a sweep in the Velodyne's frame: x, y, z, intensity 0..255, ring -1 (unknown).

    Raises:
        DataError: if the file is damaged, or a number in it is not finite.
    """
    data = read_file(path)
    if len(data) % _POINT_BYTES:
        raise DataError(f"{path}: expected rows of 4 float32 (16 bytes), got {len(data)} bytes: truncated?")
    points = np.frombuffer(data, "<f4").reshape(-1, 4).astype(np.float64)
    if not np.isfinite(points).all():
        raise DataError(f"{path}: expected finite points, got some that are not")
    return np.column_stack([points[:, :3], np.clip(points[:, 3], 0, 1) * 255, np.full(len(points), -1.0)])
