"""A log of the Argoverse 2 Sensor Dataset: feather tables, pictures, sweeps and a vector map in one folder."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path

import numpy as np

from appocc.checks import FloatArray, IntArray
from appocc.ego_vehicle import EgoVehicle
from appocc.errors import DataError
from appocc.files import read_file
from appocc.geometry import apply, inverse, transform
from appocc.importers.argoverse.categories import CATEGORIES
from appocc.importers.argoverse.map import city_of, write_map
from appocc.importers.log import Frame, Image, Sweep, key_indices
from appocc.importers.tables import QUATERNION, TRANSLATION, Columns, poses_of, read_feather
from appocc.lenses import DistortedLens
from appocc.nuscenes.writer import Annotation, Writer
from appocc.rigs import SourceRig
from appocc.rigs.cutting import cut_rig
from appocc.rigs.source_camera import SourceCamera
from appocc.trajectory import Trajectory

# The origin of Argoverse's ego frame is the middle of the rear axle, that of ours the ground below it.
EGO_FROM_AXLE = transform(np.eye(3), [0.0, 0.0, 0.33])
EGO_VEHICLE = EgoVehicle(length_m=4.87, width_m=1.85, rear_overhang_m=1.12)
LIDAR = "up_lidar"
_CHANNELS = {
    "ring_front_center": "CAM_FRONT",
    "ring_front_left": "CAM_FRONT_LEFT",
    "ring_front_right": "CAM_FRONT_RIGHT",
    "ring_side_left": "CAM_SIDE_LEFT",
    "ring_side_right": "CAM_SIDE_RIGHT",
    "ring_rear_left": "CAM_BACK_LEFT",
    "ring_rear_right": "CAM_BACK_RIGHT",
    "stereo_front_left": "CAM_STEREO_LEFT",
    "stereo_front_right": "CAM_STEREO_RIGHT",
}
# Cameras take 20 pictures a second, the LiDAR ten sweeps.
_CAMERA_TOLERANCE_US, _SWEEP_TOLERANCE_US = 30_000, 5_000
_BOX = ("timestamp_ns", "track_uuid", "category", "length_m", "width_m", "height_m", "num_interior_pts")
_POSE = (*QUATERNION, *TRANSLATION)


@dataclass(frozen=True)
class ArgoverseLog:
    """A log, see `appocc.importers.Log`.

    Attributes:
        folder: folder of the log.
        hz: key frames per second.
    """

    folder: Path
    hz: float

    @property
    def name(self) -> str:
        """Name of the folder."""
        return self.folder.name

    @property
    def description(self) -> str:
        """Source of the log."""
        return f"Argoverse 2, log {self.name}"

    @property
    def vehicle(self) -> str:
        """Recording platform."""
        return "argoverse2"

    @property
    def location(self) -> str:
        """City and log: each log has a map of its own."""
        return f"{city_of(self.folder)}-{self.name}"

    @property
    def frames_in_total(self) -> int:
        """Number of key frames."""
        return len(self._key_times_us)

    def rig(self) -> SourceRig:
        """Return the cameras that have pictures; all ring cameras if none has."""
        path = self.folder / "calibration" / "intrinsics.feather"
        known = read_feather(
            path, ("sensor_name", "fx_px", "fy_px", "cx_px", "cy_px", "k1", "k2", "k3", "height_px", "width_px")
        )
        rows = {str(name): row for row, name in enumerate(known["sensor_name"])}
        with_pictures = [name for name in _CHANNELS if len(self._times_us(name))]
        wanted = with_pictures or [name for name in _CHANNELS if name.startswith("ring") and name in rows]
        if missing := [name for name in wanted if name not in rows]:
            raise DataError(f"{path}: expected a row for {missing[0]}, got none")
        return cut_rig(tuple(self._camera(name, known, rows[name]) for name in wanted), EGO_VEHICLE)

    def ego_from_lidar(self) -> FloatArray | None:
        """Return the pose of the upper LiDAR; None without sweeps."""
        return EGO_FROM_AXLE @ self._axle_from_sensor(LIDAR) if len(self._times_us("lidar")) else None

    def frames(self) -> Iterator[Frame]:
        """Yield the key frames."""
        boxes, times = self._boxes, self._times_us("lidar")
        cameras = {name: self._times_us(name) for name in _CHANNELS}
        for time_us in self._key_times_us.tolist():
            found = ((name, _nearest(taken, time_us, _CAMERA_TOLERANCE_US)) for name, taken in cameras.items())
            images = tuple(self._image(name, taken) for name, taken in found if taken is not None)
            swept = _nearest(times, time_us, _SWEEP_TOLERANCE_US)
            sweep = None if swept is None else self._sweep(swept)
            yield Frame(time_us, images, sweep, tuple(self._annotations(boxes, time_us)))

    def write_map(self, writer: Writer, log: str) -> None:
        """Write the vector map and the mask of the drivable area."""
        write_map(self.folder, self.location, writer, log)

    def notes(self) -> tuple[str, ...]:
        """Return what is left out."""
        if self._boxes is None:
            return ("no annotations.feather: no boxes",)
        unknown = sorted({str(name) for name in self._boxes["category"]} - set(CATEGORIES))
        return (f"left out, without a class in nuScenes: boxes of {', '.join(unknown)}",) if unknown else ()

    @cached_property
    def _key_times_us(self) -> IntArray:
        """Times of the sweeps, which are those of the annotations; without sweeps, of the front camera's pictures."""
        times = next((found for each in ("lidar", "ring_front_center") if len(found := self._times_us(each))), None)
        if times is None:
            raise DataError(f"{self.folder}: expected sweeps or pictures of the front camera, got neither")
        times = times[[self._poses.at(int(time)) is not None for time in times]]
        return times[key_indices(times, self.hz)]

    @cached_property
    def _poses(self) -> Trajectory:
        path = self.folder / "city_SE3_egovehicle.feather"
        columns = read_feather(path, ("timestamp_ns", *_POSE))
        times, first = np.unique(columns["timestamp_ns"] // 1000, return_index=True)
        if not len(times):
            raise DataError(f"{path}: expected at least one pose, got none")
        return Trajectory(times, poses_of(path, columns)[first] @ inverse(EGO_FROM_AXLE))

    @cached_property
    def _boxes(self) -> Columns | None:
        path = self.folder / "annotations.feather"
        return read_feather(path, (*_BOX, *_POSE)) if path.is_file() else None

    @cached_property
    def _sensors(self) -> dict[str, FloatArray]:
        path = self.folder / "calibration" / "egovehicle_SE3_sensor.feather"
        columns = read_feather(path, ("sensor_name", *_POSE))
        return dict(zip(map(str, columns["sensor_name"]), poses_of(path, columns), strict=True))

    def _axle_from_sensor(self, name: str) -> FloatArray:
        if name not in self._sensors:
            path = self.folder / "calibration" / "egovehicle_SE3_sensor.feather"
            raise DataError(f"{path}: expected a row for {name}, got {', '.join(sorted(self._sensors))}")
        return self._sensors[name]

    def _camera(self, name: str, known: Columns, row: int) -> SourceCamera:
        fx, fy, cx, cy, k1, k2, k3 = (
            float(known[key][row]) for key in ("fx_px", "fy_px", "cx_px", "cy_px", "k1", "k2", "k3")
        )
        lens = DistortedLens(np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]), np.array([k1, k2, 0, 0, k3]))
        size = int(known["width_px"][row]), int(known["height_px"][row])
        return SourceCamera(name, _CHANNELS[name], *size, lens, EGO_FROM_AXLE @ self._axle_from_sensor(name))

    def _folder_of(self, sensor: str) -> Path:
        return self.folder / "sensors" / ("lidar" if sensor == "lidar" else f"cameras/{sensor}")

    def _file(self, sensor: str, time_us: int) -> Path:
        """Return the file of a sensor at a time; names are nanoseconds."""
        (path,) = list(self._folder_of(sensor).glob(f"{time_us}[0-9][0-9][0-9].*"))[:1]
        return path

    def _times_us(self, sensor: str) -> IntArray:
        """Return the rising times of the files of a sensor."""
        ending = ".feather" if sensor == "lidar" else ".jpg"
        paths = self._folder_of(sensor).glob(f"[0-9]*{ending}")
        times = [int(path.stem) // 1000 for path in paths if path.stem.isdigit() and len(path.stem) < 20]
        return np.array(sorted(times), np.int64)

    def _image(self, name: str, time_us: int) -> Image:
        pose = self._pose_at(time_us)
        return Image(name, time_us, pose, partial(read_file, self._file(name, time_us)))

    def _sweep(self, time_us: int) -> Sweep:
        read = partial(_points, self._file("lidar", time_us), inverse(self._axle_from_sensor(LIDAR)))
        return Sweep(time_us, self._pose_at(time_us), read)

    def _pose_at(self, time_us: int) -> FloatArray:
        pose = self._poses.at(time_us)
        if pose is not None:
            return pose
        times = self._poses.times_us  # the first and last pictures may lie a few ms outside
        return np.array(self._poses.world_from_ego[int(np.abs(times - time_us).argmin())])

    def _annotations(self, boxes: Columns | None, time_us: int) -> Iterator[Annotation]:
        if boxes is None:
            return
        rows = np.flatnonzero(boxes["timestamp_ns"] // 1000 == time_us)
        near = {name: values[rows] for name, values in boxes.items()}
        world_from_axle = self._pose_at(time_us) @ EGO_FROM_AXLE
        for row, pose in enumerate(poses_of(self.folder / "annotations.feather", near)):
            category = CATEGORIES.get(str(near["category"][row]))
            if category:
                yield Annotation(
                    instance=str(near["track_uuid"][row]),
                    category=category,
                    world_from_box=world_from_axle @ pose,
                    size_wlh_m=(
                        float(near["width_m"][row]),
                        float(near["length_m"][row]),
                        float(near["height_m"][row]),
                    ),
                    lidar_points=int(near["num_interior_pts"][row]),
                )


def _nearest(times_us: IntArray, time_us: int, tolerance_us: int) -> int | None:
    """Return the time nearest to another one; None if none is within the tolerance."""
    if not len(times_us):
        return None
    nearest = int(times_us[np.abs(times_us - time_us).argmin()])
    return nearest if abs(nearest - time_us) <= tolerance_us else None


def _points(path: Path, lidar_from_axle: FloatArray) -> FloatArray:
    """Return the points (N, 5) of a sweep in the frame of the upper LiDAR; the files have them in the ego frame."""
    columns = read_feather(path, ("x", "y", "z", "intensity", "laser_number"))
    places = np.stack([columns[axis].astype(np.float64) for axis in "xyz"], axis=1)
    more = [columns[name].astype(np.float64) for name in ("intensity", "laser_number")]
    return np.column_stack([apply(lidar_from_axle, places), *more])


def find_logs(src: Path, hz: float) -> list[ArgoverseLog]:
    """Return the logs in a folder, in order of name: a log, or the dataset or one of its splits.

    Raises:
        DataError: if there is none.
    """
    marker = "city_SE3_egovehicle.feather"
    found = sorted(path.parent for depth in ("", "*/", "*/*/", "*/*/*/") for path in src.glob(f"{depth}{marker}"))
    if not found:
        raise DataError(f"{src}: expected logs of Argoverse 2 with {marker}, got none")
    return [ArgoverseLog(folder, hz) for folder in found]
