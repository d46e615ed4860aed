"""Pictures of cameras over time: folders of images, videos, and videos that show all cameras side by side."""

from __future__ import annotations

import glob
import heapq
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from appocc.checks import ByteArray, IntArray
from appocc.errors import DataError
from appocc.files import read_image, read_text
from appocc.own_cameras.times import microseconds, seconds_text, seconds_to_us, time_in_name
from appocc.typing import PathLike

IMAGES = (".jpg", ".jpeg", ".png")
VIDEOS = (".mp4", ".webm", ".avi", ".mkv", ".mov")
_FALLBACK_FPS = 30.0
# Files that a message names.
_SHOWN = 6


class Picture(NamedTuple):
    """A picture of a camera, which may not be read yet.

    Attributes:
        camera: name of the camera.
        time_us: time in microseconds.
        read: returns the (H, W, 3) uint8 RGB image; raises DataError if it is damaged.
        path: file of the picture; None if it has no own file.
    """

    camera: str
    time_us: int
    read: Callable[[], ByteArray]
    path: Path | None = None


@dataclass(frozen=True)
class Clock:
    """Where times come from that no file name tells.

    Attributes:
        fps: pictures per second; None: names are times, and videos have their own.
        start_us: time of the first picture of a video and of frame number 0.
    """

    fps: float | None = None
    start_us: int = 0


@dataclass(frozen=True)
class ImageFiles:
    """The image files of a camera in order of time.

    Attributes:
        camera: name of the camera.
        paths: files.
        times_us: their times, rising.
    """

    camera: str
    paths: tuple[Path, ...]
    times_us: tuple[int, ...]

    @property
    def cameras(self) -> tuple[str, ...]:
        """Name of the camera, as those of a video."""
        return (self.camera,)

    def __iter__(self) -> Iterator[Picture]:
        """Iterate over the pictures; none is read."""
        for path, time_us in zip(self.paths, self.times_us, strict=True):
            yield Picture(self.camera, time_us, partial(read_image, path), path)

    def clock(self, count: int) -> IntArray:
        """Return the times of the first `count` pictures; fewer if there are fewer."""
        return np.array(self.times_us[:count], np.int64)


@dataclass(frozen=True)
class Video:
    """A video of one camera, or of several in rows and columns; one frame at a time is in memory.

    Attributes:
        path: the file.
        cameras: names of the cameras, row by row.
        rows: rows of cameras in each frame.
        columns: columns.
        clock_of: rate and start.
        times_us: time of each frame, from a file; None: from the clock, else the video's own times.
    """

    path: Path
    cameras: tuple[str, ...]
    rows: int = 1
    columns: int = 1
    clock_of: Clock = field(default_factory=Clock)
    times_us: tuple[int, ...] | None = None

    def __iter__(self) -> Iterator[Picture]:
        """Iterate over the pictures, frame by frame.

        Raises:
            DataError: if the video does not open, its frames cannot be divided into the rows and columns, or it has
                other than one time for each frame.
        """
        capture, number = open_video(self.path), 0
        try:
            before = self.clock_of.start_us - 1
            while True:
                done, bgr = capture.read()
                if not done:
                    break
                before = self._time_us(capture, number, before)
                yield from self._tiles(np.asarray(bgr, np.uint8), before)
                number += 1
        finally:
            capture.release()
        if self.times_us is not None and number != len(self.times_us):
            raise DataError(f"{self.path}: expected {len(self.times_us)} frames, as its times, got {number}")
        if not number:
            raise DataError(f"{self.path}: the video has no readable frame")

    def clock(self, count: int) -> IntArray:
        """Return the times of the first `count` frames; of a video with its own times, at its mean rate."""
        if self.times_us is not None:
            return np.array(self.times_us[:count], np.int64)
        capture = open_video(self.path)
        fps = self.clock_of.fps or _rate(capture)
        capture.release()
        return self.clock_of.start_us + np.round(np.arange(count) * 1e6 / fps).astype(np.int64)

    def _time_us(self, capture: cv2.VideoCapture, number: int, before: int) -> int:
        if self.times_us is not None:
            if number >= len(self.times_us):
                raise DataError(f"{self.path}: expected {len(self.times_us)} frames, as its times, got more")
            return self.times_us[number]
        start, fps = self.clock_of.start_us, self.clock_of.fps
        if fps is not None:
            return start + round(number * 1e6 / fps)
        own = start + round(capture.get(cv2.CAP_PROP_POS_MSEC) * 1e3)
        # Some containers have no times, or equal ones.
        return own if own > before else before + round(1e6 / _rate(capture))

    def _tiles(self, bgr: ByteArray, time_us: int) -> Iterator[Picture]:
        rgb = np.ascontiguousarray(bgr[..., ::-1])
        height, width = rgb.shape[:2]
        if height % self.rows or width % self.columns:
            wanted = f"{self.rows} rows and {self.columns} columns of equal size"
            raise DataError(f"{self.path}: expected {wanted}, got frames of {width}x{height} pixels")
        high, wide = height // self.rows, width // self.columns
        for number, camera in enumerate(self.cameras):
            top, left = number // self.columns * high, number % self.columns * wide
            tile = rgb[top : top + high, left : left + wide]
            yield Picture(camera, time_us, partial(np.ascontiguousarray, tile))


