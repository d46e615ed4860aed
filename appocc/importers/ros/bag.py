"""A ROS 2 bag, message by message: a folder with metadata.yaml, or a single MCAP or sqlite3 file."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from appocc.errors import AppoccError, DataError
from appocc.extras import import_extra

IMAGE = "sensor_msgs/msg/Image"
COMPRESSED = "sensor_msgs/msg/CompressedImage"
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
POINTS = "sensor_msgs/msg/PointCloud2"
ODOMETRY = "nav_msgs/msg/Odometry"
TRANSFORMS = "tf2_msgs/msg/TFMessage"
_REASON_CHARACTERS = 200


class Message(NamedTuple):
    """A recorded message.

    Attributes:
        topic: name of the topic.
        time_ns: stamp of its header, nanoseconds; the time of recording if the header has none, or is stamped 0.
        data: serialized bytes (CDR).
    """

    topic: str
    time_ns: int
    data: bytes


class Bag:
    """An open bag."""

    def __init__(self, path: Path, reader: Any) -> None:
        """Take an open reader of rosbags."""
        self._path, self._reader = path, reader
        self.types: Mapping[str, str] = {
            each.topic: each.msgtype for each in sorted(reader.connections, key=lambda each: str(each.topic))
        }
        self.seconds: float = reader.duration / 1e9

    def of_type(self, *types: str) -> list[str]:
        """Return the topics of some types, in order of name."""
        return [topic for topic, kind in self.types.items() if kind in types]

    def messages(self, topics: Collection[str]) -> Iterator[Message]:
        """Yield the messages of some topics, in order of recording, one in memory at a time.

        Raises:
            DataError: if the bag is damaged.
        """
        wanted = [each for each in self._reader.connections if each.topic in topics]
        if not wanted:
            return
        stream = self._reader.messages(connections=wanted)
        while True:
            with _refusing(self._path):
                found = next(stream, None)
                if found is None:
                    return
                connection, recorded_ns, data = found
                stamped = connection.msgtype != TRANSFORMS
                message = Message(connection.topic, (stamp_ns(data) if stamped else 0) or recorded_ns, bytes(data))
            yield message

    def decoded(self, message: Message) -> Any:
        """Return a message of one of the types above with its fields as attributes.

        Raises:
            DataError: if it is damaged.
        """
        return decoded(f"{self._path}: {message.topic}", message.data, self.types[message.topic])


@contextmanager
def opened(path: Path) -> Iterator[Bag]:
    """Open a bag.

    Raises:
        AppoccError: if rosbags is not installed.
        DataError: if it is damaged, or no ROS 2 bag.
    """
    reader = import_extra("rosbags.rosbag2", "ros", "reading ROS bags").Reader
    with _refusing(path):
        found = reader(path)
        found.open()
        bag = Bag(path, found)
    try:
        yield bag
    finally:
        found.close()


def decoded(where: str, data: bytes, kind: str) -> Any:
    """Return a serialized message of a type with its fields as attributes; `where` names it in errors.

    Raises:
        DataError: if it is damaged.
    """
    with _refusing(where):
        return _types().deserialize_cdr(data, kind)


def stamp_ns(data: bytes) -> int:
    """Return the stamp of a message that begins with a std_msgs/Header.

    Raises:
        ValueError: if it is too short.
    """
    if len(data) < 12:
        raise ValueError(f"a message of {len(data)} bytes has no header")
    order = "little" if data[1] & 1 else "big"
    seconds = int.from_bytes(data[4:8], order, signed=True)  # type: ignore[arg-type]
    return seconds * 1_000_000_000 + int.from_bytes(data[8:12], order)  # type: ignore[arg-type]


@cache
def _types() -> Any:
    """Return ROS 2's own message types, which have not changed since its first release.

    A bag's own definitions are not used: rosbags would generate Python code from a stranger's file.
    """
    types = import_extra("rosbags.typesys", "ros", "reading ROS bags")
    return types.get_typestore(types.Stores.ROS2_HUMBLE)


@contextmanager
def _refusing(where: object) -> Iterator[None]:
    """Raise DataError for whatever a damaged bag makes rosbags raise."""
    try:
        yield
    except AppoccError:
        raise
    except Exception as error:  # rosbags, sqlite, zstd and struct have nearly any error for a damaged file
        reason = " ".join(str(error).split())[:_REASON_CHARACTERS] or type(error).__name__
        raise DataError(f"{where}: expected a ROS 2 bag, got a damaged or another file ({reason})") from error
