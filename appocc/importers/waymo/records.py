"""A segment in the layout of version 1: frames as protocol buffers in a TFRecord file."""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from appocc.checks import FloatArray, IntArray
from appocc.errors import DataError
from appocc.files import open_plain
from appocc.importers.waymo import fields as number
from appocc.importers.waymo.features import roads_of
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
    pose_of,
)
from appocc.importers.waymo.tfrecord import Record, list_records, read_record
from appocc.importers.waymo.wire import Message, find_integer

_MOST_UNPACKED = 1 << 26


class _Head(NamedTuple):
    """What is kept of the first frame: its context, and whether it has range images and map features."""

    context: Message
    swept: bool
    mapped: bool


@dataclass(frozen=True, eq=False)
class RecordSegment:
    """See `appocc.importers.waymo.segment.Segment`; the tables of the segment are those of its first frame."""

    path: Path

    @property
    def times_us(self) -> IntArray:
        """Times of the frames."""
        return self._index[1]

    @cached_property
    def cameras(self) -> tuple[WaymoCamera, ...]:
        """Calibrated cameras."""
        with self._reading("camera_calibrations"):
            return tuple(map(self._camera, self._head.context.messages(number.Context.CAMERA_CALIBRATIONS)))

    @cached_property
    def lasers(self) -> Mapping[int, Laser]:
        """Calibrated LiDARs."""
        if not self._head.swept:
            return {}
        with self._reading("laser_calibrations"):
            return dict(map(self._laser, self._head.context.messages(number.Context.LASER_CALIBRATIONS)))

    @property
    def place(self) -> str:
        """Location."""
        return self._told(number.Stats.LOCATION)

    @property
    def conditions(self) -> str:
        """Time of day and weather."""
        return ", ".join(filter(None, map(self._told, (number.Stats.TIME_OF_DAY, number.Stats.WEATHER))))

    @property
    def notes(self) -> tuple[str, ...]:
        """What the file lacks."""
        lacks = []
        if not self._head.swept:
            lacks.append("no range images: no LiDAR")
        if not self._head.mapped:
            lacks.append("no map features (they came with version 1.4): no map")
        return tuple(lacks)

    def frames(self, indices: IntArray) -> Iterator[WaymoFrame]:
        """Yield frames; one is in memory."""
        with open_plain(self.path) as file:
            for index in indices.tolist():
                yield self._frame(self._message(file, index))

    def roads(self) -> Roads | None:
        """Return the map features of the first frame."""
        with self._reading("map_features"):
            features = self._first_frame().messages(number.Frame.MAP_FEATURES)
            return roads_of(features) if features else None

    @cached_property
    def _index(self) -> tuple[list[Record], IntArray]:
        """Return the records and times in order of time."""
        with open_plain(self.path) as file:
            records = list_records(self.path, file)
            times = [self._time_us(file, record, row) for row, record in enumerate(records)]
        if not records:
            raise DataError(f"{self.path}: expected at least one frame, got an empty file")
        first = np.unique(times, return_index=True)[1]
        return [records[row] for row in first], np.array(times, np.int64)[first]

    def _time_us(self, file: BinaryIO, record: Record, row: int) -> int:
        file.seek(record.start)
        with self._reading(f"record {row}: expected a frame of Waymo"):
            return find_integer(file, record.start + record.size, number.Frame.TIMESTAMP_MICROS)

    def _first_frame(self) -> Message:
        with open_plain(self.path) as file:
            return self._message(file, 0)

    @cached_property
    def _head(self) -> _Head:
        frame = self._first_frame()
        with self._reading("context"):
            context = Message(frame.data(number.Frame.CONTEXT))
        return _Head(context, frame.has(number.Frame.LASERS), frame.has(number.Frame.MAP_FEATURES))

    def _told(self, field: number.Stats) -> str:
        with self._reading("stats"):
            return self._head.context.message(number.Context.STATS).text(field)

    def _message(self, file: BinaryIO, index: int) -> Message:
        data = read_record(self.path, file, self._index[0][index], index)
        with self._reading(f"frame {index}: expected a frame of Waymo"):
            return Message(data)

    @contextmanager
    def _reading(self, what: str) -> Iterator[None]:
        """Name the file and what is read of it if it is damaged.

        Raises:
            DataError: if the block raises an error of a damaged message.
        """
        try:
            yield
        except DataError:
            raise
        except (ValueError, zlib.error) as error:
            raise DataError(f"{self.path}: {what} ({error})") from error

    def _camera(self, message: Message) -> WaymoCamera:
        field = number.CameraCalibration
        intrinsic = message.reals(field.INTRINSIC)
        if len(intrinsic) != 9:
            raise DataError(f"{self.path}: camera intrinsic: expected 9 numbers, got {len(intrinsic)}")
        size = message.integer(field.WIDTH), message.integer(field.HEIGHT)
        pose = self._pose("camera extrinsic", message.message(field.EXTRINSIC))
        return WaymoCamera(message.integer(field.NAME), intrinsic, pose, size)

    def _laser(self, message: Message) -> tuple[int, Laser]:
        field = number.LaserCalibration
        beams = message.reals(field.BEAM_INCLINATIONS)
        uniform = not len(beams)
        if uniform:
            beams = np.array([message.real(field.BEAM_INCLINATION_MIN), message.real(field.BEAM_INCLINATION_MAX)])
        pose = self._pose("LiDAR extrinsic", message.message(field.EXTRINSIC))
        return message.integer(field.NAME), Laser(pose, beams, uniform)

    def _pose(self, what: str, message: Message) -> FloatArray:
        return pose_of(self.path, what, message.reals(number.Transform.TRANSFORM))

    def _frame(self, message: Message) -> WaymoFrame:
        with self._reading("expected a frame of Waymo"):
            offset = message.message(number.Frame.MAP_POSE_OFFSET)
            returns = partial(self._returns, message) if message.has(number.Frame.LASERS) else None
            return WaymoFrame(
                time_us=message.integer(number.Frame.TIMESTAMP_MICROS),
                world_from_ego=self._pose("pose", message.message(number.Frame.POSE)),
                map_from_world_m=np.array([offset.real(axis) for axis in number.Point]),
                pictures=tuple(map(self._picture, message.messages(number.Frame.IMAGES))),
                labels=tuple(map(_label, message.messages(number.Frame.LASER_LABELS))),
                no_label_zones=tuple(map(self._outline, message.messages(number.Frame.NO_LABEL_ZONES))),
                returns=returns,
            )

    def _outline(self, polygon: Message) -> FloatArray:
        x, y = polygon.reals(number.Polygon.X), polygon.reals(number.Polygon.Y)
        if len(x) != len(y) or len(x) < 3 or not np.isfinite([x, y]).all():
            raise DataError(f"{self.path}: no-label zone: expected three or more points, got {len(x)} x, {len(y)} y")
        return np.stack([x, y], axis=1)

    def _picture(self, image: Message) -> Picture:
        field = number.CameraImage
        return Picture(
            camera=image.integer(field.NAME),
            time_us=microseconds(self.path, "pose_timestamp", image.real(field.POSE_TIMESTAMP)),
            world_from_ego=self._pose("image pose", image.message(field.POSE)),
            read=partial(self._jpeg, image),
            panoptic=partial(self._panoptic, image),
        )

    def _jpeg(self, image: Message) -> bytes:
        with self._reading("image"):
            return image.data(number.CameraImage.IMAGE)

    def _panoptic(self, image: Message) -> PanopticLabel:
        with self._reading("camera_segmentation_label"):
            label = image.message(number.CameraImage.SEGMENTATION)
            return PanopticLabel(label.data(number.Segmentation.LABEL), label.integer(number.Segmentation.DIVISOR))

    def _returns(self, frame: Message) -> list[RangeImage]:
        """Return the range images of a frame; both returns of a LiDAR have the poses of the first."""
        found = []
        with self._reading("range image"):
            for laser in frame.messages(number.Frame.LASERS):
                returns = [laser.message(field) for field in (number.Laser.RETURN_1, number.Laser.RETURN_2)]
                poses = _matrix(returns[0].data(number.RangeImage.POSE_COMPRESSED))
                for image in returns:
                    values = _matrix(image.data(number.RangeImage.RANGE_IMAGE_COMPRESSED))
                    if values is not None:
                        found.append(RangeImage(laser.integer(number.Laser.NAME), values, poses))
        return found


