"""Write logs as one dataset in the nuScenes schema: streamed, parallel and resumable by log."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from appocc.checks import ByteArray, FloatArray
from appocc.errors import DataError
from appocc.files import decoded_image, plain_name, read_json, write_bytes, write_image, write_json
from appocc.geometry import apply, inverse
from appocc.importers.log import Frame, Image, Log
from appocc.jpeg import is_jpeg
from appocc.nuscenes.assembly import Assembly, resolved
from appocc.nuscenes.dataset import LIDAR
from appocc.nuscenes.lidar import write_lidar
from appocc.nuscenes.view_reduction import reduce_classes
from appocc.nuscenes.view_targets import UNKNOWN_KIND, ViewTargets, save_view_targets, view_targets_path
from appocc.nuscenes.writer import Annotation, Writer, token_of
from appocc.rigs import SourceRig
from appocc.version import __version__
from appocc.workers import Engine, in_order

RECORD = "import.json"
_SUMMARY = ".summary.json"
# Examples of unreadable files in a summary.
_DAMAGED = 3


@dataclass
class Summary:
    """Counts of what was written.

    Attributes:
        scenes: names.
        samples: number of key frames.
        images: number of images.
        sweeps: number of LiDAR sweeps.
        boxes: number of annotated boxes.
        pixel_classes: number of images with pixel classes.
        missing: camera, LiDAR or pixel classes of a camera -> number of key frames in which it is missing; pixel
            classes are missing where they are damaged.
        damaged: first reasons of unreadable images, sweeps and pixel classes.
        notes: further lines for people.
    """

    scenes: list[str] = field(default_factory=list)
    samples: int = 0
    images: int = 0
    sweeps: int = 0
    boxes: int = 0
    pixel_classes: int = 0
    missing: Counter[str] = field(default_factory=Counter)
    damaged: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def as_json(self) -> dict[str, Any]:
        """Return JSON values."""
        return {**vars(self), "missing": dict(self.missing)}

    def add(self, other: Mapping[str, Any]) -> None:
        """Add the counts of another summary, as JSON values."""
        self.scenes += other["scenes"]
        for name in ("samples", "images", "sweeps", "boxes", "pixel_classes"):
            setattr(self, name, getattr(self, name) + other[name])
        self.missing.update(other["missing"])
        self.damaged += other["damaged"][: max(0, _DAMAGED - len(self.damaged))]
        self.notes += [note for note in other["notes"] if note not in self.notes]


def import_logs(
    logs: Sequence[Log],
    out: Path,
    source: str,
    settings: Mapping[str, Any],
    pool: Engine | None = None,
    advance: Callable[[int], None] = lambda count: None,
) -> Summary:
    """Write logs to a new dataset `out`; the same call resumes an interrupted one. One key frame is in memory.

    The result depends neither on the pool nor on interruptions.

    Args:
        logs: recordings; each becomes a scene.
        out: new folder.
        source: name of the format; names the folder of the tables, `v1.0-SOURCE`.
        settings: JSON values that determine the result, such as the path of the recordings and the rate.
        pool: processes that import logs in parallel.
        advance: progress callback, in key frames.

    Raises:
        DataError: if a log is damaged or has no key frame, two have the same name, or `out` cannot be written.
    """
    names = [plain_name(out, log.name) for log in logs]
    if twice := [name for name, count in Counter(names).items() if count > 1]:
        raise DataError(f"{source}: expected one recording of each name, got several of '{twice[0]}'")
    if not logs:
        raise DataError(f"{source}: expected at least one recording, got none")
    version = f"v1.0-{source}"
    known = {"appocc": __version__, "importer": source, **settings, "logs": names}
    assembly = Assembly(resolved(out), version, RECORD, known, "conversion")
    total = Summary()
    if assembly.is_finished():
        raise DataError(f"{out}: holds this conversion already")
    with assembly.opened():
        left = [log for log in logs if not assembly.has(log.name)]
        advance(sum(read_json(assembly.place(name) / _SUMMARY)["samples"] for name in names if assembly.has(name)))
        job = partial(_import_one, assembly=assembly, advance=None if pool else advance)
        for written in in_order(pool, job, left):
            advance(written)
        for name in names:
            total.add(read_json(assembly.place(name) / _SUMMARY))
        assembly.finish(names)
    return total


def _import_one(log: Log, assembly: Assembly, advance: Callable[[int], None] | None) -> int:
    """Write a log; return the number of key frames not yet reported to `advance`."""
    summary = Summary([log.name])

    def write(writer: Writer) -> None:
        _LogWriter(log, writer, summary).write(advance or (lambda count: None))
        write_json(writer.root / _SUMMARY, summary.as_json())

    assembly.write(log.name, write)
    return summary.samples if advance is None else 0


class _LogWriter:
    """Writes the files and rows of a log."""

    def __init__(self, log: Log, writer: Writer, summary: Summary) -> None:
        self._log, self._writer, self._summary = log, writer, summary
        self._rig: SourceRig = log.rig()
        self._scene = token_of("scene", log.name)
        self._calibration = {
            camera.channel: writer.add_sensor(log.name, camera.channel, camera.ego_from_cam, camera.intrinsic)
            for camera in self._rig.rig
        }
        self._ego_from_lidar = log.ego_from_lidar()
        if self._ego_from_lidar is not None:
            self._calibration[LIDAR] = writer.add_sensor(log.name, LIDAR, self._ego_from_lidar)

    def write(self, advance: Callable[[int], None]) -> None:
        """Write all key frames, the map and the tables of the log.

        Raises:
            DataError: if it has no key frame.
        """
        samples = []
        first_us = 0
        for frame in self._log.frames():
            first_us = first_us or frame.time_us
            samples.append(self._add_frame(frame))
            advance(1)
        if not samples:
            raise DataError(f"{self._log.name}: expected at least one key frame, got none")
        name, token = self._log.name, token_of("log", self._log.name)
        date = datetime.fromtimestamp(first_us / 1e6, UTC).strftime("%Y-%m-%d")
        self._writer.add(
            "log", token, logfile=name, vehicle=self._log.vehicle, date_captured=date, location=self._log.location
        )
        self._writer.add_scene(name, self._log.description, token, samples)
        self._log.write_map(self._writer, token)
        if not self._writer.rows["map"]:
            self._writer.add_no_map(token)
        self._summary.samples = len(samples)
        self._summary.notes += self._log.notes()

    def _add_frame(self, frame: Frame) -> str:
        sample = token_of("sample", self._log.name, frame.time_us)
        self._writer.add("sample", sample, timestamp=frame.time_us, scene_token=self._scene, prev="", next="")
        seen = {image.camera for image in frame.images}
        self._summary.missing.update(name for name in self._rig.names if name not in seen)
        views: dict[str, ViewTargets] = {}
        for image in frame.images:
            if self._add_image(sample, image):
                views |= self._pixel_classes(image)
        if views:
            save_view_targets(view_targets_path(self._writer.root, sample), views)
            self._summary.pixel_classes += len(views)
        points_world = self._add_sweep(sample, frame)
        for box in frame.boxes:
            counted = box if points_world is None else _counted(box, points_world)
            self._writer.add_annotation(self._scene, sample, counted)
        self._summary.boxes += len(frame.boxes)
        if frame.more is not None:
            frame.more(self._writer, sample)
        return sample

    def _add_image(self, sample: str, image: Image) -> bool:
        """Write the images that are cut out of a picture and return True; a damaged one is counted as missing."""
        try:
            data = image.read()
            picture = decoded_image(f"{self._log.name}, {image.camera}", data)
        except DataError as error:
            self._miss(image.camera, error)
            return False
        if (scaled := self._rig.scaling(image.camera, picture.shape[1], picture.shape[0])) is not None:
            self._summary.notes += [scaled] if scaled not in self._summary.notes else []
        for channel, view in self._rig.rectify({image.camera: picture}).items():
            filename = self._file(channel, image.time_us, ".jpg" if view is not picture or is_jpeg(data) else ".png")
            self._write(filename, view, data if view is picture else None)
            self._writer.add_file(
                sample,
                channel,
                self._calibration[channel],
                image.world_from_ego,
                image.time_us,
                filename,
                (view.shape[1], view.shape[0]),
            )
            self._summary.images += 1
        return True

    def _pixel_classes(self, image: Image) -> dict[str, ViewTargets]:
        """Return the pixel classes of the images that are cut out of a picture; damaged ones count as missing."""
        try:
            kinds = image.kinds()
        except DataError as error:
            self._miss(f"{image.camera} pixel classes", error)
            return {}
        cut = {} if kinds is None else self._rig.rectify_classes(image.camera, kinds, UNKNOWN_KIND)
        return {channel: reduce_classes(classes) for channel, classes in cut.items()}

    def _add_sweep(self, sample: str, frame: Frame) -> FloatArray | None:
        """Write a sweep; return its places (N, 3) in the world frame, None if it is missing."""
        sweep = frame.sweep
        if self._ego_from_lidar is None:
            return None
        if sweep is None:
            self._summary.missing[LIDAR] += 1
            return None
        try:
            points = sweep.read()
        except DataError as error:
            self._miss(LIDAR, error)
            return None
        filename = self._file(LIDAR, sweep.time_us, ".pcd.bin")
        write_lidar(self._writer.root / filename, points)
        calibration = self._calibration[LIDAR]
        self._writer.add_file(sample, LIDAR, calibration, sweep.world_from_ego, sweep.time_us, filename)
        self._summary.sweeps += 1
        return apply(sweep.world_from_ego @ self._ego_from_lidar, points[:, :3])

    def _write(self, filename: str, view: ByteArray, data: bytes | None) -> None:
        """Write an image; the file's own bytes if it is used as it is."""
        if data is None:
            write_image(self._writer.root / filename, view)
        else:
            write_bytes(self._writer.root / filename, data)

    def _file(self, channel: str, time_us: int, ending: str) -> str:
        return f"samples/{channel}/{self._log.name}__{channel}__{time_us}{ending}"

    def _miss(self, sensor: str, error: DataError) -> None:
        self._summary.missing[sensor] += 1
        if len(self._summary.damaged) < _DAMAGED:
            self._summary.damaged.append(str(error))


def _counted(box: Annotation, points_world: FloatArray) -> Annotation:
    """Return a box with the number of LiDAR points inside, if its source does not tell it."""
    if box.lidar_points >= 0:
        return box
    half = np.array(box.size_wlh_m)[[1, 0, 2]] / 2
    near = points_world[np.abs(points_world[:, 0] - box.world_from_box[0, 3]) <= np.linalg.norm(half)]
    inside = (np.abs(apply(inverse(box.world_from_box), near)) <= half).all(axis=1)
    return replace(box, lidar_points=int(inside.sum()))
