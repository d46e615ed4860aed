"""A bag as a vehicle: cameras and LiDAR in the ego frame, ego poses, and which message belongs to which key frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from appocc.checks import FloatArray, IntArray
from appocc.ego_vehicle import EgoVehicle
from appocc.errors import DataError
from appocc.geometry import inverse, transform
from appocc.importers.log import key_indices
from appocc.importers.ros.cameras import is_calibrated, mounted_camera
from appocc.importers.ros.choice import Choice
from appocc.importers.ros.survey import Survey
from appocc.importers.ros.topics import CameraTopics, pair_cameras
from appocc.importers.ros.transforms import plain, pose_at
from appocc.rigs import SourceRig
from appocc.rigs.cutting import cut_rig
from appocc.rigs.source_camera import SourceCamera
from appocc.trajectory import Motion, Straight, Trajectory

_BASES = ("base_link", "base_footprint")
_FIXED = ("map", "odom")
# The picture of a key frame is at most this far from its time, and at most half the interval of key frames.
_FARTHEST_NS = 100_000_000
_NAMED = 8


@dataclass(frozen=True, eq=False)
class Recording:
    """A bag as a vehicle.

    Attributes:
        rig: cameras by name.
        topics: topic of each camera's pictures.
        kinds: type of each topic.
        lidar: topic of the sweeps, if there are any.
        ego_from_lidar: (4, 4) pose of their frame.
        motion: ego poses.
        key_times_ns: (N,) times of the key frames that have a pose.
        chosen_ns: for each topic, (N,) stamps of the messages of the key frames; -1 for none.
        notes: lines for people.
    """

    rig: SourceRig
    topics: Mapping[str, str]
    kinds: Mapping[str, str]
    lidar: str | None
    ego_from_lidar: FloatArray | None
    motion: Motion
    key_times_ns: IntArray
    chosen_ns: Mapping[str, IntArray]
    notes: tuple[str, ...]


def read_recording(path: Path, choice: Choice, hz: float) -> Recording:
    """Read all of a bag but its pictures and sweeps.

    Raises:
        DataError: if the bag is damaged, lacks what is needed, or leaves a choice.
    """
    found = Survey(path, choice)
    base = _base_frame(found, choice)
    ego_from_base = transform(np.eye(3), [0.0, 0.0, choice.height_m])
    notes = [
        f"the ego frame is {base}, taken to be {choice.height_m:g} m above the road, at the rear axle (--height)"
    ]
    rig, topics = _rig(found, choice, base, ego_from_base, notes)
    pose = None if found.lidar not in found.frames else found.tree.fixed(base, found.frames[found.lidar])
    lidar = found.lidar if pose is not None else None
    if found.lidar in found.frames and lidar is None:
        notes.append(f"left out, without a transform to {base}: {found.lidar}")
    motion = _motion(found, choice, base, inverse(ego_from_base), notes)
    reference = lidar or max(topics.values(), key=lambda topic: len(found.times_ns(topic)))
    times = found.times_ns(reference)
    times = times[key_indices(times // 1000, hz)]
    poses = [motion.at(int(time) // 1000) for time in times]
    keys = times[[each is not None for each in poses]]
    if not len(keys):
        raise DataError(f"{path}: expected poses at the times of {reference}, got none")
    if len(keys) < len(times):
        notes.append(f"{path.name}: left out, without a pose: {len(times) - len(keys)} of {len(times)} key frames")
    if next(each for each in poses if each is not None)[2, 2] < np.cos(np.pi / 4):
        raise DataError(f"{path}: expected poses in a fixed frame with z up, got others (--odometry)")
    most_ns = min(_FARTHEST_NS, round(0.5e9 / hz))
    used = [*topics.values(), *([lidar] if lidar else [])]
    return Recording(
        rig=rig,
        topics=topics,
        kinds=found.kinds,
        lidar=lidar,
        ego_from_lidar=None if pose is None else ego_from_base @ pose[0],
        motion=motion,
        key_times_ns=keys,
        chosen_ns={topic: nearest_times(found.times_ns(topic), keys, most_ns) for topic in used},
        notes=(*notes, *_remarks(found, lidar)),
    )


def nearest_times(times: IntArray, wanted: IntArray, most: int) -> IntArray:
    """Return the nearest of rising times (M,) to each wanted time (N,); -1 where none is within `most`."""
    if not len(times):
        return np.full(len(wanted), -1, np.int64)
    after = np.clip(np.searchsorted(times, wanted), 1, max(len(times) - 1, 1))
    sides = np.stack([times[after - 1], times[np.minimum(after, len(times) - 1)]])
    near = np.take_along_axis(sides, np.abs(sides - wanted).argmin(axis=0)[None], axis=0)[0]
    return np.where(np.abs(near - wanted) <= most, near, -1)


def _base_frame(found: Survey, choice: Choice) -> str:
    frames = found.tree.frames
    known = [each for each in (*_BASES, found.odometry_frame) if each in frames]
    base = plain(choice.base_frame) if choice.base_frame else (known[0] if known else "")
    if base not in frames:
        listed = ", ".join(frames[:30]) or "none: the bag has no transforms in tf or tf_static"
        raise DataError(f"{found.path}: expected --base-frame, one of {listed}; got {base or 'none'}")
    return base


def _rig(
    found: Survey, choice: Choice, base: str, ego_from_base: FloatArray, notes: list[str]
) -> tuple[SourceRig, dict[str, str]]:
    """Return the cameras and the topics of their pictures."""
    infos = {topic: plain(info.header.frame_id) for topic, info in found.info.items()}
    pairs, lacking = pair_cameras(found.kinds, found.frames, infos)
    if unknown := [name for name in choice.cameras if name not in [each.name for each in pairs]]:
        names = ", ".join(each.name for each in pairs) or "none"
        raise DataError(f"{found.path}: expected --camera, one of {names}, got {unknown[0]}")
    notes += [f"left out, without CameraInfo: {', '.join(lacking[:_NAMED])}"] if lacking else []
    cameras = []
    topics: dict[str, str] = {}
    for each in pairs:
        if choice.cameras and each.name not in choice.cameras:
            continue
        placed = found.tree.fixed(base, found.frames[each.pictures]) or found.tree.fixed(base, infos[each.info])
        if placed is None or not is_calibrated(found.info[each.info]):
            reason = "with K = 0" if placed else f"without a transform to {base}"
            notes.append(f"left out, {reason}: {each.pictures}")
            continue
        camera, remark = _camera(found, each, ego_from_base @ placed[0], placed[1])
        notes += remark
        cameras.append(camera)
        topics[each.name] = each.pictures
    if not cameras:
        raise DataError(
            f"{found.path}: expected pictures with CameraInfo and a transform to {base}, got none"
            + "".join(f"; {note}" for note in notes[1:])
        )
    notes.append("cameras: " + ", ".join(f"{name} ({topic})" for name, topic in topics.items()))
    return cut_rig(tuple(cameras), EgoVehicle()), topics


def _camera(
    found: Survey, each: CameraTopics, ego_from_frame: FloatArray, moving: list[str]
) -> tuple[SourceCamera, list[str]]:
    camera, is_body = mounted_camera(f"{found.path}: {each.info}", each, found.info[each.info], ego_from_frame)
    remarks = [f"{each.name}: its frame has z up: taken for a body frame, not an optical one"] if is_body else []
    if moving:
        remarks.append(f"{each.name}: moves ({', '.join(moving)}); its first pose is used")
    return camera, remarks


@dataclass(frozen=True, eq=False)
class _EgoMotion:
    """Poses of the ego frame, given those of another frame of the vehicle."""

    frame: Motion
    frame_from_ego: FloatArray

    def at(self, time_us: int) -> FloatArray | None:
        pose = self.frame.at(time_us)
        return None if pose is None else pose @ self.frame_from_ego


@dataclass(frozen=True, eq=False)
class _Odometry:
    """Poses of odometry, with a margin at both ends."""

    poses: Trajectory

    def at(self, time_us: int) -> FloatArray | None:
        return pose_at(self.poses, time_us)


def _motion(found: Survey, choice: Choice, base: str, base_from_ego: FloatArray, notes: list[str]) -> Motion:
    if found.odometry is not None:
        return _odometry(found, found.odometry, base, base_from_ego)
    ancestors = found.tree.ancestors(base)
    fixed = plain(choice.odometry or next((each for each in _FIXED if each in ancestors), ancestors[-1]))
    if fixed not in ancestors[1:]:
        if choice.odometry:
            above = ", ".join(ancestors[1:]) or "none"
            raise DataError(
                f"{found.path}: expected --odometry, a topic or a frame above {base} ({above}), got {fixed}"
            )
        notes.append("no odometry, and no frame above the base frame: the ego vehicle is taken for standing")
        return Straight(0.0, 0)
    notes.append(f"ego poses: tf from {fixed} to {base}")
    return _EgoMotion(found.tree.motion(fixed, base), base_from_ego)


def _odometry(found: Survey, topic: str, base: str, base_from_ego: FloatArray) -> Motion:
    child = found.odometry_frame or base
    if not len(found.odometry_poses):
        raise DataError(f"{found.path}: {topic}: expected poses, got none that is finite")
    child_from_base = (np.eye(4), []) if child == base else found.tree.fixed(child, base)
    if child_from_base is None or child_from_base[1]:
        got = "none" if child_from_base is None else f"one that moves ({', '.join(child_from_base[1])})"
        raise DataError(f"{found.path}: {topic}: expected a fixed transform from {child} to {base}, got {got}")
    return _EgoMotion(_Odometry(found.odometry_poses.trajectory), child_from_base[0] @ base_from_ego)


def _remarks(found: Survey, lidar: str | None) -> list[str]:
    remarks = [f"left out: {topic} ({reason})" for topic, reason in sorted(found.refused.items())[:_NAMED]]
    if found.odometry is not None:
        remarks.append(f"ego poses: {found.odometry}")
    if lidar is not None:
        remarks.append(f"LiDAR: {lidar}, not compensated for the motion during a sweep")
    conflicts = sorted(found.tree.conflicts.items())[:_NAMED]
    remarks += [f"tf: {child} has a second parent, {parent}: the first is used" for child, parent in conflicts]
    return [*remarks, "a bag has no boxes and no map"]
