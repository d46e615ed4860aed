"""What became of each vehicle: from when to when it was seen, how far and how fast it drove, in one line each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.ndimage import median_filter

from appocc.checks import FloatArray
from appocc.colours import name
from tracking.filtering.smoother import paths_of
from tracking.io.writers import class_names, write_table
from tracking.tracks import Track, check_times

# Places of parked vehicles wander by less, for more and more of them comes into view; shorter moves do not count.
MOVED_M = 2.0
# Sightings in a row of which a speed is the median: a new track's first guesses are wild.
_SPEEDS = 5


@dataclass(frozen=True)
class TrackSummary:
    """One vehicle over all the time that it was told of.

    Attributes:
        id: number of its track.
        category: its class, as `tracking.io.writers.class_names` has it.
        colour: a word for the median of its colours, '' if unknown.
        first_us: time of its first moment.
        last_us: time of its last one.
        seen: at how many moments it was seen.
        told: at how many it was told of.
        path_m: length of its way; see `path_m`.
        top_speed_mps: the largest median of five speeds in a row, 0 if it does not move.
    """

    id: int
    category: str
    colour: str
    first_us: int
    last_us: int
    seen: int
    told: int
    path_m: float
    top_speed_mps: float

    @property
    def moves(self) -> bool:
        """Whether it was seen to change its place."""
        return self.path_m > 0


def summaries_of(times_us: Sequence[int], tracks: Sequence[Sequence[Track]]) -> tuple[TrackSummary, ...]:
    """Each vehicle of the tracks of T moments, in order of id.

    Raises:
        ShapeError: if there are not as many times as moments.
    """
    check_times("summaries", times_us, tracks)
    names = class_names(tracks)
    return tuple(_summary(times_us, path, names[number]) for number, path in paths_of(tracks).items())


def _summary(times_us: Sequence[int], path: Sequence[tuple[int, Track]], category: str) -> TrackSummary:
    seen = [track for _, track in path if track.seen]
    way_m = path_m(np.array([track.position_world_m[:2] for track in seen]).reshape(-1, 2))
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
        told=len(path),
        path_m=way_m,
        top_speed_mps=float(median_filter(speeds_mps, _SPEEDS, mode="mirror").max()) if way_m > 0 else 0.0,
    )


def path_m(places_m: FloatArray) -> float:
    """Length of the way through places (N, 2): that of chords between places at least MOVED_M apart.

    The last chord may be shorter. What stays within MOVED_M of its first place has a way of 0.
    """
    length_m, anchor = 0.0, None
    for place in places_m:
        anchor = place if anchor is None else anchor
        step_m = float(np.hypot(*(place - anchor)))
        if step_m >= MOVED_M:
            length_m, anchor = length_m + step_m, place
    return length_m + float(np.hypot(*(places_m[-1] - anchor))) if length_m > 0 else 0.0


def write_summaries(path: Path, summaries: Sequence[TrackSummary]) -> None:
    """Write a table of comma-separated values: a header, then a line for each vehicle.

    Raises:
        DataError: if the file cannot be written.
    """
    header = ("track_id", "class", "colour", "first_us", "last_us", "moments_seen", "moments_told")
    rows = [
        (
            *(each.id, each.category, each.colour, each.first_us, each.last_us, each.seen, each.told),
            *(f"{each.path_m:.2f}", f"{each.top_speed_mps:.2f}", int(each.moves)),
        )
        for each in summaries
    ]
    write_table(path, (*header, "path_m", "top_speed_mps", "moves"), rows)
