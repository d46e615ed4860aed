"""Tracks: what the tracker knows of a vehicle at one moment, and the memory behind its size and colour."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from appocc.checks import BoolArray, FloatArray, IntArray, check_finite, check_shape, frozen
from appocc.errors import ShapeError


@dataclass(frozen=True)
class Track:
    """One vehicle at one moment, in the world frame.

    Attributes:
        id: whole number from 1, the same for the vehicle over time.
        position_world_m: (3,) point on the ground below its centre.
        velocity_world_mps: (2,) horizontal velocity.
        yaw_world_rad: heading in [-pi, pi); if not `heading_known`, the rear may be where the front is said to be.
        heading_known: whether motion has told front from rear.
        length_m: median over the last sightings.
        width_m: the same.
        rgb: (3,) median mean sRGB 0..255 over the last sightings, NaN if never seen.
        score: probability that it is a vehicle, from all that was seen of it so far.
        seen: whether a detection was matched at this moment; otherwise the place is predicted.
        height_m: median over the last sightings, NaN where unknown.
        kind: category of its detections.
        detection: number of the detection that was matched at this moment; None if not `seen`.
        moving: whether its velocity is certainly not zero.
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

    def __post_init__(self) -> None:
        """Check shapes.

        Raises:
            ShapeError: if one does not fit, place or velocity are not finite, or the size is not positive.
        """
        for name, size in (("position_world_m", 3), ("velocity_world_mps", 2), ("rgb", 3)):
            array = getattr(self, name)
            check_shape(f"track {name}", array, (size,))
            if name != "rgb":
                check_finite(f"track {name}", array)
            frozen(array)
        if not (self.length_m > 0 and self.width_m > 0):
            raise ShapeError(f"track {self.id}: expected a positive size, got {self.length_m} x {self.width_m} m")

    @property
    def speed_mps(self) -> float:
        """Speed over ground."""
        return float(np.hypot(*self.velocity_world_mps))


@dataclass(frozen=True)
class Tracks:
    """All vehicles that are told of at one moment, in order of id; a sequence of `Track`.

    Attributes: those of `Track`, as arrays of N; `detection` is -1 where none was matched.
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

    def __len__(self) -> int:
        """Number of tracks."""
        return len(self.id)

    def __getitem__(self, i: int) -> Track:
        """One of them."""
        width_m, length_m, height_m = self.size_m[i].tolist()
        detection = int(self.detection[i])
        return Track(
            int(self.id[i]),
            self.position_world_m[i].copy(),
            self.velocity_world_mps[i].copy(),
            float(self.yaw_world_rad[i]),
            bool(self.heading_known[i]),
            length_m,
            width_m,
            self.rgb[i].copy(),
            float(self.score[i]),
            detection >= 0,
            height_m,
            self.kind[i],
            detection if detection >= 0 else None,
            bool(self.moving[i]),
        )

    def __iter__(self) -> Iterator[Track]:
        """Each of them."""
        return (self[i] for i in range(len(self)))


class Memory:
    """Medians over the last sightings of each of N vehicles: one that saw two as one, or a half, does not count."""

    def __init__(self, sightings: int, values: int) -> None:
        """Start with no vehicles, of each of which so many values are remembered."""
        self._rows = np.zeros((0, sightings, values))
        self._next = np.zeros(0, dtype=np.int64)
        self.median = np.zeros((0, values))

    def add(self, values: FloatArray) -> None:
        """Begin with first sightings (M, K), NaN where one shows nothing of a value."""
        fresh = np.full((len(values), *self._rows.shape[1:]), np.nan)
        fresh[:, 0] = values
        self._rows = np.concatenate([self._rows, fresh])
        self._next = np.append(self._next, np.ones(len(values), np.int64))
        self.median = np.vstack([self.median, values])

    def keep(self, chosen: BoolArray) -> None:
        """Go on with some (N,) only."""
        self._rows, self._next, self.median = self._rows[chosen], self._next[chosen], self.median[chosen]

    def remember(self, rows: IntArray, values: FloatArray) -> None:
        """One more sighting of each of some vehicles (M,): values (M, K)."""
        sightings = self._rows.shape[1]
        self._rows[rows, self._next[rows] % sightings] = values
        self._next[rows] += 1
        self.median[rows] = _medians(self._rows[rows])

    def spread(self) -> FloatArray:
        """(N, K) sums of squared distances from the medians, and what is unknown counts for nothing."""
        return np.asarray(np.nansum((self._rows - self.median[:, None]) ** 2, axis=1))

    def known(self) -> FloatArray:
        """(N, K) how many of the sightings remembered show a value."""
        return np.asarray(np.isfinite(self._rows).sum(axis=1), dtype=np.float64)


def _medians(rows: FloatArray) -> FloatArray:
    """(M, K) medians of (M, S, K) without what is NaN; NaN where all is."""
    ordered = np.sort(rows, axis=1)  # NaN come last
    count = np.isfinite(rows).sum(axis=1)  # M K
    middle = [np.maximum(count - 1, 0) // 2, np.maximum(count // 2, 0)]
    low, high = (np.take_along_axis(ordered, each[:, None], axis=1)[:, 0] for each in middle)
    return np.asarray(np.where(count > 0, (low + np.where(count % 2 == 1, low, high)) / 2, np.nan))
