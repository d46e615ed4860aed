"""The preference field around a vehicle: how much the ego would like each cell, and which constraint forbids it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from appocc.bevmap import ROAD, VEHICLE, BEVMap
from appocc.checks import BoolArray, FloatArray, IntArray
from appocc.drawing import EGO_LENGTH_M, EGO_WIDTH_M
from grounding.query import Query
from grounding.scene import Scene, SceneObject

# Metres between bumpers, and between sides, where the command names none; what is tolerated; how far one may look on.
_GAP_M = {"park": 1.0, "stop": 2.0, "pull_over": 1.5, "approach": 2.0}
_SIDE_GAP_M = 0.8
_LEAST_GAP_M, _LEAST_SIDE_GAP_M = 0.5, 0.4
# A queue may stand between us and a vehicle to stop behind; one parks in the gap beside it or not at all.
_FURTHER_M = {"park": 3.0, "stop": 10.0, "pull_over": 3.0, "approach": 10.0}
_FURTHER_SIDE_M = 1.5
# Share of the ego's footprint (of what is known of it) that has to lie on the road.
_ON_ROAD = 0.9


@dataclass(frozen=True)
class Wish:
    """One way to satisfy a relation, along axes through the referent's middle.

    Attributes:
        words: for people: "behind it".
        axis: (2,) unit vector from the referent to the goal, along or across the referent.
        lengthwise: whether that axis is the direction of the ego's length at the goal.
        cost: dislike of this way beside the others.
    """

    words: str
    axis: FloatArray
    lengthwise: bool
    cost: float = 0.0


class Field:
    """The cells around one wish: how much each is disliked, and which constraint forbids it."""

    def __init__(self, query: Query, wish: Wish, item: SceneObject, heading: float, scene: Scene) -> None:
        """Weigh the cells around a vehicle for the ego's heading (ego frame, radians)."""
        self.wish, self.item, self.scene = wish, item, scene
        self.heading = heading
        bev = scene.bev
        across = np.array([-wish.axis[1], wish.axis[0]])
        centres = bev.grid.centres().reshape(-1, 2)
        offset = centres - item.centre_m
        gap = offset @ wish.axis - self._contact_m()
        aside = offset @ across
        wanted, least, most, slack, spread = self._measures(query)
        region = (gap >= least) & (gap <= most) & (np.abs(aside) <= slack)
        if query.goal_side:
            region &= centres[:, 1] > 0 if query.goal_side == "left" else centres[:, 1] < 0
        self.cells: IntArray = np.argwhere(region.reshape(bev.grid.shape))
        self.gap = gap[region]
        self.cost = ((self.gap - wanted) / spread[0]) ** 2 + (aside[region] / spread[1]) ** 2 + wish.cost
        self.occupied, self.off_road, self.outside = _violations(bev, centres[region], heading)

    def _contact_m(self) -> float:
        """Distance of the middles at which the ego touches the vehicle."""
        own = self.item.length_m if self._at_its_end() else self.item.width_m
        return (own + (EGO_LENGTH_M if self.wish.lengthwise else EGO_WIDTH_M)) / 2

    def _at_its_end(self) -> bool:
        """Whether the ego meets the vehicle at its front or rear, not at a side."""
        along = np.array([np.cos(self.item.yaw_rad), np.sin(self.item.yaw_rad)])
        return bool(abs(along @ self.wish.axis) > np.sqrt(0.5))

    def _measures(self, query: Query) -> tuple[float, float, float, float, tuple[float, float]]:
        """Wanted, least and greatest gap, greatest offset aside, and the spreads of both dislikes, metres."""
        if self.wish.lengthwise:
            action = query.action or "stop"
            wanted, least, further = _GAP_M[action], _LEAST_GAP_M, _FURTHER_M[action]
            slack, spread = 1.2, (2.0, 0.6)
        else:
            wanted, least, further = _SIDE_GAP_M, _LEAST_SIDE_GAP_M, _FURTHER_SIDE_M
            beside = self.item.width_m if self._at_its_end() else self.item.length_m
            slack, spread = beside / 2 + 1, (0.8, 2.5)
        if query.distance_m is None:
            return wanted, least, wanted + further, slack, spread
        # A distance that is named is kept to within a metre and a tenth.
        named, off = query.distance_m, 1 + query.distance_m / 10
        return named, max(min(least, named), named - off), named + off, slack, spread

    def _allowed(self) -> BoolArray:
        return ~(self.occupied | self.off_road | self.outside)

    def best_cost(self) -> float:
        """Cost of the best allowed cell, infinity where there is none."""
        return float(np.min(self.cost[self._allowed()], initial=np.inf))

    def wished_cost(self) -> float:
        """Cost of the best cell if nothing were forbidden, infinity where there is none."""
        return float(np.min(self.cost, initial=np.inf))

    def chosen(self) -> int:
        """Number of the best allowed cell."""
        return int(np.argmin(np.where(self._allowed(), self.cost, np.inf)))

    def why_here(self, index: int) -> list[str]:
        """The gap, and the constraint that moved the cell from the best place."""
        ours = "bumper" if self.wish.lengthwise else "side"
        its = "bumper" if self._at_its_end() else "side"
        reasons = [f"the place is {self.wish.words}, {self.gap[index]:.1f} m {ours} to {its}"]
        ideal = int(np.argmin(self.cost))
        grid = self.scene.bev.grid
        moved = float(np.linalg.norm(self.cells[index] - self.cells[ideal]) * grid.cell_m)
        if moved > 0:
            reasons.append(f"moved {moved:.1f} m from the best place, which {self._forbidden(ideal)}")
        return reasons

    def why_not_here(self) -> str:
        """Why a wish that would have been better was not taken."""
        wrong = self._forbidden(int(np.argmin(self.cost)))
        return f"{self.wish.words} would be better, but the best place there {wrong}"

    def why_none(self) -> str:
        """Which constraint leaves no cell."""
        if not len(self.cells):
            return f"no place {self.wish.words} lies on the map"
        ideal = int(np.argmin(self.cost))
        return f"no place {self.wish.words} is free: the best one {self._forbidden(ideal)}"

    def _forbidden(self, index: int) -> str:
        """What is wrong with a cell, in words."""
        at = self.scene.bev.grid.centre_of(self.cells[index])
        if self.occupied[index]:
            points = footprint_points(at[None], self.heading)[0]
            blockers = [item for item in self.scene.objects if item.covers(points, 0.2).any()]
            other = next((b for b in blockers if b.id != self.item.id), None)
            if other is None:
                return "comes too close to the vehicle itself"
            return f"is taken by the {self.scene.colour_name(other) or ''} {other.noun}".replace("  ", " ")
        return "leaves the road" if self.off_road[index] else "leaves the map"


