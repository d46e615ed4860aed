"""A segment in the layout of version 2: a parquet file for each component, `COMPONENT/SEGMENT.parquet`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path

import numpy as np

from appocc.checks import FloatArray, IntArray
from appocc.errors import DataError
from appocc.importers.parquet import Rows, read_parquet
from appocc.importers.tables import Columns
from appocc.importers.waymo.roads import Roads
from appocc.importers.waymo.segment import (
    Label,
    Laser,
    PanopticLabel,
    Picture,
    RangeImage,
    WaymoCamera,
    WaymoFrame,
    microseconds,
    no_label,
    pose_of,
)

POSE = "vehicle_pose"
_TIME, _CAMERA, _LASER, _OBJECT = (
    f"key.{name}" for name in ("frame_timestamp_micros", "camera_name", "laser_name", "laser_object_id")
)
_WORLD_FROM_VEHICLE = "[VehiclePoseComponent].world_from_vehicle.transform"
_INTRINSIC = tuple(
    f"[CameraCalibrationComponent].intrinsic.{name}"
    for name in ("f_u", "f_v", "c_u", "c_v", "k1", "k2", "p1", "p2", "k3")
)
_CAMERA_POSE = "[CameraCalibrationComponent].extrinsic.transform"
_SIZE = ("[CameraCalibrationComponent].width", "[CameraCalibrationComponent].height")
_LASER_POSE = "[LiDARCalibrationComponent].extrinsic.transform"
_BEAMS = tuple(f"[LiDARCalibrationComponent].beam_inclination.{name}" for name in ("min", "max"))
_BEAM_VALUES = "[LiDARCalibrationComponent].beam_inclination.values"
_IMAGE = "[CameraImageComponent].image"
_IMAGE_POSE = ("[CameraImageComponent].pose.transform", "[CameraImageComponent].pose_timestamp")
_PANOPTIC = "[CameraSegmentationLabelComponent].panoptic_label"
_DIVISOR = f"{_PANOPTIC}_divisor"
_RETURNS = ("[LiDARComponent].range_image_return1", "[LiDARComponent].range_image_return2")
_PIXEL_POSES = "[LiDARPoseComponent].range_image_return1"
_BOX = tuple(
    f"[LiDARBoxComponent].{name}"
    for name in (
        *("type", "num_lidar_points_in_box", "box.heading"),
        *(f"box.{part}.{axis}" for part in ("center", "size") for axis in "xyz"),
    )
)
_SPEED = ("[LiDARBoxComponent].speed.x", "[LiDARBoxComponent].speed.y")
_STATS = tuple(f"[StatsComponent].{name}" for name in ("location", "time_of_day", "weather"))
_LACKS = {
    "camera_image": "no pictures",
    "camera_segmentation": "no pixel classes",
    "lidar": "no LiDAR",
    "lidar_pose": "points of the upper LiDAR are not compensated for the motion during a sweep",
    "lidar_box": "no boxes",
    "stats": "no location, time of day and weather",
}


@dataclass(frozen=True, eq=False)
class ComponentSegment:
    """See `appocc.importers.waymo.segment.Segment`.

    Attributes:
        folder: folder of the components.
        name: name of the segment.
    """

    folder: Path
    name: str

    @property
    def times_us(self) -> IntArray:
        """Times of the frames."""
        return self._poses[0]

    @cached_property
    def cameras(self) -> tuple[WaymoCamera, ...]:
        """Calibrated cameras."""
        path = self._path("camera_calibration")
        rows = read_parquet(path, (_CAMERA, *_INTRINSIC, _CAMERA_POSE, *_SIZE))
        return tuple(
            WaymoCamera(
                number=int(rows[_CAMERA][row]),
                intrinsic=np.array([float(rows[name][row]) for name in _INTRINSIC]),
                ego_from_cam=pose_of(path, "extrinsic", rows[_CAMERA_POSE][row]),
                size_px=(int(rows[_SIZE[0]][row]), int(rows[_SIZE[1]][row])),
            )
            for row in range(len(rows[_CAMERA]))
        )

    @cached_property
    def lasers(self) -> Mapping[int, Laser]:
        """Calibrated LiDARs."""
        if not self._has("lidar"):
            return {}
        path = self._path("lidar_calibration")
        rows = read_parquet(path, (_LASER, _LASER_POSE, *_BEAMS, _BEAM_VALUES))
        found = {}
        for row, number in enumerate(rows[_LASER].tolist()):
            beams = rows[_BEAM_VALUES][row]
            uniform = beams is None or not len(beams)
            if uniform:
                beams = [rows[name][row] for name in _BEAMS]
            pose = pose_of(path, "extrinsic", rows[_LASER_POSE][row])
            found[int(number)] = Laser(pose, np.asarray(beams, np.float64), uniform)
        return found

    @property
    def place(self) -> str:
        """Location."""
        return self._stats[0]

    @property
    def conditions(self) -> str:
        """Time of day and weather."""
        return ", ".join(filter(None, self._stats[1:]))

    @property
    def notes(self) -> tuple[str, ...]:
        """What components are missing; this layout has no map."""
        missing = (f"no {name}: {lack}" for name, lack in _LACKS.items() if not self._has(name))
        return (*missing, "parquet files have no map and no no-label zones: they are in the TFRecords of version 1.4")

    def frames(self, indices: IntArray) -> Iterator[WaymoFrame]:
        """Yield frames; pages of one are in memory."""
        with ExitStack() as stack:
            rows = {
                name: stack.enter_context(Rows(self._path(name), columns))
                for name, columns in _STREAMS.items()
                if self._has(name)
            }
            for index in indices.tolist():
                yield self._frame(index, rows)

    def roads(self) -> Roads | None:
        """Return None: there is no such component."""
        return None

    def _path(self, component: str) -> Path:
        return self.folder / component / f"{self.name}.parquet"

    def _has(self, component: str) -> bool:
        return self._path(component).is_file()

    @cached_property
    def _poses(self) -> tuple[IntArray, FloatArray]:
        path = self._path(POSE)
        rows = read_parquet(path, (_TIME, _WORLD_FROM_VEHICLE))
        times, first = np.unique(rows[_TIME].astype(np.int64), return_index=True)
        if not len(times):
            raise DataError(f"{path}: expected at least one frame, got none")
        return times, np.stack([pose_of(path, "world_from_vehicle", rows[_WORLD_FROM_VEHICLE][row]) for row in first])

    @cached_property
    def _stats(self) -> tuple[str, ...]:
        if not self._has("stats"):
            return ("", "", "")
        rows = read_parquet(self._path("stats"), _STATS)
        return tuple(str(rows[name][0] or "") if len(rows[name]) else "" for name in _STATS)

    @cached_property
    def _labels(self) -> Columns | None:
        path = self._path("lidar_box")
        return read_parquet(path, (_TIME, _OBJECT, *_BOX), _SPEED) if self._has("lidar_box") else None

    @cached_property
    def _images(self) -> Columns:
        return read_parquet(self._path("camera_image"), (_TIME, _CAMERA, *_IMAGE_POSE))

    @cached_property
    def _panoptic_labels(self) -> Columns:
        """Times, cameras and divisors of the panoptic labels, few rows: most pictures have none."""
        return read_parquet(self._path("camera_segmentation"), (_TIME, _CAMERA), (_DIVISOR,))

    @cached_property
    def _keys(self) -> dict[str, Columns]:
        """Times and names of the rows of the LiDARs' components."""
        names = [name for name in ("lidar", "lidar_pose") if self._has(name)]
        return {name: read_parquet(self._path(name), (_TIME, _LASER)) for name in names}

    def _frame(self, index: int, rows: Mapping[str, Rows]) -> WaymoFrame:
        time_us, pose = int(self._poses[0][index]), self._poses[1][index]
        pictures = self._pictures(time_us, rows) if "camera_image" in rows else ()
        swept = "lidar" in rows and (self._keys["lidar"][_TIME] == time_us).any()
        return WaymoFrame(
            time_us=time_us,
            world_from_ego=pose,
            map_from_world_m=np.zeros(3),
            pictures=pictures,
            labels=tuple(self._boxes(time_us)),
            no_label_zones=(),
            returns=partial(self._range_images, time_us, rows) if swept else None,
        )

    def _pictures(self, time_us: int, rows: Mapping[str, Rows]) -> tuple[Picture, ...]:
        path, table = self._path("camera_image"), self._images
        labels = self._panoptics(time_us, rows.get("camera_segmentation"))
        pose, moment = _IMAGE_POSE
        return tuple(
            Picture(
                camera=int(table[_CAMERA][row]),
                time_us=microseconds(path, "pose_timestamp", float(table[moment][row])),
                world_from_ego=pose_of(path, "pose", table[pose][row]),
                read=partial(rows["camera_image"].bytes, row, _IMAGE),
                panoptic=labels.get(int(table[_CAMERA][row]), no_label),
            )
            for row in np.flatnonzero(table[_TIME] == time_us).tolist()
        )

    def _panoptics(self, time_us: int, rows: Rows | None) -> dict[int, Callable[[], PanopticLabel]]:
        """Return what reads the panoptic labels of a frame, by camera."""
        if rows is None:
            return {}
        table, divisors = self._panoptic_labels, self._panoptic_labels[_DIVISOR]
        return {
            int(table[_CAMERA][row]): partial(_panoptic, rows, row, int(np.nan_to_num(divisors[row])))
            for row in np.flatnonzero(table[_TIME] == time_us).tolist()
        }

    def _range_images(self, time_us: int, rows: Mapping[str, Rows]) -> list[RangeImage]:
        poses = {}
        if "lidar_pose" in rows:
            keys = self._keys["lidar_pose"]
            for row in np.flatnonzero(keys[_TIME] == time_us).tolist():
                poses[int(keys[_LASER][row])] = rows["lidar_pose"].array(row, _PIXEL_POSES)
        keys = self._keys["lidar"]
        found = []
        for row in np.flatnonzero(keys[_TIME] == time_us).tolist():
            laser = int(keys[_LASER][row])
            for name in _RETURNS:
                values = rows["lidar"].array(row, name)
                if values is not None:
                    found.append(RangeImage(laser, values, poses.get(laser)))
        return found

    def _boxes(self, time_us: int) -> Iterator[Label]:
        table = self._labels
        if table is None:
            return
        kind, points, heading, *places = _BOX
        for row in np.flatnonzero(table[_TIME] == time_us).tolist():
            x, y, z, length, width, height = (float(table[name][row]) for name in places)
            yield Label(
                instance=str(table[_OBJECT][row]),
                kind=int(table[kind][row]),
                centre_m=np.array([x, y, z]),
                size_lwh_m=(length, width, height),
                heading_rad=float(table[heading][row]),
                speed_mps=np.array([float(table[name][row]) if name in table else np.nan for name in _SPEED]),
                points=int(table[points][row]),
            )


# Components whose rows are too large to be in memory together.
_STREAMS = {
    "camera_image": (_IMAGE,),
    "camera_segmentation": (_PANOPTIC, _DIVISOR),
    "lidar": tuple(f"{name}.{part}" for name in _RETURNS for part in ("values", "shape")),
    "lidar_pose": tuple(f"{_PIXEL_POSES}.{part}" for part in ("values", "shape")),
}


def _panoptic(rows: Rows, row: int, divisor: int) -> PanopticLabel:
    return PanopticLabel(rows.bytes(row, _PANOPTIC), divisor)
