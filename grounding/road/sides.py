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
# Vehicles with such lateral offsets from our lane are on our road, at such distances behind us at most.
_ROAD_M, _BEHIND_M = (2.0, 12.0), 20.0
# Cosine between headings, below minus which a vehicle comes towards us.
_AGAINST = 0.8


@dataclass(frozen=True)
class TrafficSides:
    """On which side traffic drives, and from where on the road belongs to oncoming traffic.

    Attributes:
        side: 1 for right-hand traffic, -1 for left-hand traffic.
        oncoming_m: lateral offset from our lane, towards the other side, of the nearest vehicle that drives against
            us; infinite without any.
    """

    side: int
    oncoming_m: float = np.inf

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
        oncoming = list(_oncoming(objects, ego_lane))
        votes = sum(
            np.sign(lateral) * (_MOVING_VOTES if moves else 1.0) for lateral, ahead, moves, _ in oncoming if ahead
        )
        left_hand = votes <= -_MOVING_VOTES if left_hand_traffic is None else left_hand_traffic
        side = -1 if left_hand else 1
        inner_m = [
            side * lateral - width / 2 for lateral, _, moves, width in oncoming if moves and side * lateral > 0
        ]
        return cls(side, min(inner_m, default=np.inf))


def _oncoming(objects: Sequence[SceneObject], ego_lane: Centreline) -> Iterator[tuple[float, bool, bool, float]]:
    """Yield lateral offset, whether it is ahead, whether it moves, and width of the vehicles that face us."""
    for item in objects:
        along, lateral = (float(each) for each in ego_lane.project(item.centre_m))
        has_front = item.front_known and item.length_m >= MIN_VEHICLE_LENGTH_M
        on_road = -_BEHIND_M < along < ego_lane.end_m and _ROAD_M[0] < abs(lateral) < _ROAD_M[1]
        if has_front and on_road and np.cos(item.yaw_rad - ego_lane.heading_rad(np.asarray(along))) < -_AGAINST:
            yield lateral, along > 0, (item.speed_mps or 0.0) > MOVING_MPS, item.width_m
