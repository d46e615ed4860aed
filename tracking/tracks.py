"""Tracks: the reported state of one vehicle, and of all vehicles at one time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from typing import overload

import numpy as np

from appocc.checks import BoolArray, FloatArray, IntArray, check_finite, check_shape, frozen
from appocc.errors import ShapeError


@dataclass(frozen=True, kw_only=True, eq=False)
class Track:
    """One tracked vehicle at one time, in the world frame.

    Attributes:
        id: positive integer, constant over time.
        position_world_m: (3,) point on the ground below the vehicle's centre.
        velocity_world_mps: (2,) horizontal velocity.
        yaw_world_rad: heading in [-pi, pi); if not `heading_known`, it may be off by pi.
        heading_known: whether front and rear are distinguished.
        length_m: median over recent detections.
        width_m: median over recent detections.
        rgb: (3,) median of the mean sRGB, 0..255, over recent detections; NaN if unknown.
        score: probability of being a vehicle, from all detections so far.
        seen: whether a detection was matched at this time; otherwise the position is predicted.
        height_m: median over recent detections; NaN if unknown.
        kind: category of its detections.
        detection: index of the matched detection; None if not `seen`.
        moving: whether the velocity is significantly different from zero.
        velocity_known: whether standing and moving are told apart; a vehicle that was detected once may do either.
    """

    id: int
    position_world_m: FloatArray
    velocity_world_mps: FloatArray
    yaw_world_rad: float
    heading_known: bool
    length_m: float
    width_m: float
    rgb: FloatArray
    score: float
    seen: bool
    height_m: float = float("nan")
    kind: str = "vehicle"
    detection: int | None = None
    moving: bool = False
    velocity_known: bool = True

    def __post_init__(self) -> None:
        """Check shapes.

        Raises:
            ShapeError: if a shape differs, position or velocity is not finite, or the size is not positive.
        """
        for name, size in (("position_world_m", 3), ("velocity_world_mps", 2), ("rgb", 3)):
            array = getattr(self, name)
            check_shape(f"track {name}", array, (size,))
            if name != "rgb":
                check_finite(f"track {name}", array)
            copy = array.copy()
            frozen(copy)
            object.__setattr__(self, name, copy)
        if not (self.length_m > 0 and self.width_m > 0):
            raise ShapeError(f"track {self.id}: expected a positive size, got {self.length_m} x {self.width_m} m")

    @property
    def speed_mps(self) -> float:
        """Speed over ground."""
        return float(np.hypot(*self.velocity_world_mps))


@dataclass(frozen=True, kw_only=True, eq=False)
class Tracks:
    """All reported tracks at one time, ordered by id; a sequence of `Track`.

    Attributes: those of `Track`, as arrays of N; `detection` is -1 if none was matched.
    """

    id: IntArray
    position_world_m: FloatArray
    velocity_world_mps: FloatArray
    yaw_world_rad: FloatArray
    heading_known: BoolArray
    size_m: FloatArray
    rgb: FloatArray
    score: FloatArray
    kind: tuple[str, ...]
    detection: IntArray
    moving: BoolArray
    velocity_known: BoolArray

    def __len__(self) -> int:
        """Number of tracks."""
        return len(self.id)

    @overload
    def __getitem__(self, i: int) -> Track: ...
    @overload
    def __getitem__(self, i: slice) -> Tracks: ...
    def __getitem__(self, i: int | slice) -> Track | Tracks:
        """Track at an index, or the tracks of a slice."""
        if isinstance(i, slice):
            return Tracks(**{each.name: getattr(self, each.name)[i] for each in fields(self)})
        width_m, length_m, height_m = self.size_m[i].tolist()
        detection = int(self.detection[i])
        return Track(
            id=int(self.id[i]),
            position_world_m=self.position_world_m[i],
            velocity_world_mps=self.velocity_world_mps[i],
            yaw_world_rad=float(self.yaw_world_rad[i]),
            heading_known=bool(self.heading_known[i]),
            length_m=length_m,
            width_m=width_m,
            rgb=self.rgb[i],
            score=float(self.score[i]),
            seen=detection >= 0,
            height_m=height_m,
            kind=self.kind[i],
            detection=detection if detection >= 0 else None,
            moving=bool(self.moving[i]),
            velocity_known=bool(self.velocity_known[i]),
        )

    def __iter__(self) -> Iterator[Track]:
        """Iterate over the tracks."""
        return (self[i] for i in range(len(self)))


def check_times(name: str, times_us: Sequence[int], tracks: Sequence[Sequence[Track]]) -> None:
    """Check that there are as many timestamps as frames.

    Raises:
        ShapeError: if the numbers differ.
    """
    if len(times_us) != len(tracks):
        raise ShapeError(f"{name}: expected a time for each of {len(tracks)} frames, got {len(times_us)}")


def group_by_track(tracks: Sequence[Sequence[Track]]) -> dict[int, list[tuple[int, Track]]]:
    """Return, for each track id in ascending order, its frame indices and states in temporal order."""
    paths: dict[int, list[tuple[int, Track]]] = {}
    for frame, states in enumerate(tracks):
        for track in states:
            paths.setdefault(track.id, []).append((frame, track))
    return dict(sorted(paths.items()))
