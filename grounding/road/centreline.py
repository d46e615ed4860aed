"""The line on which a lane runs on, and every cell's place along it and beside it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from appocc.checks import BoolArray, FloatArray
from appocc.ego_vehicle import EGO_WIDTH_M
from appocc.geometry import wrap_angle
from appocc.grid import BEVGrid

# The line is put together from arcs, by a search that keeps the best beginnings.
_ARC_M, _POINT_M = 4.0, 1.0
_TURNS = np.array([1 / 80, 1 / 40, 1 / 24, 1 / 14, 1 / 9, 1 / 6])
_CURVATURES = np.concatenate([-_TURNS[::-1], [0.0], _TURNS])
_BEGINNINGS = 24
# What a metre costs: that runs across the road, is bent (times the curvature squared), is too near to a marking or
# to the edge, or nearer to it than the start (by a metre); and one that the road is too short for.
_ACROSS, _BENT, _MARKING, _EDGE, _DRIFT, _MISSING = 1.0, 60.0, 0.2, 0.6, 0.15, 1.0
_ROOM_M, _BESIDE_MARKING_M, _MOST_DRIFT_M = 1.4, 1.2, 1.0


@dataclass(frozen=True)
class Course:
    """A line in the direction of travel, with a mark on it from which metres along are counted.

    Attributes:
        grid: cells.
        points_m: (K, 2) points a metre apart, ego frame; at least two.
        start_m: metres along at the first point: zero or less.
        ends: whether the road ends there, and not the map or the search.
    """

    grid: BEVGrid
    points_m: FloatArray
    start_m: float
    ends: bool = False

    @property
    def middle_m(self) -> FloatArray:
        """(2,) the point from which metres along count."""
        return np.asarray(self.points_m[round(-self.start_m / _POINT_M)])

    @property
    def end_m(self) -> float:
        """Metres along at the last point."""
        return self.start_m + (len(self.points_m) - 1) * _POINT_M

    @cached_property
    def tangents(self) -> FloatArray:
        """(K, 2) unit vectors along the line."""
        step = np.gradient(self.points_m, axis=0)
        return np.asarray(step / np.linalg.norm(step, axis=1, keepdims=True))

    @cached_property
    def coordinates(self) -> tuple[FloatArray, FloatArray]:
        """Metres along and aside (left is positive) of all cells, (X, Y) each, by the line's nearest point."""
        cells = self.grid.cell_of(self.points_m)
        inside = np.flatnonzero(self.grid.contains(cells))
        i, j = cells[inside].T
        off = np.ones(self.grid.shape, np.uint8)
        number = np.zeros(self.grid.shape, np.int64)
        off[i, j], number[i, j] = 0, inside
        _, label = cv2.distanceTransformWithLabels(off, cv2.DIST_L2, cv2.DIST_MASK_3, labelType=cv2.DIST_LABEL_PIXEL)
        point = np.zeros(int(label.max()) + 1, np.int64)
        point[label[off == 0]] = number[off == 0]
        nearest = point[label]
        x, y = (self.grid.centre_of(np.arange(size)[:, None])[:, axis] for axis, size in enumerate(self.grid.shape))
        tx, ty = self.tangents.T
        px, py = self.points_m.T
        before = self.start_m + np.arange(len(px)) * _POINT_M - px * tx - py * ty
        along = before[nearest] + x[:, None] * tx[nearest] + y * ty[nearest]
        aside = (py * tx - px * ty)[nearest]
        return along, y * tx[nearest] - x[:, None] * ty[nearest] - aside

    def heading_rad(self, along_m: FloatArray) -> FloatArray:
        """Direction of the line (...) at metres along (...)."""
        nearest = np.clip(np.rint((along_m - self.start_m) / _POINT_M), 0, len(self.points_m) - 1).astype(np.int64)
        return np.asarray(np.arctan2(self.tangents[nearest, 1], self.tangents[nearest, 0]))

    def place_of(self, xy_m: FloatArray) -> tuple[float, float]:
        """Metres along and aside of one point (2,)."""
        nearest = int(np.argmin(np.linalg.norm(self.points_m - xy_m, axis=1)))
        offset, tangent = xy_m - self.points_m[nearest], self.tangents[nearest]
        aside = tangent[0] * offset[1] - tangent[1] * offset[0]
        return float(self.start_m + nearest * _POINT_M + offset @ tangent), float(aside)

    def straight_from_corner(self, corner_rad: float, within_m: float) -> Course:
        """The line up to where it turns so far within some metres, into another road, and straight on from there."""
        heading = np.unwrap(np.arctan2(self.tangents[:, 1], self.tangents[:, 0]))
        window = round(within_m / _POINT_M)
        corners = np.flatnonzero(np.abs(heading[window:] - heading[:-window]) > corner_rad)
        if not len(corners):
            return self
        at = max(int(corners[0]), 1)
        beyond = np.arange(1, len(self.points_m) - at)[:, None] * _POINT_M * self.tangents[at]
        return Course(self.grid, np.concatenate([self.points_m[: at + 1], self.points_m[at] + beyond]), self.start_m)


