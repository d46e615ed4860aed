"""Class of a track: that of most of its detections."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from appocc.objects import BEVObjects
from tracking.tracks import Track


def vote_classes(
    tracks: Sequence[Iterable[Track]], objects: Sequence[BEVObjects | None]
) -> tuple[tuple[Track, ...], ...]:
    """Return the tracks of T frames with the class of most of their objects, weighted by scores.

    Args:
        tracks: T tuples of tracks.
        objects: T tables of objects, whose indices are those of the detections; None for frames without objects.
    """
    votes: dict[int, dict[str, float]] = {}
    for states, table in zip(tracks, objects, strict=True):
        for track in states:
            if table is not None and track.detection is not None:
                kind, own = table.kind[track.detection], votes.setdefault(track.id, {})
                own[kind] = own.get(kind, 0.0) + float(table.score[track.detection])
    kinds = {number: max(own, key=own.__getitem__) for number, own in votes.items()}
    return tuple(tuple(replace(track, kind=kinds.get(track.id, track.kind)) for track in states) for states in tracks)
