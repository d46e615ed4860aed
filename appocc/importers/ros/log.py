"""A bag as a log: its messages are streamed, and become key frames."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path

import numpy as np

from appocc.checks import FloatArray
from appocc.errors import DataError
from appocc.importers.log import Frame, Image, Sweep
from appocc.importers.ros.bag import Message, opened
from appocc.importers.ros.choice import Choice
from appocc.importers.ros.messages import picture, points
from appocc.importers.ros.recording import Recording, read_recording
from appocc.nuscenes.writer import Writer
from appocc.rigs import SourceRig

_FILES = (".mcap", ".db3")
# A key frame waits for its messages until one so many key frames later arrives: only these are in memory.
_MOST_WAITING = 4


@dataclass(frozen=True)
class RosLog:
    """A bag, see `appocc.importers.Log`.

    Attributes:
        path: folder with metadata.yaml, or a file.
        hz: key frames per second.
        choice: topics and frames.
    """

    path: Path
    hz: float
    choice: Choice

    @property
    def name(self) -> str:
        """Name of the folder or file, without its ending."""
        return self.path.stem if self.path.suffix in _FILES else self.path.name

    @property
    def description(self) -> str:
        """Source of the log."""
        return f"ROS 2 bag, {self.name}"

    @property
    def vehicle(self) -> str:
        """Recording platform."""
        return "ros"

    @property
    def location(self) -> str:
        """Bags do not tell their place."""
        return "unknown"

    @property
    def frames_in_total(self) -> int:
        """Number of key frames, from the duration of the bag."""
        with opened(self.path) as bag:
            return int(bag.seconds * self.hz) + 1

    def rig(self) -> SourceRig:
        """Return the cameras."""
        return self._recording.rig

    def ego_from_lidar(self) -> FloatArray | None:
        """Return the pose of the sweeps' frame; None without sweeps."""
        return self._recording.ego_from_lidar

    def frames(self) -> Iterator[Frame]:
        """Yield the key frames; what is recorded very late is missing in its key frame."""
        found = self._recording
        wanted = {
            (topic, time_ns): index
            for topic, times in found.chosen_ns.items()
            for index, time_ns in reversed(list(enumerate(times.tolist())))
            if time_ns >= 0
        }
        left = np.sum([times >= 0 for times in found.chosen_ns.values()], axis=0)
        waiting: dict[int, dict[str, Message]] = {}
        first = 0
        with opened(self.path) as bag:
            for message in bag.messages(list(found.chosen_ns)):
                index = wanted.pop((message.topic, message.time_ns), -1)
                if index < first:
                    continue
                waiting.setdefault(index, {})[message.topic] = message
                left[index] -= 1
                while first < len(left) and (left[first] <= 0 or index - first > _MOST_WAITING):
                    yield from self._frame(first, waiting.pop(first, {}))
                    first += 1
        for index in sorted(waiting):
            yield from self._frame(index, waiting.pop(index))

    def write_map(self, writer: Writer, log: str) -> None:
        """Write nothing: bags have no maps."""

    def notes(self) -> tuple[str, ...]:
        """Return what was found, assumed and left out."""
        return self._recording.notes

    def __getstate__(self) -> dict[str, object]:
        """Leave what was read to the process that needs it."""
        return {name: getattr(self, name) for name in ("path", "hz", "choice")}

    @cached_property
    def _recording(self) -> Recording:
        return read_recording(self.path, self.choice, self.hz)

    def _frame(self, index: int, messages: dict[str, Message]) -> Iterator[Frame]:
        """Yield a key frame with some messages, if there are any."""
        found = self._recording
        sweep, images = None, []
        for topic, message in sorted(messages.items()):
            time_us = message.time_ns // 1000
            pose = found.motion.at(time_us)
            if pose is None:  # beyond the last pose, or in a gap
                continue
            where = f"{self.path}: {topic} at {message.time_ns}"
            if topic == found.lidar:
                sweep = Sweep(time_us, pose, partial(points, where, message.data))
            else:
                name = next(name for name, each in found.topics.items() if each == topic)
                images.append(Image(name, time_us, pose, partial(picture, where, message.data, found.kinds[topic])))
        if images or sweep is not None:
            yield Frame(int(found.key_times_ns[index]) // 1000, tuple(images), sweep)


def find_logs(src: Path, hz: float, choice: Choice) -> list[RosLog]:
    """Return the bags of a folder, in order of name: folders with metadata.yaml, and MCAP and sqlite3 files.

    Raises:
        DataError: if there is none.
    """
    if src.is_file() and src.suffix in _FILES:
        return [RosLog(src, hz, choice)]
    folders = sorted(path.parent for depth in ("", "*/", "*/*/") for path in src.glob(f"{depth}metadata.yaml"))
    files = [path for ending in _FILES for path in src.glob(f"*{ending}") if src not in folders]
    if found := sorted([*folders, *files]):
        return [RosLog(path, hz, choice) for path in found]
    if src.suffix == ".bag" or any(src.glob("*.bag")):
        raise DataError(
            f"{src}: expected a ROS 2 bag, got one of ROS 1: rosbags-convert --src OLD --dst NEW converts it"
        )
    raise DataError(f"{src}: expected a ROS 2 bag (a folder with metadata.yaml, .mcap or .db3), got none")
