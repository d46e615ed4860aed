"""Conversion of recordings of one's own cameras to the nuScenes schema: a scene each, streamed and resumable."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

from appocc.checks import ByteArray, FloatArray
from appocc.errors import DataError, NotFoundError
from appocc.files import read_file, read_json, write_bytes, write_image, write_json
from appocc.nuscenes.assembly import Assembly, resolved
from appocc.nuscenes.writer import Writer, token_of
from appocc.own_cameras.moments import Moment, key_moments, moments_of
from appocc.own_cameras.pictures import Picture, Stream, in_order_of_time
from appocc.own_cameras.pose_files import read_trajectory
from appocc.own_cameras.times import seconds_text
from appocc.rigs.source_rig import SourceRig
from appocc.trajectory import Motion, Straight, Trajectory
from appocc.version import __version__
from appocc.workers import Engine, in_order

VERSION = "v1.0-own"
_RECORD, _SUMMARY = "import.json", ".summary.json"
_JPEG = (".jpg", ".jpeg")


@dataclass(frozen=True, eq=False)
class Drive:
    """A recording that becomes a scene.

    Attributes:
        name: name of the scene.
        streams: pictures of the cameras.
        trajectory: ego poses; None: straight ahead at the speed of the conversion.
    """

    name: str
    streams: Sequence[Stream]
    trajectory: Trajectory | None = None


@dataclass
class Summary:
    """Counts of a conversion.

    Attributes:
        scene: name of the scene.
        samples: number of key frames.
        images: number of images.
        missing: camera -> in how many key frames it is missing, and the first reason.
        left_out: reason -> number of key frames that were left out.
        notes: further lines for people.
    """

    scene: str
    samples: int = 0
    images: int = 0
    missing: dict[str, tuple[int, str]] = field(default_factory=dict)
    left_out: Counter[str] = field(default_factory=Counter)
    notes: list[str] = field(default_factory=list)

    def as_json(self) -> dict[str, Any]:
        """Return JSON values."""
        missing = {camera: {"frames": count, "reason": why} for camera, (count, why) in self.missing.items()}
        return {**vars(self), "missing": missing, "left_out": dict(self.left_out)}

    @classmethod
    def of_json(cls, values: Mapping[str, Any]) -> Summary:
        """Return the summary with these JSON values."""
        missing = {camera: (one["frames"], one["reason"]) for camera, one in values["missing"].items()}
        return cls(**{**values, "missing": missing, "left_out": Counter(values["left_out"])})


def ego_trajectory(path: Path, streams: Sequence[Stream], rig: SourceRig, camera: str | None) -> Trajectory:
    """Read the poses of a recording as poses of the ego frame.

    Args:
        path: file of poses, see `read_trajectory`; rows without times belong to the pictures of `camera`, else
            of the first.
        streams: pictures of the recording.
        rig: the cameras.
        camera: name of the camera whose poses they are; None: the ego frame's.

    Raises:
        DataError: if the file is damaged, or the poses are not those of an upright vehicle that drives ahead.
        NotFoundError: if there is no such camera.
    """
    own = next((each for each in streams if camera in each.cameras), streams[0])
    found = read_trajectory(path, own.clock)
    if camera is None:
        found.check_upright(str(path))
        found.check_ahead(str(path))
        return found
    for each in rig.cameras:
        if each.name == camera:
            ego = found.of_ego(each.ego_from_cam)
            ego.check_ahead(f"{path} of {camera}")
            return ego
    raise NotFoundError(f"--poses-of: the rig has no camera '{camera}'; it has {', '.join(rig.names)}")


def convert_drives(
    drives: Sequence[Drive],
    rig: SourceRig,
    out: Path,
    settings: Mapping[str, Any],
    *,
    speed_mps: float = 0.0,
    hz: float = 2.0,
    tolerance_us: int = 50_000,
    advance: Callable[[int], None] = lambda count: None,
    pool: Engine | None = None,
) -> list[Summary]:
    """Convert recordings to a new dataset `out`, a scene each; one key frame is in memory, of each worker.

    The same call resumes an interrupted one: finished scenes are kept. Pictures between key frames are not copied. In
    a key frame, a camera without a picture within the tolerance, or with a damaged one, is missing.

    Args:
        drives: the recordings.
        rig: the cameras.
        out: new folder.
        settings: further JSON values that determine the result, such as the folder of the recordings.
        speed_mps: speed of drives without a trajectory.
        hz: key frames per second, if there are as many pictures.
        tolerance_us: longest time between the first and the last picture of a key frame.
        advance: progress callback, in key frames.
        pool: where drives are converted, one by a worker; the result does not depend on it.

    Raises:
        DataError: if a picture has another aspect than its camera, no key frame of a drive has a pose, or `out`
            cannot be written.
    """
    names = [drive.name for drive in drives]
    own = {"speed_mps": speed_mps, "hz": hz, "tolerance_us": tolerance_us, "rig": rig.as_json(), "scenes": names}
    known = {"appocc": __version__, "importer": "own", **settings, **own}
    assembly = Assembly(resolved(out), VERSION, _RECORD, known, "conversion")
    if assembly.is_finished():
        raise DataError(f"{out}: holds this conversion already")
    with assembly.opened():
        job = _DriveWriter(assembly, rig, speed_mps, hz, tolerance_us, None if pool else advance)
        for count in in_order(pool, job, [drive for drive in drives if not assembly.has(drive.name)]):
            advance(count)
        summaries = [Summary.of_json(read_json(assembly.place(name) / _SUMMARY)) for name in names]
        assembly.finish(names)
    return summaries


@dataclass(frozen=True, eq=False)
class _DriveWriter:
    """The job of a worker: write the files, tables and summary of a drive; see `convert_drives`.

    `advance` is None in another process: the job then returns the number of key frames, else 0.
    """

    assembly: Assembly
    rig: SourceRig
    speed_mps: float
    hz: float
    tolerance_us: int
    advance: Callable[[int], None] | None

    def __call__(self, drive: Drive) -> int:
        """Write a drive.

        Raises:
            DataError: as `convert_drives` does.
        """
        counts: list[int] = []
        self.assembly.write(drive.name, partial(self._write, drive, self.advance or counts.append))
        return sum(counts)

    def _write(self, drive: Drive, advance: Callable[[int], None], writer: Writer) -> None:
        tolerance_us = min(self.tolerance_us, round(5e5 / self.hz))
        scene = _SceneWriter(writer, self.rig, drive.name)
        motion: Motion | None = drive.trajectory
        first_us = last_us = None
        pictures = moments_of(in_order_of_time(drive.streams), self.rig.names, tolerance_us)
        for moment in key_moments(pictures, self.hz):
            first_us = moment.time_us if first_us is None else first_us
            last_us = moment.time_us
            motion = motion or Straight(self.speed_mps, moment.time_us)
            scene.add(moment, motion)
            advance(1)
        if not scene.samples:
            raise DataError(_why_empty(drive.name, first_us, last_us, drive.trajectory, scene.summary))
        scene.add_tables()
        if drive.trajectory is not None and drive.trajectory.note:
            scene.summary.notes.append(drive.trajectory.note)
        write_json(writer.root / _SUMMARY, scene.summary.as_json())


def _why_empty(
    name: str, first_us: int | None, last_us: int | None, trajectory: Trajectory | None, summary: Summary
) -> str:
    if first_us is None or last_us is None:
        return f"{name}: no pictures"
    if trajectory is not None and summary.left_out["no pose"]:
        poses = f"{seconds_text(int(trajectory.times_us[0]))} to {seconds_text(int(trajectory.times_us[-1]))}"
        pictures = f"{seconds_text(first_us)} to {seconds_text(last_us)}"
        hint = "; tell the time of the first picture with --start" if first_us < 1e14 < trajectory.times_us[0] else ""
        return f"{name}: the poses do not cover the pictures: poses from {poses}, pictures from {pictures}{hint}"
    why = next(iter(summary.missing.values()), (0, "no pictures"))[1]
    return f"{name}: no key frame has a readable picture ({why})"


class _SceneWriter:
    """Writes the key frames of one scene."""

    def __init__(self, writer: Writer, rig: SourceRig, name: str) -> None:
        self.summary = Summary(name)
        self.samples: list[str] = []
        self._writer, self._rig, self._name = writer, rig, name
        self._calibration = {
            camera.channel: writer.add_sensor(name, camera.channel, camera.ego_from_cam, camera.intrinsic)
            for camera in rig.rig
        }

    def add(self, moment: Moment, motion: Motion) -> None:
        """Write a key frame; leave it out if its pose is unknown or it has no readable picture."""
        if motion.at(moment.time_us) is None:
            self.summary.left_out["no pose"] += 1
            return
        sample = token_of("sample", self._name, moment.time_us)
        written = 0
        for camera in self._rig.names:
            picture = moment.pictures.get(camera)
            pose = None if picture is None else motion.at(picture.time_us)
            if picture is None or pose is None:
                self._count_missing(camera, "no picture at this time" if picture is None else "no pose at its time")
                continue
            written += self._add_picture(sample, picture, pose)
        if not written:
            self.summary.left_out["no readable picture"] += 1
            return
        self.summary.images += written
        self.summary.samples += 1
        row = {"timestamp": moment.time_us, "scene_token": token_of("scene", self._name), "prev": "", "next": ""}
        self.samples.append(self._writer.add("sample", sample, **row))

    def add_tables(self) -> None:
        """Add the rows of the scene and its log."""
        first_us = self._writer.rows["sample"][0]["timestamp"]
        date = datetime.fromtimestamp(first_us / 1e6, UTC).strftime("%Y-%m-%d")
        log = token_of("log", self._name)
        self._writer.add("log", log, logfile=self._name, vehicle="own", date_captured=date, location="unknown")
        self._writer.add_no_map(log)
        self._writer.add_scene(self._name, f"{self._name}: own cameras", log, self.samples)

    def _add_picture(self, sample: str, picture: Picture, world_from_ego: FloatArray) -> int:
        """Write the images that are cut out of a picture; return their number, 0 if it is damaged."""
        try:
            image = picture.read()
        except DataError as error:
            self._count_missing(picture.camera, str(error))
            return 0
        try:
            scaled = self._rig.scaling(picture.camera, image.shape[1], image.shape[0])
        except DataError as error:
            raise DataError(f"{picture.path}: {error}" if picture.path else str(error)) from error
        if scaled and scaled not in self.summary.notes:
            self.summary.notes.append(scaled)
        views = self._rig.rectify({picture.camera: image})
        for channel, view in views.items():
            filename = f"samples/{channel}/{self._name}__{channel}__{picture.time_us}.jpg"
            self._write(filename, view, picture.path if view is image else None)
            self._writer.add_file(
                sample=sample,
                channel=channel,
                calibration=self._calibration[channel],
                world_from_ego=world_from_ego,
                timestamp_us=picture.time_us,
                filename=filename,
                size_px=(view.shape[1], view.shape[0]),
            )
        return len(views)

    def _write(self, filename: str, image: ByteArray, source: Path | None) -> None:
        """Write an image; a JPEG file that is used as it is stays the same bytes."""
        if source is not None and source.suffix.lower() in _JPEG:
            write_bytes(self._writer.root / filename, read_file(source))
        else:
            write_image(self._writer.root / filename, image)

    def _count_missing(self, camera: str, reason: str) -> None:
        count, first = self.summary.missing.get(camera, (0, reason))
        self.summary.missing[camera] = (count + 1, first)
