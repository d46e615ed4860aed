"""Moments: pictures of several cameras at about the same time, and the choice of key frames among them."""

from __future__ import annotations

import math
from bisect import insort
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from appocc.own_cameras.pictures import Picture


@dataclass(frozen=True)
class Moment:
    """Pictures of cameras at about the same time.

    Attributes:
        pictures: picture of each camera that has one, by camera.
    """

    pictures: Mapping[str, Picture]

    @property
    def time_us(self) -> int:
        """Time of the picture in the middle, in order of time."""
        times = sorted(picture.time_us for picture in self.pictures.values())
        return times[len(times) // 2]


class MomentGrouper:
    """Groups pictures into moments, as they come.

    A moment begins with its earliest picture and takes the first picture of each camera within the tolerance. It ends
    when all cameras have one, or those without one have sent a later picture, or pictures of other cameras are later
    by more than `patience_us`. Skipped are pictures out of order (not after the one before of their camera), late
    ones (their moment has ended) and spare ones (their moment has an earlier picture of their camera).

    Attributes:
        skipped: number of skipped pictures: "out of order", "late", "spare".
    """

    def __init__(self, cameras: Sequence[str], tolerance_us: int, patience_us: int = 0) -> None:
        """Start with no pictures.

        Args:
            cameras: names of all cameras.
            tolerance_us: longest time between the first and the last picture of a moment.
            patience_us: how much later pictures may arrive than those of other cameras of the same time.
        """
        self._cameras, self._tolerance_us, self._patience_us = tuple(cameras), tolerance_us, patience_us
        self._pending: list[Picture] = []
        self._last_us: dict[str, int] = {}
        self._ended: tuple[int, frozenset[str]] | None = None
        self.skipped: Counter[str] = Counter()

    def add(self, picture: Picture) -> Iterator[Moment]:
        """Add a picture; yield the moments that have ended, in order of time."""
        before = self._last_us.get(picture.camera)
        if before is not None and picture.time_us <= before:
            self.skipped["out of order"] += 1
            return
        self._last_us[picture.camera] = picture.time_us
        if self._ended is not None and picture.time_us <= self._ended[0]:
            self.skipped["spare" if picture.camera in self._ended[1] else "late"] += 1
            return
        insort(self._pending, picture, key=lambda each: each.time_us)
        while self._pending and self._is_ended():
            yield self._take()

    def rest(self) -> Iterator[Moment]:
        """Yield the moments of all pictures that are left."""
        while self._pending:
            yield self._take()

    def _window(self) -> list[Picture]:
        end_us = self._pending[0].time_us + self._tolerance_us
        return [picture for picture in self._pending if picture.time_us <= end_us]

    def _is_ended(self) -> bool:
        end_us = self._pending[0].time_us + self._tolerance_us
        present = {picture.camera for picture in self._window()}
        waiting = [camera for camera in self._cameras if camera not in present]
        if all(self._last_us.get(camera, end_us) > end_us for camera in waiting):
            return True
        return self._pending[-1].time_us > end_us + self._patience_us

    def _take(self) -> Moment:
        window = self._window()
        self._pending = self._pending[len(window) :]
        first = {picture.camera: picture for picture in reversed(window)}
        self.skipped["spare"] += len(window) - len(first)
        self._ended = window[0].time_us + self._tolerance_us, frozenset(first)
        return Moment({camera: first[camera] for camera in self._cameras if camera in first})


def moments_of(pictures: Iterable[Picture], cameras: Sequence[str], tolerance_us: int) -> Iterator[Moment]:
    """Group pictures in order of time into moments."""
    grouper = MomentGrouper(cameras, tolerance_us)
    for picture in pictures:
        yield from grouper.add(picture)
    yield from grouper.rest()


def key_moments(moments: Iterable[Moment], hz: float) -> Iterator[Moment]:
    """Choose the key frames: in each period the moment with most cameras, of these the nearest to its middle.

    All moments are key frames if they are rarer than `hz`. One moment is held in memory.
    """
    best: Moment | None = None
    best_rank, best_period, first_us = (0, 0.0), 0, None
    for moment in moments:
        first_us = moment.time_us if first_us is None else first_us
        number = (moment.time_us - first_us) * 1e-6 * hz
        period = math.ceil(number - 0.5)
        rank = (len(moment.pictures), -abs(number - period))
        if best is not None and period > best_period:
            yield best
            best = None
        if best is None or rank > best_rank:
            best, best_rank, best_period = moment, rank, period
    if best is not None:
        yield best
