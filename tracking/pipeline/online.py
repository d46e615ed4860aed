"""Running a tracker on a recording."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Protocol, TypeVar

from appocc.checks import FloatArray
from tracking.detections import Detections
from tracking.tracks import Track


def no_progress(steps: int) -> None:
    """Report no progress."""


class DetectionFrame(Protocol):
    """Detections of one frame, with its time and ego pose."""

    @property
    def detections(self) -> Detections:
        """Detections in the ego frame."""
        ...

    @property
    def timestamp_us(self) -> int:
        """Time in microseconds."""
        ...

    @property
    def world_from_ego(self) -> FloatArray:
        """(4, 4) ego pose."""
        ...


class OnlineTracker(Protocol):
    """A tracker that is updated frame by frame."""

    def update(self, detections: Detections, timestamp_us: int, world_from_ego: FloatArray, /) -> Iterable[Track]:
        """Process one frame and return its tracks."""
        ...


def run_tracker(
    tracker: OnlineTracker, frames: Iterable[DetectionFrame], advance: Callable[[int], None] = no_progress
) -> tuple[tuple[Track, ...], ...]:
    """Run a new tracker on a recording and return the tracks of each frame.

    `advance` is called with 1 after each frame.
    """
    tracks = []
    for frame in frames:
        tracks.append(tuple(tracker.update(frame.detections, frame.timestamp_us, frame.world_from_ego)))
        advance(1)
    return tuple(tracks)


class Scored(Protocol):
    """A track, or a row of its results, at one time."""

    @property
    def id(self) -> int:
        """Track id."""
        ...

    @property
    def score(self) -> float:
        """Score by what is known at that time."""
        ...


_Scored = TypeVar("_Scored", bound=Scored)


def select_scores(tracks: Iterable[Iterable[_Scored]], min_score: float) -> tuple[tuple[_Scored, ...], ...]:
    """Return the tracks of each frame whose score, by what is known at that time, is at least `min_score`."""
    return tuple(tuple(track for track in states if track.score >= min_score) for states in tracks)


def best_scores(tracks: Iterable[Iterable[Scored]]) -> dict[int, float]:
    """Return the highest score that each track ever has, by id."""
    best: dict[int, float] = {}
    for states in tracks:
        for track in states:
            best[track.id] = max(track.score, best.get(track.id, track.score))
    return best


def count_tracks(tracks: Iterable[Iterable[Scored]]) -> int:
    """Return the number of different track ids."""
    return len({track.id for states in tracks for track in states})
