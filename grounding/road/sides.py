"""Sides of the road by the vehicles that drive on it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from appocc.motion_state import MOVING_MPS
from grounding.road.lane_model import Centreline
from grounding.road.orientation import MIN_VEHICLE_LENGTH_M
from grounding.scene_object import SceneObject

# Votes of a moving oncoming vehicle for the side of traffic; a standing one has one vote.
_MOVING_VOTES = 3.0
# So many vehicles across the road that head our way show a road of one direction, though they stand.
_LEAST_PARKED = 2
# Vehicles with such lateral offsets from our lane are on our road, at such distances behind us at most.
_ROAD_M, _BEHIND_M = (2.0, 12.0), 30.0
# Least cosine between the heading of a vehicle and the road that it drives along.
_PARALLEL = 0.8


@dataclass(frozen=True)
class TrafficSides:
    """On which side traffic drives, and which part of our road it shows to be ours or theirs.

    Attributes:
        side: 1 for right-hand traffic, -1 for left-hand traffic.
        oncoming_m: lateral offset from our lane, towards the other side, of the nearest vehicle that drives against
            us; infinite without any.
        ours_m: the same of the farthest vehicle short of it that drives our way; minus infinity without any.
    """

    side: int
    oncoming_m: float = np.inf
    ours_m: float = -np.inf

    @property
    def kerb(self) -> Literal["left", "right"]:
        """The side of the kerb next to our lane."""
        return "right" if self.side > 0 else "left"

    @classmethod
    def of(cls, objects: Sequence[SceneObject], ego_lane: Centreline, left_hand_traffic: bool | None) -> TrafficSides:
        """Return the sides by the vehicles of a scene.

        Args:
            objects: vehicles, ego frame.
            ego_lane: centreline of the ego lane.
            left_hand_traffic: whether traffic drives on the left; None: as oncoming vehicles do, else on the right.
        """
        on_road = list(_on_road(objects, ego_lane))
        votes = sum(
            np.sign(one.lateral_m) * (_MOVING_VOTES if one.moves else 1.0)
            for one in on_road
            if one.against and one.ahead
        )
        left_hand = votes <= -_MOVING_VOTES if left_hand_traffic is None else left_hand_traffic
        side = -1 if left_hand else 1
        # Where nobody heads against us, several that stand our way show a road of one direction.
        across = [one for one in on_road if side * one.lateral_m > 0]
        one_way = not any(one.against for one in on_road) and len(across) >= _LEAST_PARKED
        shows = [one for one in on_road if one.moves or (one_way and one in across)]
        driven = [(side * one.lateral_m, one.width_m / 2, one.against) for one in shows]
        theirs_m = min((at - half for at, half, against in driven if against and at > 0), default=np.inf)
        ours_m = max((at + half for at, half, against in driven if not against and at < theirs_m), default=-np.inf)
        return cls(side, theirs_m, min(ours_m, theirs_m))


@dataclass(frozen=True)
class _OnRoad:
    """A vehicle along our road: lateral offset from our lane, width, and how it drives."""

    lateral_m: float
    width_m: float
    ahead: bool
    moves: bool
    against: bool


def _on_road(objects: Sequence[SceneObject], ego_lane: Centreline) -> Iterator[_OnRoad]:
    """Yield the vehicles beside our lane that head along it or against it."""
    for item in objects:
        along, lateral = (float(each) for each in ego_lane.project(item.centre_m))
        has_front = item.front_known and item.length_m >= MIN_VEHICLE_LENGTH_M
        if not (has_front and -_BEHIND_M < along < ego_lane.end_m and _ROAD_M[0] < abs(lateral) < _ROAD_M[1]):
            continue
        turn = float(np.cos(item.yaw_rad - ego_lane.heading_rad(np.asarray(along))))
        if abs(turn) > _PARALLEL:
            yield _OnRoad(lateral, item.width_m, along > 0, (item.speed_mps or 0.0) > MOVING_MPS, turn < 0)
