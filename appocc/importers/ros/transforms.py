"""The tree of coordinate frames of tf and tf_static."""

from __future__ import annotations

from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property, reduce
from typing import Any

import numpy as np

from appocc.checks import FloatArray
from appocc.geometry import inverse, rotation_from_quaternion
from appocc.trajectory import Trajectory

# Transforms of a frame closer together are left out: an hour of 50 a second takes 12 MB.
_STEP_NS = 20_000_000
# Poses are known up to this before their first and after their last time.
_BEYOND_US = 100_000
_ROW = 8
# A frame that moves less than this on its parent is fixed.
_MOVED = 0.02


class Poses:
    """Poses over time, as they come: translations and quaternions."""

    def __init__(self) -> None:
        """Start without poses."""
        self._values = array("d")
        self._latest_ns = -(1 << 62)

    def add(self, time_ns: int, place: Any, turn: Any) -> bool:
        """Add a pose, given a message's vector and quaternion; return whether it is one: finite, a rotation."""
        row = (place.x, place.y, place.z, turn.w, turn.x, turn.y, turn.z)
        length = float(np.linalg.norm(row[3:]))
        if not np.isfinite(row).all() or not 0.5 < length < 2:
            return False
        if abs(time_ns - self._latest_ns) >= _STEP_NS:
            self._values.extend((time_ns // 1000, *row))
            self._latest_ns = time_ns
        return True

    def __len__(self) -> int:
        """Return the number of poses."""
        return len(self._values) // _ROW

    @cached_property
    def trajectory(self) -> Trajectory:
        """The poses in order of time; of several at the same time the first."""
        rows = np.array(self._values).reshape(-1, _ROW)
        times, first = np.unique(rows[:, 0].astype(np.int64), return_index=True)
        poses = np.tile(np.eye(4), (len(times), 1, 1))
        poses[:, :3, :3] = rotation_from_quaternion(rows[first, 4:])
        poses[:, :3, 3] = rows[first, 1:4]
        return Trajectory(times, poses)


@dataclass
class Edge:
    """Where a frame is on its parent.

    Attributes:
        parent: the parent frame.
        is_static: whether it is published once, for all times.
        poses: parent_from_child over time.
    """

    parent: str
    is_static: bool
    poses: Poses = field(default_factory=Poses)

    @property
    def fixed(self) -> FloatArray:
        """The (4, 4) parent_from_child at the first time."""
        return np.array(self.poses.trajectory.world_from_ego[0])

    @property
    def moves(self) -> bool:
        """Whether the pose changes by more than 2 cm or about a degree."""
        poses = self.poses.trajectory.world_from_ego
        return not self.is_static and bool(np.abs(poses - poses[0])[:, :3].max() > _MOVED)

    def at(self, time_us: int) -> FloatArray | None:
        """Return parent_from_child at a time; None if it is unknown."""
        return self.fixed if self.is_static else pose_at(self.poses.trajectory, time_us)


class TransformTree:
    """Frames, each with one parent; the first parent told."""

    def __init__(self) -> None:
        """Start without frames."""
        self._edges: dict[str, Edge] = {}
        self.conflicts: dict[str, str] = {}

    def add(self, message: Any, is_static: bool) -> None:
        """Add the transforms of a TFMessage."""
        for each in message.transforms:
            parent, child = plain(each.header.frame_id), plain(each.child_frame_id)
            if not parent or not child or parent == child:
                continue
            edge = self._edges.get(child) or Edge(parent, is_static)
            if edge.parent != parent:
                self.conflicts.setdefault(child, parent)
                continue
            stamp = each.header.stamp.sec * 1_000_000_000 + each.header.stamp.nanosec
            if edge.poses.add(stamp, each.transform.translation, each.transform.rotation):
                self._edges[child] = edge

    @property
    def frames(self) -> list[str]:
        """All frames, in order of name."""
        return sorted({*self._edges, *(edge.parent for edge in self._edges.values())})

    def ancestors(self, frame: str) -> list[str]:
        """Return a frame, its parent, and so on to the root."""
        found = [frame]
        while (edge := self._edges.get(found[-1])) is not None and edge.parent not in found:
            found.append(edge.parent)
        return found

    def fixed(self, target: str, source: str) -> tuple[FloatArray, list[str]] | None:
        """Return the (4, 4) pose of a frame in another one at the first time, and the frames between that move.

        Returns:
            None if they are not in one tree.
        """
        up, down = self.ancestors(target), self.ancestors(source)
        common = next((frame for frame in up if frame in down), None)
        if common is None:
            return None
        below = [up[: up.index(common)], down[: down.index(common)]]
        target_from_common, common_from_source = inverse(self._product(below[0])), self._product(below[1])
        moving = [frame for frames in below for frame in frames if self._edges[frame].moves]
        return target_from_common @ common_from_source, moving

    def motion(self, fixed: str, base: str) -> TreeMotion:
        """Return the motion of a frame in one of its ancestors."""
        frames = self.ancestors(base)
        return TreeMotion([self._edges[frame] for frame in reversed(frames[: frames.index(fixed)])])

    def _product(self, frames: Sequence[str]) -> FloatArray:
        pose = np.eye(4)
        for frame in reversed(frames):
            pose = pose @ self._edges[frame].fixed
        return pose


@dataclass(frozen=True, eq=False)
class TreeMotion:
    """Motion along a chain of frames, from the fixed one down.

    Attributes:
        edges: the edges.
    """

    edges: Sequence[Edge]

    def at(self, time_us: int) -> FloatArray | None:
        """Return the (4, 4) pose of the last frame in the first one at a time; None if it is unknown."""
        poses = list(self._poses(time_us))
        return None if len(poses) < len(self.edges) else reduce(np.matmul, poses, np.eye(4))

    def _poses(self, time_us: int) -> Iterator[FloatArray]:
        for edge in self.edges:
            if (pose := edge.at(time_us)) is None:
                return
            yield pose


def pose_at(trajectory: Trajectory, time_us: int) -> FloatArray | None:
    """Return a pose at a time, as `Trajectory.at`, or up to 0.1 s outside of the times the nearest one."""
    first, last = trajectory.times_us[[0, -1]].tolist()
    if first - _BEYOND_US <= time_us <= last + _BEYOND_US:
        return trajectory.at(min(max(time_us, first), last))
    return None


def plain(frame: str) -> str:
    """Return the name of a frame as tf2 has it: without a leading slash."""
    return frame.lstrip("/")