def footprint_points(centres: FloatArray, heading: float) -> FloatArray:
    """Points (N, P, 2) a fifth of a metre apart that fill the ego's footprint at centres (N, 2), its rim included."""
    along = np.linspace(-EGO_LENGTH_M / 2, EGO_LENGTH_M / 2, 24)
    across = np.linspace(-EGO_WIDTH_M / 2, EGO_WIDTH_M / 2, 11)
    forward = np.array([np.cos(heading), np.sin(heading)])
    left = np.array([-forward[1], forward[0]])
    local = (along[:, None, None] * forward + across[None, :, None] * left).reshape(-1, 2)
    return np.asarray(centres[:, None] + local)


def _violations(bev: BEVMap, centres: FloatArray, heading: float) -> tuple[BoolArray, BoolArray, BoolArray]:
    """Of the ego at centres (N, 2): whether it meets a vehicle, lacks road where it is known, leaves the grid."""
    cells = bev.grid.cell_of(footprint_points(centres, heading))
    inside = bev.grid.contains(cells)
    i, j = np.moveaxis(np.where(inside[..., None], cells, 0), -1, 0)
    occupied = (bev.on[VEHICLE][i, j] & inside).any(axis=1)
    known = bev.occupancy_valid[ROAD][i, j] & inside
    road = bev.on[ROAD][i, j] & known
    off_road = road.sum(axis=1) < _ON_ROAD * known.sum(axis=1)
    return np.asarray(occupied), np.asarray(off_road), np.asarray(~inside.all(axis=1))
