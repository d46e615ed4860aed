"""Track summaries: first and last time, path length and top speed of each track."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from appocc.checks import FloatArray
from appocc.colours import name
from tracking.io.writers import assign_classes, write_table
from tracking.tracks import Track, check_times, group_by_track

# Shorter displacements do not count: positions of parked vehicles drift as more of them becomes visible.
MIN_STEP_M = 2.0
# Window of the median filter over speeds: those of new tracks are inaccurate.
_SPEED_WINDOW = 5


@dataclass(frozen=True, kw_only=True)
class TrackSummary:
    """Summary of one track.

    Attributes:
        id: track id.
        category: class, see `tracking.io.writers.assign_classes`.
        colour: name of the median colour, '' if unknown.
        first_us: time of the first frame.
        last_us: time of the last frame.
        seen: number of frames with a detection.
        reported: number of frames in which the track is reported.
        path_m: length of the path, see `path_length_m`.
        top_speed_mps: maximum of the median-filtered speed; 0 if the vehicle does not move.
    """

    id: int
    category: str
    colour: str
    first_us: int
    last_us: int
    seen: int
    reported: int
    path_m: float
    top_speed_mps: float

    @property
    def moves(self) -> bool:
        """Whether the vehicle moves."""
        return self.path_m > 0


def summarise_tracks(times_us: Sequence[int], tracks: Sequence[Sequence[Track]]) -> tuple[TrackSummary, ...]:
    """Summarise each track of T frames, ordered by id.

    Raises:
        ShapeError: if the numbers of times and frames differ.
    """
    check_times("summaries", times_us, tracks)
    names = assign_classes(tracks)
    return tuple(_summary(times_us, path, names[number]) for number, path in group_by_track(tracks).items())


def _summary(times_us: Sequence[int], path: Sequence[tuple[int, Track]], category: str) -> TrackSummary:
    seen = [track for _, track in path if track.seen]
    path_m = path_length_m(np.array([track.position_world_m[:2] for track in seen]).reshape(-1, 2))
    colours = np.array([track.rgb for _, track in path])
    known = colours[np.isfinite(colours).all(axis=1)]
    speeds_mps = np.array([track.speed_mps for track in seen])
    return TrackSummary(
        id=path[0][1].id,
        category=category,
        colour=name(np.median(known, axis=0)) if len(known) else "",
        first_us=int(times_us[path[0][0]]),
        last_us=int(times_us[path[-1][0]]),
        seen=len(seen),
        reported=len(path),
        path_m=path_m,
        top_speed_mps=float(running_median(speeds_mps, _SPEED_WINDOW).max()) if path_m > 0 else 0.0,
    )


def running_median(values: FloatArray, window: int) -> FloatArray:
    """Return the median (N,) of an odd window around each of N values, which are mirrored at the ends.

    Not `scipy.ndimage.median_filter`: for fewer values than half a window, it reads beyond them.
    """
    mirrored = np.pad(values, window // 2, mode="reflect")
    return np.asarray(np.median(np.lib.stride_tricks.sliding_window_view(mirrored, window), axis=1))


def path_length_m(positions_m: FloatArray) -> float:
    """Return the length of a path through positions (N, 2), as chords of at least MIN_STEP_M.

    The last chord may be shorter. A path within MIN_STEP_M of its first position has length 0.
    """
    length_m, anchor = 0.0, None
    for xy_m in positions_m:
        anchor = xy_m if anchor is None else anchor
        step_m = float(np.hypot(*(xy_m - anchor)))
        if step_m >= MIN_STEP_M:
            length_m, anchor = length_m + step_m, xy_m
    return length_m + float(np.hypot(*(positions_m[-1] - anchor))) if length_m > 0 else 0.0


def write_summaries(path: Path, summaries: Sequence[TrackSummary]) -> None:
    """Write comma-separated values: a header, then a line for each track.

    Raises:
        DataError: if the file cannot be written.
    """
    header = ("track_id", "class", "colour", "first_us", "last_us", "moments_seen", "moments_told")
    rows = [
        (
            *(each.id, each.category, each.colour, each.first_us, each.last_us, each.seen, each.reported),
            *(f"{each.path_m:.2f}", f"{each.top_speed_mps:.2f}", int(each.moves)),
        )
        for each in summaries
    ]
    write_table(path, (*header, "path_m", "top_speed_mps", "moves"), rows)
