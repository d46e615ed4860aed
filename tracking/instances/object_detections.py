"""Detections of a map: its objects where it has them, else its vehicle instances."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from appocc.bevmap import VEHICLE, BEVMap
from appocc.colours import lab_from_rgb
from appocc.geometry import footprints
from appocc.objects import BEVObjects
from tracking.detections import Detections, log_odds_from_probability
from tracking.instances.instances import GridView, InstanceConfig, find_instances
from tracking.tracks import Track

# One category for all vehicles: a track keeps its id if the predicted class changes from car to truck.
_VEHICLE = "vehicle"


def find_detections(bev: BEVMap, config: InstanceConfig | None = None) -> Detections:
    """Return the detections of a map: all known objects, or the vehicle instances of a map without objects."""
    objects = bev.known_objects
    return find_instances(bev, config).as_detections() if objects is None else _from_objects(bev, objects)


def _from_objects(bev: BEVMap, objects: BEVObjects) -> Detections:
    """Return objects as detections: vehicles of category "vehicle", the others of their kind.

    Log-odds are relative to the map's object threshold, which has 0.
    """
    known = bev.occupancy_valid[VEHICLE]
    view = GridView(bev.grid, None if known.all() else known)
    outlines = footprints(objects.centre_m[:, :2], objects.yaw_rad, objects.size_wlh_m[:, [1, 0]]).reshape(-1, 2)
    cut = ~view.sees(outlines) | view.blind(outlines)
    threshold = log_odds_from_probability(np.array([bev.object_threshold]))
    half_height_m = objects.size_wlh_m[:, 2:] / 2 * np.array([0.0, 0.0, 1.0])
    return Detections(
        ground_m=objects.centre_m - half_height_m,
        yaw_rad=objects.yaw_rad,
        heading_known=np.ones(len(objects), np.bool_),
        size_m=objects.size_wlh_m,
        log_odds=log_odds_from_probability(objects.score) - threshold,
        kind=tuple(
            _VEHICLE if vehicle else kind for kind, vehicle in zip(objects.kind, objects.are_vehicles, strict=True)
        ),
        rgb=objects.rgb,
        lab=lab_from_rgb(objects.rgb),
        velocity_mps=np.full_like(objects.velocity_mps, np.nan),
        truncated=np.asarray(cut.reshape(-1, 4).any(axis=1)),
        view=view,
    )


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
