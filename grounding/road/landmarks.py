"""Landmarks of a vector map: where crossings, stop lines, traffic lights, junctions and car parks lie on the road."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import cv2
import numpy as np

from appocc.checks import BoolArray, FloatArray
from appocc.geometry import apply, inverse
from appocc.grid import BEVGrid
from appocc.nuscenes.maps import VectorMap
from appocc.rasterise import polygon_cover
from grounding.road.lane_model import POINT_M, Centreline

# Landmarks this far away are taken from a vector map.
_REACH_M = 80.0
# An outline crosses a lane where it comes this near to its centreline. Outlines are sampled in these steps.
_IN_LANE_M, _STEP_M = 1.5, 0.25


def explain_unknown(kind: str) -> str:
    """Tell that a map does not show landmarks of a kind."""
    return f"no {kind} is known here: the map does not show any"


class Span(NamedTuple):
    """Where a landmark lies along a lane: along-track distances of its near and its far side."""

    near_m: float
    far_m: float

    @property
    def middle_m(self) -> float:
        """Along-track distance of its middle."""
        return (self.near_m + self.far_m) / 2


@dataclass(frozen=True, eq=False)
class Landmarks:
    """Landmarks around the ego.

    Attributes:
        outlines: (K, 2) outlines by kind, ego frame; a kind that the map does not know is missing.
    """

    outlines: Mapping[str, tuple[FloatArray, ...]] = field(default_factory=dict)

    @classmethod
    def from_map(cls, vector: VectorMap, world_from_ego: FloatArray) -> Landmarks:
        """Return the landmarks of a vector map near the ego."""
        ego_from_world, here = inverse(world_from_ego), world_from_ego[:2, 3]
        near = vector.near(here - _REACH_M, here + _REACH_M).landmarks
        return cls(
            {
                kind: tuple(apply(ego_from_world, np.pad(one, ((0, 0), (0, 1))))[:, :2] for one in outlines)
                for kind, outlines in near.items()
            }
        )

    def knows(self, kind: str) -> bool:
        """Return whether the map tells where landmarks of a kind are, or that there is none."""
        return kind in self.outlines

    def cells(self, grid: BEVGrid, kind: str) -> BoolArray:
        """Return the cells (X, Y) that are half or more in landmarks of a kind."""
        found = np.zeros(grid.shape, np.bool_)
        for outline in self.outlines.get(kind, ()):
            found |= polygon_cover(grid, outline) >= 0.5
        return found

    def distance_field_m(self, grid: BEVGrid, kind: str) -> FloatArray:
        """Return the distance (X, Y) of cells to the nearest landmark of a kind on the map; 0 in it."""
        apart = ~self.cells(grid, kind)
        if apart.all():
            return np.full(grid.shape, np.inf)
        far = cv2.distanceTransform(apart.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
        return far.astype(np.float64) * grid.cell_m

    def distances_m(self, kind: str, points_m: FloatArray) -> FloatArray:
        """Return the distance (N,) of points (N, 2), ego frame, to the nearest landmark of a kind; 0 inside it."""
        found = np.full(len(points_m), np.inf)
        for outline in self.outlines.get(kind, ()):
            found = np.minimum(found, _distance_m(outline, points_m))
        return found

    def spans(self, kind: str, lane: Centreline) -> list[Span]:
        """Return where landmarks of a kind lie along a lane, nearest first; outlines that overlap there are one."""
        found: list[Span] = []
        for outline in self.outlines.get(kind, ()):
            along, lateral = lane.project(_sample(outline))
            here = (np.abs(lateral) < _IN_LANE_M) & (along > lane.start_m) & (along < lane.end_m + _IN_LANE_M)
            # One in which the lane begins or ends reaches as far as the lane is known.
            inside = lane.start_m + POINT_M * np.flatnonzero(_distance_m(outline, lane.points_m) == 0)
            if len(both := np.concatenate([along[here], inside])):
                found.append(Span(float(both.min()), float(both.max())))
        merged: list[Span] = []
        for span in sorted(found):
            if merged and span.near_m <= merged[-1].far_m:
                before = merged.pop()
                merged.append(Span(before.near_m, max(before.far_m, span.far_m)))
            else:
                merged.append(span)
        return merged


NO_LANDMARKS = Landmarks()


def _distance_m(outline_m: FloatArray, points_m: FloatArray) -> FloatArray:
    """Return the distance (N,) of points (N, 2) to an outline (K, 2); 0 inside it."""
    border = outline_m.astype(np.float32)[:, None]
    inward = [cv2.pointPolygonTest(border, (float(x), float(y)), True) for x, y in points_m]
    return np.maximum(np.negative(inward), 0.0)


def _sample(outline_m: FloatArray) -> FloatArray:
    """Return points (N, 2) along an outline (K, 2)."""
    ends = np.roll(outline_m, -1, axis=0)
    counts = np.ceil(np.hypot(*(ends - outline_m).T) / _STEP_M).astype(np.int64).clip(1)
    edge = np.repeat(np.arange(len(outline_m)), counts)
    share = np.concatenate([np.arange(count) / count for count in counts])[:, None]
    return np.asarray(outline_m[edge] * (1 - share) + ends[edge] * share)
