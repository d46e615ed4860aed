"""Made-up detections that are alike, and the tracks of what is detected frame after frame."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from made_map import pose
from numpy.typing import ArrayLike

from appocc.checks import FloatArray
from tracking.detections import Detections
from tracking.field_of_view import CircularView
from tracking.tracker import Tracker
from tracking.tracks import Track

STEP_US = 100_000
CAR_M = (1.8, 4.5, 1.5)


def seen(
    places: Sequence[Sequence[float]] | FloatArray,
    size_m: ArrayLike = CAR_M,
    log_odds: ArrayLike = 3.0,
    kind: str | Sequence[str] = "car",
    yaw_rad: float = 0.0,
) -> Detections:
    """Detections at places (N, 2), alike in all else."""
    xy = np.array(places, dtype=np.float64).reshape(-1, 2)
    n = len(xy)
    kinds = (kind,) * n if isinstance(kind, str) else tuple(kind)
    sure = np.broadcast_to(np.asarray(log_odds, dtype=np.float64), n).copy()
    size = np.broadcast_to(np.asarray(size_m, dtype=np.float64), (n, 3)).copy()
    return Detections.from_boxes(np.pad(xy, ((0, 0), (0, 1))), np.full(n, yaw_rad), size, sure, kinds, CircularView())


def follow(
    at: Callable[[int], Detections], frames: int, ego: FloatArray | None = None, tracker: Tracker | None = None
) -> list[tuple[Track, ...]]:
    """Tracks of frames at ten a second."""
    tracker, here = tracker or Tracker(), pose() if ego is None else ego
    return [tuple(tracker.update(at(i), (i + 1) * STEP_US, here)) for i in range(frames)]


def ids(moments: Sequence[Sequence[Track]]) -> list[list[int]]:
    return [[track.id for track in moment] for moment in moments]