Stream = ImageFiles | Video


def open_video(path: Path) -> cv2.VideoCapture:
    """Open a video.

    Raises:
        DataError: if there is no such file, or it is no video that OpenCV reads.
    """
    if not path.is_file():
        raise DataError(f"{path}: no such video")
    capture = cv2.VideoCapture(str(path))
    if not capture.isOpened():
        raise DataError(f"{path}: cannot be opened as a video (expected {', '.join(e[1:] for e in VIDEOS)})")
    return capture


def _rate(capture: cv2.VideoCapture) -> float:
    fps = float(capture.get(cv2.CAP_PROP_FPS))
    return fps if 0.1 <= fps <= 1000 else _FALLBACK_FPS


def find_streams(
    source: PathLike, cameras: Sequence[str], clock: Clock | None = None, mosaic: tuple[int, int] | None = None
) -> list[Stream]:
    """Find the pictures of cameras: a mosaic video, or in a folder for each camera a sub-folder, a video or images.

    Args:
        source: folder with `CAMERA/TIME.jpg`, `TIME/CAMERA.jpg`, `CAMERA_TIME.jpg` or `CAMERA.mp4` (also
            `CAMERA_TIME.mp4`, with the time of its first frame); or a video. A time may be a frame number.
            `CAMERA.txt` may hold the time of each picture or frame, one a line.
        cameras: names of the cameras, in the order of a mosaic.
        clock: rate and start of pictures without times.
        mosaic: rows and columns of a video that shows all cameras; None: not one.

    Raises:
        DataError: if a camera has no pictures, or times are missing or out of order.
    """
    source, clock = Path(source), clock or Clock()
    if mosaic is not None:
        rows, columns = mosaic
        if rows * columns < len(cameras):
            raise DataError(
                f"--mosaic {rows}x{columns}: expected at least {len(cameras)} places, got {rows * columns}"
            )
        open_video(source).release()
        return [Video(source, tuple(cameras), rows, columns, clock)]
    if source.is_file():
        raise DataError(f"{source}: expected a folder; a video of all cameras needs --mosaic ROWSxCOLUMNS")
    if not source.is_dir():
        raise DataError(f"{source}: no such folder")
    return [_find_stream(source, camera, clock) for camera in cameras]


def drive_folders(source: PathLike, cameras: Sequence[str]) -> list[Path]:
    """Return the folders of drives: the source, or those in it if it has no pictures of the cameras itself."""
    source = Path(source)
    if not source.is_dir() or _has_pictures(source, cameras):
        return [source]
    folders = sorted(path for path in source.iterdir() if path.is_dir() and not path.name.startswith("."))
    return [folder for folder in folders if _has_pictures(folder, cameras)] or [source]


def _has_pictures(folder: Path, cameras: Sequence[str]) -> bool:
    """Whether a folder has pictures or a video of one of the cameras."""
    return any((folder / name).is_dir() or _videos(folder, name) or camera_images(folder, name) for name in cameras)


def _videos(folder: Path, camera: str) -> list[Path]:
    """Return the videos of a camera, by name."""
    found = (path for path in folder.iterdir() if path.suffix.lower() in VIDEOS)
    return sorted(path for path in found if _tail(path, camera) is not None)


