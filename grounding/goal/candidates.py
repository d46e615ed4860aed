"""Goal candidates: cells with a cost and a heading that satisfy a command in one way."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from appocc.checks import BoolArray, FloatArray, IntArray
from grounding.road.free_space import round_heading
from grounding.road.road_map import RoadMap

# A detour of this length, beyond the straight line, costs one; backwards and turning count more than their length.
_DETOUR_M = 25.0


class DistanceRange(NamedTuple):
    """Least, preferred and greatest distance, metres."""

    least_m: float
    preferred_m: float
    most_m: float


@dataclass(frozen=True, eq=False)
class CandidateSet:
    """N goal candidates that satisfy a command in the same way.

    Attributes:
        words: description without the vehicle, such as "behind it".
        cells: (N, 2) cells of the ego's centre.
        cost: (N,) zero for the ideal candidate.
        heading_rad: (N,) ego frame.
        gap_m: (N,) distance to report, None if there is none.
        gap_kind: how the gap is measured, such as "bumper to bumper".
    """

    words: str
    cells: IntArray
    cost: FloatArray
    heading_rad: FloatArray
    gap_m: FloatArray | None = None
    gap_kind: str = ""

    def subset(self, keep: BoolArray) -> CandidateSet:
        """Return the candidates of a mask (N,)."""
        gap = None if self.gap_m is None else self.gap_m[keep]
        return replace(
            self, cells=self.cells[keep], cost=self.cost[keep], heading_rad=self.heading_rad[keep], gap_m=gap
        )

    def with_detour_cost(self, road: RoadMap) -> CandidateSet:
        """Return the candidates with rounded headings and the cost of detours on the way to them."""
        heading = round_heading(self.heading_rad)
        way = road.cars_with().cost_to(self.cells, heading)
        straight = np.linalg.norm(road.grid.centre_of(self.cells) - road.start.xy_m, axis=1)
        detour_m = np.where(np.isfinite(way), way - 1.2 * straight, 0.0)
        return replace(self, cost=self.cost + np.maximum(detour_m, 0.0) / _DETOUR_M, heading_rad=heading)


@dataclass(frozen=True)
class GoalCandidate:
    """One candidate of a set."""

    candidates: CandidateSet
    index: int

    @property
    def cell(self) -> tuple[int, int]:
        """Cell of the ego's centre."""
        i, j = self.candidates.cells[self.index].tolist()
        return i, j

    @property
    def heading_rad(self) -> float:
        """Heading, ego frame."""
        return float(self.candidates.heading_rad[self.index])

    @property
    def cost(self) -> float:
        """Cost, zero for the ideal candidate."""
        return float(self.candidates.cost[self.index])

    def describe(self) -> str:
        """Return the candidate in words, with its gap."""
        gaps, words = self.candidates.gap_m, self.candidates.words
        if gaps is None:
            return words
        gap = float(gaps[self.index])
        return f"{words}, {-gap:.1f} m back" if gap < 0 else f"{words}, {gap:.1f} m {self.candidates.gap_kind}"
