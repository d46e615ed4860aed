"""Cells that no camera sees: no track begins or ends there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from made_map import RED, Car, map_of, pose

from appocc.bevmap import BEVMap
from tracking.detections import Detections
from tracking.instances.instances import find_instances
from tracking.presets import MAPS
from tracking.tracker import Tracker
from tracking.tracks import Track

STEP_S = 0.5


def blinded(bev: BEVMap, first_m: float, last_m: float) -> BEVMap:
    """The map without the cells of a strip in x."""
    x_m = bev.grid.centres()[..., 0]
    known = np.broadcast_to((x_m < first_m) | (x_m > last_m), bev.occupancy_valid.shape).copy()
    return replace(bev, occupancy_valid=known)


def follow(maps: list[BEVMap]) -> list[list[Track]]:
    """Tracks after each map, half a second apart."""
    tracker = Tracker(MAPS)
    return [
        list(tracker.update(Detections.from_instances(find_instances(bev)), round(i * STEP_S * 1e6), pose()))
        for i, bev in enumerate(maps)
    ]


def numbers(moments: list[list[Track]]) -> list[list[int]]:
    return [[track.id for track in moment] for moment in moments]


def test_no_track_begins_in_a_blind_spot() -> None:
    maps = [blinded(map_of([Car(10.0, 0.0), Car(10.0, 8.0)]), 5.0, 15.0)] * 4
    assert numbers(follow(maps)) == [[]] * 4


def test_a_track_outlives_a_blind_spot_but_not_as_long_a_miss() -> None:
    # An uncertain vehicle, which is forgotten once it is missed for as long as makes it lost.
    car, empty = map_of([Car(10.0, 0.0, rgb=RED)], probability=0.65), map_of([])
    there, away = [car] * 4, [empty] * 8
    through, lost = (
        numbers(follow([*there, *gap, *there])) for gap in ([blinded(bev, 5.0, 15.0) for bev in away], away)
    )
    assert through[3] == lost[3] == [1]
    assert through[10] == lost[10] == []  # it is not reported where nothing is known of it
    assert (through[-1], lost[-1]) == ([1], [2])


def test_a_new_track_is_not_ended_by_a_blind_spot_before_it_is_confirmed() -> None:
    car = map_of([Car(10.0, 0.0, rgb=RED)], probability=0.65)
    gap = [map_of([])] * 2
    assert numbers(follow([car, *[blinded(bev, 5.0, 15.0) for bev in gap], car]))[-1] == [1]
    assert numbers(follow([car, *gap, car]))[-1] == []


def test_a_blind_spot_does_not_keep_a_track_for_ever() -> None:
    seen = [map_of([Car(10.0, 0.0, rgb=RED)])] * 4
    blind = [blinded(map_of([]), 5.0, 15.0)] * 64  # 32 s, and what rests is forgotten after 30
    assert numbers(follow([*seen, *blind, *seen]))[-1] == [2]
    assert numbers(follow([*seen, *blind[:40], *seen]))[-1] == [1]
