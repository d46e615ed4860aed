"""Frames of cameras as their pictures come: from devices, from a folder that is written to, or from videos."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from threading import Condition, Thread

import cv2
import numpy as np

from appocc.checks import ByteArray
from appocc.errors import DataError
from appocc.files import read_image
from appocc.frame import Frame
from appocc.geometry import inverse
from appocc.own_cameras.moments import Moment, MomentGrouper
from appocc.own_cameras.pictures import Clock, Picture, camera_images, time_of_picture
from appocc.rigs.source_rig import SourceRig
from appocc.trajectory import Motion, Straight
from appocc.typing import PathLike


class LiveFrames:
    """Frames of a rig, from pictures as they come; iterate over them.

    A frame has the pictures of one moment, see `MomentGrouper`; a camera without one is missing. Frames are in order
    of time. Skipped, and counted, are single pictures ("late", "out of order", "spare", "damaged") and whole frames
    ("too soon" for `hz`, "no pose", "empty" without a readable picture).

    Example:
        >>> for frame in LiveFrames(CameraDevices({"front": 0, "back": 1}), rig):
        >>>     bev = predictor(frame).bev
    """

    def __init__(
        self,
        source: Iterable[Picture],
        rig: SourceRig,
        motion: Motion | None = None,
        *,
        tolerance_s: float = 0.05,
        patience_s: float = 0.2,
        hz: float | None = None,
    ) -> None:
        """Prepare; nothing is read before the iteration.

        Args:
            source: pictures by the names of the rig's cameras, such as `CameraDevices` or `WatchedFolder`.
            rig: the cameras.
            motion: ego poses; None: standing.
            tolerance_s: longest time between the first and the last picture of a frame; less than the time between
                two pictures of a camera, or pictures are spare.
            patience_s: how much later a picture may arrive than those of other cameras of the same time.
            hz: most frames per second; None: all.
        """
        self._source, self._rig, self._motion, self._hz = source, rig, motion, hz
        self._grouper = MomentGrouper(rig.names, round(tolerance_s * 1e6), round(patience_s * 1e6))
        self._skipped: Counter[str] = Counter()

    @property
    def skipped(self) -> Mapping[str, int]:
        """Numbers of skipped pictures and frames by reason."""
        return self._grouper.skipped + self._skipped

    def __iter__(self) -> Iterator[Frame]:
        """Iterate over the frames.

        Raises:
            DataError: if a picture has another aspect than its camera.
        """
        due_us: int | None = None
        for moment in self._moments():
            if due_us is not None and moment.time_us < due_us:
                self._skipped["too soon"] += 1
                continue
            frame = self._frame(moment)
            if frame is not None:
                due_us = None if self._hz is None else moment.time_us + round(1e6 / self._hz)
                yield frame

    def _moments(self) -> Iterator[Moment]:
        for picture in self._source:
            yield from self._grouper.add(picture)
        yield from self._grouper.rest()

    def _frame(self, moment: Moment) -> Frame | None:
        """Return the frame of a moment; None if its pose is unknown or no picture can be read."""
        motion = self._motion or Straight(0.0, moment.time_us)
        world_from_ego = motion.at(moment.time_us)
        if world_from_ego is None:
            self._skipped["no pose"] += 1
            return None
        images: dict[str, ByteArray] = {}
        cameras = {camera.channel: camera for camera in self._rig.rig}
        for name, picture in moment.pictures.items():
            pose = motion.at(picture.time_us)
            image = None if pose is None else self._image(picture)
            if pose is None or image is None:
                continue
            views = self._rig.rectify({name: image})
            images |= views
            # Cameras that did not move stay the same: the predictor keeps what it has computed for them.
            if not np.array_equal(pose, world_from_ego):
                shift = inverse(world_from_ego) @ pose
                for camera in (cameras[channel] for channel in views):
                    cameras[camera.channel] = replace(camera, ego_from_cam=shift @ camera.ego_from_cam)
        if not images:
            self._skipped["empty"] += 1
            return None
        rig = self._rig.rig.with_cameras(cameras.values())
        return Frame(str(moment.time_us), moment.time_us, world_from_ego, rig, images)

    def _image(self, picture: Picture) -> ByteArray | None:
        try:
            return picture.read()
        except DataError:
            self._skipped["damaged"] += 1
            return None


class WatchedFolder:
    """Pictures of a folder that is written to: `CAMERA/TIME.jpg`, `CAMERA_TIME.jpg` or `TIME/CAMERA.jpg`.

    A file is taken when its size stays the same between two looks at the folder. Files that are there at the
    beginning are taken first.
    """

    def __init__(
        self,
        folder: PathLike,
        cameras: Sequence[str],
        clock: Clock | None = None,
        *,
        poll_s: float = 0.05,
        idle_s: float | None = None,
    ) -> None:
        """Prepare.

        Args:
            folder: the folder.
            cameras: names of the cameras.
            clock: rate and start of names that count frames.
            poll_s: time between two looks.
            idle_s: end after this time without a new picture; None: never.

        Raises:
            DataError: if there is no such folder.
        """
        folder = Path(folder)
        if not folder.is_dir():
            raise DataError(f"{folder}: no such folder")
        self._folder, self._cameras, self._clock = folder, tuple(cameras), clock or Clock()
        self._poll_s, self._idle_s = poll_s, idle_s
        self._sizes: dict[Path, int] = {}
        self._taken: set[Path] = set()

    def __iter__(self) -> Iterator[Picture]:
        """Iterate over the pictures as they come; those of one look are in order of time.

        Raises:
            DataError: if a name has no time.
        """
        last_s = time.monotonic()
        while True:
            for picture in sorted(self._look(), key=lambda each: each.time_us):
                yield picture
                last_s = time.monotonic()
            if self._idle_s is not None and time.monotonic() - last_s > self._idle_s:
                return
            time.sleep(self._poll_s)

    def _look(self) -> list[Picture]:
        """Return the pictures whose files are complete and were not taken yet."""
        found, sizes = [], {}
        present = dict(self._files())
        self._taken &= present.keys()
        for path, camera in present.items():
            if path in self._taken:
                continue
            try:
                size = path.stat().st_size
            except FileNotFoundError:
                continue
            if size and self._sizes.get(path) == size:
                self._taken.add(path)
                time_us = time_of_picture(path, camera, self._clock)
                found.append(Picture(camera, time_us, partial(read_image, path), path))
            else:
                sizes[path] = size
        self._sizes = sizes
        return found

    def _files(self) -> Iterator[tuple[Path, str]]:
        for camera in self._cameras:
            for path in camera_images(self._folder, camera):
                yield path, camera


class CameraDevices:
    """Pictures of cameras of this computer, each read by its own thread; times are those of their arrival.

    A reader that is slower than the cameras gets the newest picture of each: older ones are dropped. A device that
    ends or is unplugged is missing from then on; the iteration ends with the last one.

    Attributes:
        dropped: number of pictures that were replaced by newer ones, by camera.
    """

    def __init__(self, devices: Mapping[str, int | str], now: Callable[[], float] = time.time) -> None:
        """Prepare; the devices are opened by the iteration.

        Args:
            devices: number of the device, or address or file of a stream, by name of camera.
            now: clock, seconds since 1970.
        """
        self._devices, self._now = dict(devices), now
        self.dropped: Counter[str] = Counter()

    def __iter__(self) -> Iterator[Picture]:
        """Open the devices and iterate over their pictures; the devices are closed at the end.

        Raises:
            DataError: if a device does not open.
        """
        captures: dict[str, cv2.VideoCapture] = {}
        try:
            for camera, device in self._devices.items():
                captures[camera] = cv2.VideoCapture(device)
                if not captures[camera].isOpened():
                    raise DataError(f"{camera}: the device {device} cannot be opened")
            yield from self._read(captures)
        finally:
            for capture in captures.values():
                capture.release()

    def _read(self, captures: Mapping[str, cv2.VideoCapture]) -> Iterator[Picture]:
        """Read all captures in threads until they end, or the caller stops."""
        changed, newest = Condition(), dict[str, Picture]()
        reading = set(captures)

        def read(camera: str) -> None:
            while camera in reading:
                done, bgr = captures[camera].read()
                with changed:
                    if done and camera in reading:
                        picture = _device_picture(camera, self._now(), np.asarray(bgr, np.uint8))
                        self.dropped[camera] += camera in newest
                        newest[camera] = picture
                    else:
                        reading.discard(camera)
                    changed.notify()

        threads = [Thread(target=read, args=(camera,), daemon=True) for camera in captures]
        for thread in threads:
            thread.start()
        try:
            while True:
                with changed:
                    changed.wait_for(lambda: newest or not reading)
                    pictures = sorted(newest.values(), key=lambda each: each.time_us)
                    newest.clear()
                if not pictures:
                    return
                yield from pictures
        finally:
            with changed:
                reading.clear()
            for thread in threads:
                thread.join()


def _device_picture(camera: str, now_s: float, bgr: ByteArray) -> Picture:
    return Picture(camera, round(now_s * 1e6), lambda: np.ascontiguousarray(bgr[..., ::-1]))
