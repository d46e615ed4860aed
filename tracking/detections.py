"""What one moment shows of vehicles, from whichever source: the one type that the tracker takes."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields, replace
from typing import Protocol

import numpy as np

from appocc.boxes import LARGEST_M
from appocc.checks import BoolArray, FloatArray, IntArray, check_finite, check_place, check_shape, frozen
from appocc.errors import ShapeError
from tracking.association.costs import near
from tracking.tracks import Track

# Certainty beyond these odds is not told apart: a probability of 1 has no finite log-odds.
MOST_LOG_ODDS = 12.0
# Scores of detectors count as log-odds as they are; their sums must not overflow.
_MOST_GIVEN = 1e9
# Half the width of the widest vehicle; a wider box would only be compared with more others.
_MOST_APART_M = 2.0


class View(Protocol):
    """Where vehicles can be detected at a moment; points (P, 2) are on the ground, ego frame, metres."""

    def sees(self, xy_ego_m: FloatArray) -> BoolArray:
        """(P,) whether points are within the extent of the view."""
        ...

    def blind(self, xy_ego_m: FloatArray) -> BoolArray:
        """(P,) whether points are in a blind spot within the extent: nothing is known there; nowhere by default."""
        return np.zeros(len(xy_ego_m), np.bool_)


@dataclass(frozen=True)
class Around(View):
    """A view of all that lies within a distance of the ego.

    Attributes:
        range_m: distance on the ground.
    """

    range_m: float = np.inf

    def sees(self, xy_ego_m: FloatArray) -> BoolArray:
        """See `View`."""
        return np.asarray(np.hypot(xy_ego_m[:, 0], xy_ego_m[:, 1]) <= self.range_m)


@dataclass(frozen=True)
class Detections:
    """N vehicles seen at one moment, in the ego frame, metres and radians.

    Attributes:
        ground_m: (N, 3) points on the ground below their centres.
        yaw_rad: (N,) direction of the long axis; if not `heading_known`, it may point to the rear.
        heading_known: (N,) whether the yaw tells front from rear.
        size_m: (N, 3) width, length, height; the height is NaN where unknown.
        log_odds: (N,) of being a vehicle at all: 0 where that is as likely as not.
        kind: N names of categories; only detections of a track's own kind go on with it.
        rgb: (N, 3) mean sRGB 0..255, NaN where unknown.
        lab: (N, 3) CIELAB of their paint, robust against what is not paint, NaN where unknown; what colours are
            compared by.
        cut: (N,) whether the view ends within the vehicle, so that a part of it may be missing.
        view: where others would have been seen.
    """

    ground_m: FloatArray
    yaw_rad: FloatArray
    heading_known: BoolArray
    size_m: FloatArray
    log_odds: FloatArray
    kind: tuple[str, ...]
    rgb: FloatArray
    lab: FloatArray
    cut: BoolArray
    view: View

    def __post_init__(self) -> None:
        """Check shapes.

        Raises:
            ShapeError: if one does not fit, a number that must be known is not, a place is farther than any on Earth,
                or a size is not positive.
        """
        n = len(self.ground_m)
        widths = {"ground_m": (3,), "size_m": (3,), "rgb": (3,), "lab": (3,)}
        for name in _ARRAYS:
            check_shape(f"detections {name}", getattr(self, name), (n, *widths.get(name, ())))
            frozen(getattr(self, name))
        check_place("detections ground_m", self.ground_m)
        for name in ("yaw_rad", "log_odds"):
            check_finite(f"detections {name}", getattr(self, name))
        check_finite("detections width and length", self.size_m[:, :2])
        _check_values(self)
        if len(self.kind) != n:
            raise ShapeError(f"detections kind: expected {n} names, got {len(self.kind)}")

    def __len__(self) -> int:
        """Number of detections."""
        return len(self.ground_m)

    def select(self, keep: BoolArray | IntArray) -> Detections:
        """The detections of a mask (N,) or of indices, as seen in the same view."""
        numbers = np.arange(len(self))[keep]
        chosen = {name: getattr(self, name)[numbers] for name in _ARRAYS}
        return replace(self, **chosen, kind=tuple(self.kind[i] for i in numbers))

    def distinct(self) -> BoolArray:
        """(N,) which to go on with where a detector tells of a vehicle twice.

        Two of one kind whose centres are apart by less than half the width of the narrower are one vehicle; the surer
        one stays, of equals the first.
        """
        keep = np.ones(len(self), dtype=np.bool_)
        half_m = np.minimum(self.size_m[:, 0] / 2, _MOST_APART_M)
        one, other = near(self.ground_m[:, :2], self.ground_m[:, :2], half_m)
        if len(one) == len(self):  # each has itself alone
            return keep
        rank = np.empty(len(self), dtype=np.int64)
        rank[np.argsort(-self.log_odds, kind="stable")] = np.arange(len(self))
        offset = self.ground_m[one, :2] - self.ground_m[other, :2]
        twins = (rank[one] < rank[other]) & (np.hypot(offset[:, 0], offset[:, 1]) <= half_m[other])
        one, other = one[twins], other[twins]
        order = np.argsort(rank[one], kind="stable")
        for surer, twin in zip(one[order].tolist(), other[order].tolist(), strict=True):
            if keep[surer] and self.kind[surer] == self.kind[twin]:
                keep[twin] = False
        return keep

    def cover(self, xy_m: FloatArray) -> tuple[IntArray, IntArray]:
        """(K,), (K,) numbers of points (P, 2) in the ego frame and of the detections in whose boxes they lie."""
        half_m = self.size_m / 2
        which, points = near(self.ground_m[:, :2], xy_m, np.hypot(half_m[:, 0], half_m[:, 1]))
        x, y = (xy_m.take(points, axis=0) - self.ground_m[:, :2].take(which, axis=0)).T
        half_width, half_length, _ = half_m.take(which, axis=0).T
        cos, sin = np.cos(self.yaw_rad[which]), np.sin(self.yaw_rad[which])
        inside = (np.abs(x * cos + y * sin) <= half_length) & (np.abs(y * cos - x * sin) <= half_width)
        return points[inside], which[inside]


_ARRAYS = tuple(field.name for field in fields(Detections) if field.name not in ("kind", "view"))


def _check_values(detections: Detections) -> None:
    """Check what would make sums overflow or logarithms fail."""
    size_m, sure = detections.size_m, np.abs(detections.log_odds)
    if (size_m <= 0).any():
        raise ShapeError(f"detections: expected positive sizes, got {np.nanmin(size_m):g} m")
    if (size_m > LARGEST_M).any():
        raise ShapeError(f"detections: expected sizes up to {LARGEST_M:g} m, got {np.nanmax(size_m):g} m")
    if (sure > _MOST_GIVEN).any():
        raise ShapeError(f"detections log_odds: expected {_MOST_GIVEN:.0e} at most, got {sure.max():g}")
    for name in ("rgb", "lab"):
        if np.isinf(getattr(detections, name)).any():
            raise ShapeError(f"detections {name}: expected finite numbers, or NaN where unknown, got infinity")


def boxes_as_detections(
    ground_m: FloatArray,
    yaw_rad: FloatArray,
    size_m: FloatArray,
    log_odds: FloatArray,
    kind: tuple[str, ...],
    view: View,
) -> Detections:
    """Detections of a detector of boxes: headings known, colours not; arrays as in `Detections`.

    Raises:
        ShapeError: as `Detections`.
    """
    n = len(ground_m)
    known, colourless = np.ones(n, dtype=np.bool_), np.full((n, 3), np.nan)
    return Detections(ground_m, yaw_rad, known, size_m, log_odds, kind, colourless, colourless, ~known, view)


def log_odds_of(probability: FloatArray) -> FloatArray:
    """Log-odds of probabilities, no more than `MOST_LOG_ODDS` either way."""
    least = 1 / (1 + np.exp(MOST_LOG_ODDS))
    sure = np.clip(probability, least, 1 - least)
    return np.asarray(np.log(sure / (1 - sure)))


def probability_of(log_odds: FloatArray | float) -> FloatArray:
    """Probabilities, 0..1, of log-odds."""
    return np.asarray(1 / (1 + np.exp(-np.asarray(log_odds, dtype=np.float64))))


# Recordings -------------------------------------------------------------------------------------------------------


class Recorded(Protocol):
    """One moment of a recording."""

    @property
    def detections(self) -> Detections:
        """What was seen."""
        ...

    @property
    def timestamp_us(self) -> int:
        """When."""
        ...

    @property
    def world_from_ego(self) -> FloatArray:
        """(4, 4) from where."""
        ...


class TakesDetections(Protocol):
    """A tracker."""

    def update(self, detections: Detections, timestamp_us: int, world_from_ego: FloatArray, /) -> Iterable[Track]:
        """Take in one moment; the tracks at it."""
        ...


def lead(
    tracker: TakesDetections, moments: Iterable[Recorded], advance: Callable[[int], None] = lambda _: None
) -> tuple[tuple[Track, ...], ...]:
    """Lead a fresh tracker through a recording; the tracks of each moment.

    `advance` is called with the number of moments done.
    """
    tracks = []
    for moment in moments:
        tracks.append(tuple(tracker.update(moment.detections, moment.timestamp_us, moment.world_from_ego)))
        advance(1)
    return tuple(tracks)
