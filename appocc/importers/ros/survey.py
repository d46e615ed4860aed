"""The first reading of a bag: calibrations, frames, poses, and the times of the pictures and sweeps."""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from appocc.checks import IntArray
from appocc.errors import DataError
from appocc.importers.ros.bag import (
    CAMERA_INFO,
    COMPRESSED,
    IMAGE,
    ODOMETRY,
    POINTS,
    TRANSFORMS,
    Bag,
    Message,
    opened,
)
from appocc.importers.ros.choice import Choice
from appocc.importers.ros.messages import refused
from appocc.importers.ros.transforms import Poses, TransformTree, plain

_STATIC = "tf_static"


class Survey:
    """What one reading of a bag finds.

    Attributes:
        path: the bag.
        kinds: types of the topics of pictures that can be read.
        frames: frame of each topic of pictures and sweeps.
        info: first message of each topic of CameraInfo.
        tree: frames of tf.
        lidar: topic of the sweeps; None without LiDAR.
        odometry: topic of the ego poses; None if there is none, or tf is chosen.
        odometry_frame: frame whose poses they are.
        odometry_poses: the poses.
        refused: topics of pictures that cannot be read, and why.
    """

    def __init__(self, path: Path, choice: Choice) -> None:
        """Read a bag.

        Raises:
            DataError: if it is damaged, or what is chosen is not in it, or must be chosen.
        """
        self.path = path
        self.kinds: dict[str, str] = {}
        self.frames: dict[str, str] = {}
        self.info: dict[str, Any] = {}
        self.tree = TransformTree()
        self.odometry_frame, self.odometry_poses = "", Poses()
        self.refused: dict[str, str] = {}
        self._times: dict[str, array[int]] = {}
        with opened(path) as bag:
            topics = bag.of_type(ODOMETRY)
            by_frame = choice.odometry is not None and choice.odometry not in topics
            self.odometry = None if by_frame else self._one_of(topics, choice.odometry, "--odometry")
            self.lidar = self._one_of(bag.of_type(POINTS), choice.lidar, "--lidar")
            used = [each for each in (self.lidar, self.odometry) if each is not None]
            for message in bag.messages([*bag.of_type(IMAGE, COMPRESSED, CAMERA_INFO, TRANSFORMS), *used]):
                self._take(bag, message)

    def times_ns(self, topic: str) -> IntArray:
        """Return the rising stamps of a topic of pictures or sweeps."""
        return np.unique(np.array(self._times.get(topic, ()), np.int64))

    def _one_of(self, topics: Sequence[str], chosen: str | None, option: str) -> str | None:
        if chosen is None and len(topics) < 2:
            return topics[0] if topics else None
        if chosen is None or chosen not in topics:
            raise DataError(
                f"{self.path}: expected {option}, one of {', '.join(topics) or 'none'}, got {chosen or 'none'}"
            )
        return chosen

    def _take(self, bag: Bag, message: Message) -> None:
        kind, topic = bag.types[message.topic], message.topic
        if kind == TRANSFORMS:
            self.tree.add(bag.decoded(message), topic.endswith(_STATIC))
        elif kind == CAMERA_INFO:
            if topic not in self.info:
                self.info[topic] = bag.decoded(message)
        elif kind == ODOMETRY:
            odometry = bag.decoded(message)
            self.odometry_frame = self.odometry_frame or plain(odometry.child_frame_id)
            self.odometry_poses.add(message.time_ns, odometry.pose.pose.position, odometry.pose.pose.orientation)
        elif topic not in self.refused:
            if topic not in self._times:
                self._meet(topic, kind, bag.decoded(message))
            if topic in self._times:
                self._times[topic].append(message.time_ns)

    def _meet(self, topic: str, kind: str, first: Any) -> None:
        """Take the first picture or sweep of a topic."""
        if kind != POINTS and (reason := refused(first, kind)):
            self.refused[topic] = reason
            return
        self.frames[topic] = plain(first.header.frame_id)
        self._times[topic] = array("q")
        if kind != POINTS:
            self.kinds[topic] = kind
