"""Hard limits on goals: where a driver would not go unless the command asks for it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from appocc.checks import FloatArray, IntArray
from grounding.query import Query
from grounding.road.car_paths import MOST_BACK_M
from grounding.road.road_map import RoadMap

# Flags in addition to those of the free space and of the search.
OTHER_SIDE, JUNCTION, BEHIND_US = 64, 128, 256
# Actions that end with the ego standing, and those of them that leave it there.
STANDING_ACTIONS, PARKING_ACTIONS = ("park", "pull_over", "stop", "wait"), ("park", "pull_over")
# A goal farther behind us is one that nobody expects.
_BEHIND_M = 8.0
# A parked vehicle keeps this clear of a junction.
_CLEAR_M = 2.0
# Things at a junction: a command that names one asks for a place there.
_JUNCTION_NOUNS = frozenset({"junction", "intersection", "crossing", "traffic_light", "corner", "roundabout"})


@dataclass(frozen=True)
class PlaceLimits:
    """What a command does not ask for, and so a goal must not be.

    Attributes:
        our_side: whether the goal must be on our side of the road.
        clear_of_junctions: whether it must be outside junctions.
        clear_m: how far outside.
        not_behind: whether it must not be far behind us.
        most_back_m: greatest distance backwards on the way.
    """

    our_side: bool = True
    clear_of_junctions: bool = False
    clear_m: float = 0.0
    not_behind: bool = True
    most_back_m: float = MOST_BACK_M

    @classmethod
    def of(cls, query: Query, traffic_side: int) -> PlaceLimits:
        """Return the limits of a command, where traffic drives on the right (1) or left (-1)."""
        oncoming = "left" if traffic_side > 0 else "right"
        asks_side = query.goal_side == oncoming or query.relation in ("opposite", f"{oncoming}_of")
        turns_round = query.direction == "around"
        referent = query.referent
        asks_back = turns_round or (referent is not None and "behind_ego" in referent.qualifiers)
        names_junction = any(part.noun in _JUNCTION_NOUNS for part in query.secondary)
        return cls(
            our_side=not (asks_side or turns_round),
            clear_of_junctions=query.action in STANDING_ACTIONS and not names_junction,
            clear_m=_CLEAR_M if query.action in PARKING_ACTIONS else 0.0,
            not_behind=not asks_back,
        )

    def flags(self, road: RoadMap, cells: IntArray, heading_rad: FloatArray) -> IntArray:
        """Return the violations (N,) of poses: cells (N, 2) and headings (N,)."""
        found = np.zeros(len(cells), np.int64)
        if self.our_side:
            found |= OTHER_SIDE * road.is_oncoming_side(cells, heading_rad)
        if self.clear_of_junctions:
            found |= JUNCTION * (road.junction_distance_m[tuple(cells.T)] <= self.clear_m)
        if self.not_behind:
            ahead_m = (road.grid.centre_of(cells) - road.start.xy_m) @ road.start.ahead
            found |= BEHIND_US * (ahead_m < -_BEHIND_M)
        return found