def _find_stream(source: Path, camera: str, clock: Clock) -> Stream:
    times = _listed_times(source / f"{camera}.txt", clock)
    folder = source / camera if (source / camera).is_dir() else source
    named = _videos(source, camera) if folder == source else []
    if len(named) > 1:
        raise DataError(f"{source}: expected one video of {camera}, got {named[0].name} and {named[1].name}")
    if named:
        tail = _tail(named[0], camera)
        begin = microseconds(tail) if tail else None
        open_video(named[0]).release()
        own = Clock(clock.fps, begin) if begin is not None else clock
        return Video(named[0], (camera,), clock_of=own, times_us=times)
    paths = camera_images(source, camera)
    if not paths and folder == source:
        expected = f"{camera}/, TIME/{camera}.jpg, {camera}_TIME.jpg or {camera}.mp4"
        there = ", ".join(sorted(path.name for path in source.iterdir())[:_SHOWN]) or "nothing"
        raise DataError(f"{source}: no pictures of {camera}: expected {expected}, as its rig names it, got {there}")
    return _image_files(folder, camera, paths, clock, times)


def camera_images(source: Path, camera: str) -> list[Path]:
    """Return the image files of a camera: `CAMERA/*.jpg`, else `CAMERA_TIME.jpg` and `TIME/CAMERA.jpg`."""
    if (source / camera).is_dir():
        paths = list((source / camera).iterdir())
    else:
        paths = [path for path in source.glob(f"{glob.escape(camera)}_*") if _tail(path, camera)]
        paths += source.glob(f"*/{glob.escape(camera)}.*")
    return [path for path in paths if path.suffix.lower() in IMAGES and not path.name.startswith(".")]


def _tail(path: Path, camera: str) -> str | None:
    """Return the number after the camera in a name, '' without one; None for a file of another camera."""
    if path.stem != camera and not path.stem.startswith(f"{camera}_"):
        return None
    rest = path.stem[len(camera) :].lstrip("_")
    return rest if not rest or rest.replace(".", "", 1).isdigit() else None


def _image_files(
    folder: Path, camera: str, paths: Iterable[Path], clock: Clock, times: tuple[int, ...] | None
) -> ImageFiles:
    if times is None:
        timed = sorted((time_of_picture(path, camera, clock), path) for path in paths)
    else:
        ordered = sorted(paths)
        if len(ordered) != len(times):
            raise DataError(
                f"{folder}: expected {len(times)} pictures, as {camera}.txt has times, got {len(ordered)}"
            )
        timed = list(zip(times, ordered, strict=True))
    if not timed:
        raise DataError(f"{folder}: no pictures (expected {', '.join(each[1:] for each in IMAGES)})")
    for (one_us, one), (other_us, other) in pairwise(timed):
        if one_us == other_us:
            raise DataError(f"{folder}: {one.name} and {other.name} have the same time, {seconds_text(one_us)}")
    return ImageFiles(camera, tuple(path for _, path in timed), tuple(time_us for time_us, _ in timed))


def time_of_picture(path: Path, camera: str, clock: Clock) -> int:
    """Return the time of the image file of a camera, from its name, or its folder's if it is named by the camera.

    Raises:
        DataError: as `time_in_name`.
    """
    named = path.parent if path.stem == camera else path.with_suffix("")
    return time_in_name(named, clock.fps, clock.start_us)


def _listed_times(path: Path, clock: Clock) -> tuple[int, ...] | None:
    """Read a file with one time a line; None if there is none."""
    if not path.is_file():
        return None
    times: list[int] = []
    for number, line in enumerate(read_text(path).split("\n"), start=1):
        if not line.strip():
            continue
        try:
            time_us = seconds_to_us(line.strip())
        except ValueError as error:
            raise DataError(f"{path}:{number}: {error}") from error
        if times and time_us <= times[-1]:
            raise DataError(f"{path}:{number}: expected a time after {seconds_text(times[-1])}, got {line.strip()}")
        times.append(time_us)
    return tuple(times)


def in_order_of_time(streams: Iterable[Stream]) -> Iterator[Picture]:
    """Merge the pictures of streams; one picture of each is in memory."""
    return heapq.merge(*streams, key=lambda picture: picture.time_us)