@dataclass(frozen=True)
class Tracer:
    """Lays such lines over what a map says of the road, (X, Y) each.

    Attributes:
        grid: cells.
        axis_rad: direction of the road or the opposite.
        sure: 0..1 how well that is known.
        edge_m: distance to the road's edge.
        marking_m: distance to the nearest lane marking.
    """

    grid: BEVGrid
    axis_rad: FloatArray
    sure: FloatArray
    edge_m: FloatArray
    marking_m: FloatArray

    def course(self, at_m: FloatArray, heading_rad: float, ahead_m: float = 60.0, back_m: float = 8.0) -> Course:
        """The line through a point (2,) on which one drives on who heads that way there; straight behind it."""
        points, ends = self._ahead(at_m, heading_rad, ahead_m)
        unit = np.array([np.cos(heading_rad), np.sin(heading_rad)])
        steps = np.arange(-round(back_m / _POINT_M), 0) * _POINT_M
        if len(points) == 1:  # No road ahead at all.
            points = np.stack([at_m, at_m + _POINT_M * unit])
        return Course(self.grid, np.concatenate([at_m + steps[:, None] * unit, points]), float(steps[0]), ends)

    def _ahead(self, at_m: FloatArray, heading_rad: float, length_m: float) -> tuple[FloatArray, bool]:
        """(K, 2) points from the start on, and whether the road ended before the length was reached."""
        rounds, count = int(np.ceil(length_m / _ARC_M)), round(_ARC_M / _POINT_M)
        distance = np.arange(1, count + 1) * _POINT_M
        lines = np.array(at_m).reshape(1, 1, 2)
        headings, costs = np.array([heading_rad]), np.zeros(1)
        best, best_cost, best_ends = lines[0], np.inf, True
        i, j = np.clip(self.grid.cell_of(at_m), 0, np.array(self.grid.shape) - 1).tolist()
        edge_m = float(self.edge_m[i, j])
        for done in range(rounds):
            # Chords of an arc leave at half the turn that it has made.
            turned = headings[:, None, None] + _CURVATURES[None, :, None] * distance / 2
            chord = distance * np.sinc(_CURVATURES[:, None] * distance / 2 / np.pi)
            points = lines[:, None, None, -1] + chord[..., None] * np.stack([np.cos(turned), np.sin(turned)], axis=-1)
            heading = headings[:, None, None] + _CURVATURES[:, None] * distance
            cost, on_road, on_map = self._cost(points, heading, edge_m)
            total = costs[:, None] + (cost * on_road).sum(axis=2) + _BENT * _CURVATURES**2 * _ARC_M
            steps = on_road.sum(axis=2)
            # One that leaves the map is as good as one that goes on; one that leaves the road is cut off there.
            left = (rounds - done) * count - steps
            over = steps < count
            missing = np.where(over & on_map, _MISSING * left * _POINT_M, 0.0)
            ended = np.where(over, total + missing, np.inf)
            first = np.unravel_index(int(np.argmin(ended)), ended.shape)
            if ended[first] < best_cost:
                best_cost, best_ends = float(ended[first]), bool(on_map[first])
                best = np.concatenate([lines[first[0]], points[first][: steps[first]]])
            going = np.argsort(np.where(over, np.inf, total), axis=None, kind="stable")[:_BEGINNINGS]
            parent, arc = np.unravel_index(going[~over.ravel()[going]], total.shape)
            if not len(parent):
                break
            lines = np.concatenate([lines[parent], points[parent, arc]], axis=1)
            headings, costs = heading[parent, arc, -1], total[parent, arc]
        else:
            if costs[0] < best_cost:
                return lines[0], False
        return best, best_ends

    def _cost(
        self, points: FloatArray, heading: FloatArray, edge_m: float
    ) -> tuple[FloatArray, BoolArray, BoolArray]:
        """Cost of points (..., 2), whether all up to each are on the road, and whether arcs stay on the map."""
        cells = self.grid.cell_of(points)
        inside = self.grid.contains(cells)
        i, j = np.moveaxis(np.where(inside[..., None], cells, 0), -1, 0)
        edge = self.edge_m[i, j]
        # In a junction the axis leans to whatever branches off: there it says little.
        cost = _ACROSS * (self.sure[i, j] * np.sin(wrap_angle(heading - self.axis_rad[i, j]))) ** 2
        cost += _MARKING * np.maximum(_BESIDE_MARKING_M - self.marking_m[i, j], 0.0) + _EDGE * np.maximum(
            _ROOM_M - edge, 0.0
        )
        cost += _DRIFT * np.clip(edge_m - edge, 0.0, _MOST_DRIFT_M)
        on_road = np.logical_and.accumulate(inside & (edge > EGO_WIDTH_M / 4), axis=-1)
        return cost * _POINT_M, np.asarray(on_road), np.asarray(inside.all(axis=-1))