def _matrix(data: bytes) -> NDArray[np.float32] | None:
    """Return a compressed MatrixFloat; None if there is none."""
    if not data:
        return None
    unpacker = zlib.decompressobj()
    message = Message(unpacker.decompress(data, _MOST_UNPACKED))
    if not unpacker.eof:
        raise ValueError("expected compressed numbers, got some that are cut off or too many")
    shape = message.message(number.MatrixFloat.SHAPE).integers(number.MatrixFloat.DIMS)
    return np.asarray(message.reals(number.MatrixFloat.DATA, "<f4").reshape(shape), np.float32)


def _label(message: Message) -> Label:
    box, field = message.message(number.Label.BOX), number.Box
    speed = message.message(number.Label.METADATA)
    known = message.has(number.Label.METADATA)
    return Label(
        instance=message.text(number.Label.ID),
        kind=message.integer(number.Label.TYPE),
        centre_m=np.array([box.real(field.CENTER_X), box.real(field.CENTER_Y), box.real(field.CENTER_Z)]),
        size_lwh_m=(box.real(field.LENGTH), box.real(field.WIDTH), box.real(field.HEIGHT)),
        heading_rad=box.real(field.HEADING),
        speed_mps=np.array([speed.real(number.Metadata.SPEED_X), speed.real(number.Metadata.SPEED_Y)])
        if known
        else np.full(2, np.nan),
        points=message.integer(number.Label.NUM_LIDAR_POINTS_IN_BOX, -1),
    )
