"""Gap between the ego and the edge of the road."""

from __future__ import annotations

import numpy as np

from appocc.checks import FloatArray, IntArray
from appocc.motion_state import MOVING_MPS
from grounding.road.edges import cells_to_edge
from grounding.road.free_space import UNKNOWN, cover_cells
from grounding.road.road_map import RoadMap

# Places along our side, as shares of the length, at which a vehicle may stand between us and the edge.
_ALONG = (-0.4, 0.0, 0.4)
# A vehicle this far beyond the edge is parked at it: on the kerb, or where a map takes its cells for no road.
_BEYOND_M = 1.0


def kerb_gap_m(road: RoadMap, cells: IntArray, heading_rad: FloatArray, side: int, most_m: float) -> FloatArray:
    """Return gaps (N,) between a side of the ego, left (1) or right (-1), and the road edge.

    They are infinite where a parked vehicle stands between us and the edge, or on it, as who stops there stops in the
    second row; and where the road ends only because nobody sees further.

    Args:
        road: the road.
        cells: (N, 2) centres of the ego.
        heading_rad: (N,) its headings.
        side: the side.
        most_m: distance from the centre at which the search for the edge ends.
    """
    turned = heading_rad + side * np.pi / 2
    edge_m = road.edge_distance_m(cells, turned, most_m)
    parked = [one for one in road.free_space.objects if (one.speed_mps or 0.0) <= MOVING_MPS]
    free = ~cover_cells(road.grid, parked)
    unseen = road.drivable | ((road.free_space.cell_flags & UNKNOWN) > 0)
    second_row, seen = np.zeros((2, len(cells)), np.bool_)
    cell_m = road.grid.cell_m
    for share in _ALONG:
        step = share * road.ego.length_m / cell_m * np.stack([np.cos(heading_rad), np.sin(heading_rad)], -1)
        there = np.clip(np.rint(cells + step), 0, np.array(road.grid.shape) - 1).astype(np.int64)
        road_m = road.edge_distance_m(there, turned, most_m)
        free_m, open_m = (
            cells_to_edge(mask, there, turned, (most_m + _BEYOND_M) / cell_m) * cell_m for mask in (free, unseen)
        )
        second_row |= (free_m > 0) & (free_m < road_m + _BEYOND_M - cell_m)
        seen |= open_m < road_m + cell_m
    return np.where(second_row | ~seen, np.inf, edge_m - road.ego.width_m / 2)
