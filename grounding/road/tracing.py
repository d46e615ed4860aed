"""Trace the centreline of a lane over a map, by a beam search over arcs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from appocc.checks import BoolArray, FloatArray
from appocc.geometry import wrap_angle
from appocc.grid import BEVGrid
from grounding.road.lane_model import POINT_M, Centreline

# Arcs of this length and these curvatures are joined; the beam keeps the best partial lines.
_ARC_M = 4.0
_TURNS = np.array([1 / 80, 1 / 40, 1 / 24, 1 / 14, 1 / 9, 1 / 6])
_CURVATURES = np.concatenate([-_TURNS[::-1], [0.0], _TURNS])
_BEAM_WIDTH = 24
# Costs per metre: across the road axis, curvature squared, too close to a marking or to the road edge, closer to the
# edge than at the start (per metre), and missing length where the road ends early.
_ACROSS, _CURVATURE, _MARKING, _EDGE, _DRIFT, _MISSING = 1.0, 60.0, 0.2, 0.6, 0.15, 1.0
_EDGE_ROOM_M, _MARKING_ROOM_M, _MAX_DRIFT_M = 1.4, 1.2, 1.0


@dataclass(frozen=True, eq=False)
class CentrelineTracer:
    """Traces centrelines over the layers of a road map, (X, Y) each.

    Attributes:
        grid: cells.
        ego_width_m: the line stays a quarter of it away from the road edge.
        axis_rad: road axis, modulo half a turn.
        axis_confidence: 0..1.
        edge_m: distance to the road edge.
        marking_m: distance to the nearest lane marking.
    """

    grid: BEVGrid
    ego_width_m: float
    axis_rad: FloatArray
    axis_confidence: FloatArray
    edge_m: FloatArray
    marking_m: FloatArray

    def trace(
        self, start_m: FloatArray, heading_rad: float, ahead_m: float = 60.0, back_m: float = 8.0
    ) -> Centreline:
        """Return the centreline through a point (2,) with a heading; behind the point it is straight."""
        points, ends = self._trace_ahead(start_m, heading_rad, ahead_m)
        unit = np.array([np.cos(heading_rad), np.sin(heading_rad)])
        steps = np.arange(-round(back_m / POINT_M), 0) * POINT_M
        if len(points) == 1:  # no road ahead
            points = np.stack([start_m, start_m + POINT_M * unit])
        return Centreline(np.concatenate([start_m + steps[:, None] * unit, points]), float(steps[0]), ends)

    def _trace_ahead(self, start_m: FloatArray, heading_rad: float, length_m: float) -> tuple[FloatArray, bool]:
        """Return points (K, 2) from the start on, and whether the road ends before the length is reached."""
        rounds, count = int(np.ceil(length_m / _ARC_M)), round(_ARC_M / POINT_M)
        distance = np.arange(1, count + 1) * POINT_M
        lines = np.array(start_m).reshape(1, 1, 2)
        headings, costs = np.array([heading_rad]), np.zeros(1)
        best, best_cost, best_ends = lines[0], np.inf, True
        i, j = np.clip(self.grid.cell_of(start_m), 0, np.array(self.grid.shape) - 1).tolist()
        edge_m = float(self.edge_m[i, j])
        for done in range(rounds):
            # The chord of an arc leaves at half the turn of the arc.
            turned = headings[:, None, None] + _CURVATURES[None, :, None] * distance / 2
            chord = distance * np.sinc(_CURVATURES[:, None] * distance / 2 / np.pi)
            points = lines[:, None, None, -1] + chord[..., None] * np.stack([np.cos(turned), np.sin(turned)], axis=-1)
            heading = headings[:, None, None] + _CURVATURES[:, None] * distance
            cost, on_road, on_map = self._cost(points, heading, edge_m)
            total = costs[:, None] + (cost * on_road).sum(axis=2) + _CURVATURE * _CURVATURES**2 * _ARC_M
            steps = on_road.sum(axis=2)
            # An arc that leaves the map costs no more than one that continues; one that leaves the road is cut there.
            left = (rounds - done) * count - steps
            cut = steps < count
            missing = np.where(cut & on_map, _MISSING * left * POINT_M, 0.0)
            ended = np.where(cut, total + missing, np.inf)
            first = np.unravel_index(int(np.argmin(ended)), ended.shape)
            if ended[first] < best_cost:
                best_cost, best_ends = float(ended[first]), bool(on_map[first])
                best = np.concatenate([lines[first[0]], points[first][: steps[first]]])
            kept = np.argsort(np.where(cut, np.inf, total), axis=None, kind="stable")[:_BEAM_WIDTH]
            parent, arc = np.unravel_index(kept[~cut.ravel()[kept]], total.shape)
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
        """Return costs of points (..., K, 2), which of them the road connects, and which arcs stay on the map."""
        cells = self.grid.cell_of(points)
        inside = self.grid.contains(cells)
        i, j = np.moveaxis(np.where(inside[..., None], cells, 0), -1, 0)
        edge = self.edge_m[i, j]
        # In a junction the axis follows side roads and has little weight.
        cost = _ACROSS * (self.axis_confidence[i, j] * np.sin(wrap_angle(heading - self.axis_rad[i, j]))) ** 2
        marking_room, edge_room = _MARKING_ROOM_M - self.marking_m[i, j], _EDGE_ROOM_M - edge
        cost += _MARKING * np.maximum(marking_room, 0.0) + _EDGE * np.maximum(edge_room, 0.0)
        cost += _DRIFT * np.clip(edge_m - edge, 0.0, _MAX_DRIFT_M)
        on_road = np.logical_and.accumulate(inside & (edge > self.ego_width_m / 4), axis=-1)
        return cost * POINT_M, np.asarray(on_road), np.asarray(inside.all(axis=-1))
