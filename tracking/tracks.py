"""Tracks: what the tracker knows of a vehicle at one moment, and the memory behind its size and colour."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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


def check_times(name: str, times_us: Sequence[int], tracks: Sequence[Sequence[Track]]) -> None:
    """Check that there is a time for each of the moments.

    Raises:
        ShapeError: if there are more or fewer.
    """
    if len(times_us) != len(tracks):
        raise ShapeError(f"{name}: expected a time for each of {len(tracks)} moments, got {len(times_us)}")


class Memory:
    """Medians over the last sightings of each of N vehicles: one that saw two as one, or a half, does not count.

    Attributes:
        sightings: (N,) how many there were, those that are forgotten among them.
        median: (N, K) of K values, NaN where none is known.
        known: (N, K) how many of the sightings remembered show a value.
        spread: (N, K) sums of squared distances from the medians; what is unknown adds nothing.
    """

    def __init__(self, sightings: int, values: int) -> None:
        """Start with no vehicles, of each of which so many values are remembered."""
        self._last = np.zeros((sightings, 0, values))  # in this order sums over sightings are fastest
        self.sightings = np.zeros(0, dtype=np.int64)
        self.median = np.zeros((0, values))
        self.known = np.zeros((0, values))
        self.spread = np.zeros((0, values))

    def add(self, values: FloatArray) -> None:
        """Begin with first sightings (M, K), NaN where one shows nothing of a value."""
        fresh = np.full((len(self._last), *values.shape), np.nan)
        fresh[0] = values
        self._last = np.concatenate([self._last, fresh], axis=1)
        self.sightings = np.concatenate([self.sightings, np.ones(len(values), np.int64)])
        self.median = np.concatenate([self.median, values])
        self.known = np.concatenate([self.known, np.isfinite(values)])
        self.spread = np.concatenate([self.spread, np.zeros_like(values)])

    def keep(self, chosen: BoolArray) -> None:
        """Go on with some (N,) only."""
        self._last, self.sightings = self._last.compress(chosen, axis=1), self.sightings[chosen]
        self.median, self.known, self.spread = (
            each.compress(chosen, axis=0) for each in (self.median, self.known, self.spread)
        )

    def remember(self, rows: IntArray, values: FloatArray) -> None:
        """One more sighting of each of some vehicles (M,): values (M, K)."""
        self._last[self.sightings[rows] % len(self._last), rows] = values
        self.sightings[rows] += 1
        last = self._last.take(rows, axis=1)
        is_known = np.isfinite(last)
        self.known[rows] = known = is_known.sum(axis=0, dtype=np.int32)
        self.median[rows] = median = _medians(last, known)
        off = last - median
        off[~is_known] = 0.0
        off *= off
        self.spread[rows] = off.sum(axis=0)


def _medians(last: FloatArray, known: NDArray[np.int32]) -> FloatArray:
    """(M, K) medians of (S, M, K) without what is NaN, of which so many (M, K) are not; NaN where all is."""
    ordered = last.reshape(len(last), -1).T.copy()
    ordered.sort(axis=1)  # NaN come last
    first = np.arange(0, ordered.size, len(last)).reshape(known.shape)
    # Where none is known, the second of the two is NaN.
    return np.asarray((ordered.take(first + (known - 1) // 2) + ordered.take(first + known // 2)) / 2)
