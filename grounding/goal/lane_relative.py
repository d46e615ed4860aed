"""Goal candidates relative to a vehicle and the road: before or past it, across the road, between two vehicles."""

from __future__ import annotations

import numpy as np

from grounding.goal.beside_vehicle import (
    ALONG_M,
    BUMPERS,
    IN_LINE_M,
    LATERAL_M,
    PARKING,
    SECOND,
    Proposal,
    gap_cost,
    gap_range,
)
from grounding.goal.reference_frames import ReferenceVehicle
from grounding.query import Query
from grounding.road.free_space import gap_m, round_heading
from grounding.road.lane_model import LANE_M
from grounding.road.road_map import RoadMap
from grounding.scene_object import SceneObject
from grounding.vocabulary import PASSING_ACTIONS

# Across the road: tolerance along the vehicle, gap of a parked ego to the road edge and spread of its cost.
_LEVEL_M, _LEVEL_SPREAD_M, _EDGE_M, _EDGE_SPREAD_M = 2.0, 2.5, 0.3, 0.6
# The road width is this quantile of samples before and beyond the vehicle, so that side roads do not widen it.
_ACROSS_M, _WIDTH_AT_M, _WIDTH_QUANTILE = 18.0, np.arange(-8.0, 8.1, 2.0), 0.25
# Greatest offset from the line between two vehicles.
_MIDDLE_M = 1.5
# Greatest lateral offset of a vehicle in the ego lane; costs of leaving it to drive past a vehicle, and of
# parking in it.
_IN_LANE_M, _LEAVE_LANE, _PARK_IN_LANE = 1.5, 12.0, 4.0
# Once a vehicle is passed, a place farther on is about as good.
_FURTHER_ON_M = 4.0


def propose_on_our_way(relation: str, query: Query, item: SceneObject, road: RoadMap) -> Proposal:
    """Propose candidates before or past a vehicle on our way: in line with it, in the ego lane or the next one."""
    gaps = gap_range(query, item, road.style)
    reference = ReferenceVehicle(item, road, gaps.most_m + item.length_m / 2 + road.ego.length_m)
    sign, words = (-1.0, "short of it on our way") if relation == "before" else (1.0, "beyond it on our way")
    heading = reference.road_heading_rad
    along, lateral = reference.offsets(reference.travel_rad)
    ego_half = reference.ego_half_extent_m(heading - reference.travel_rad)
    lanes = [("in line with it", lateral, 0.0)]
    if reference.beside_ego_lane:
        (at, off), (lane_along, lane_lateral) = reference.lane_position, reference.lane_coordinates
        along, lateral, ego_half = (
            lane_along - at,
            lane_lateral - off,
            np.full(len(lane_along), road.ego.length_m / 2),
        )
        if abs(off) < _IN_LANE_M:
            lane_lateral = lateral  # the vehicle is in the ego lane and shows where its centre is
        # To drive past a vehicle the ego stays in its lane; otherwise candidates in line with the vehicle count too.
        leave = _LEAVE_LANE if query.action == "drive_past" else SECOND
        lanes = [("in our lane", lane_lateral, 0.0), ("in line with it", lateral, leave)]
        if query.action in PARKING:
            lanes = [("in line with it", lateral, 0.0), ("in our lane", lane_lateral, _PARK_IN_LANE)]
    if query.action == "overtake":
        next_lane = np.abs(lateral) - LANE_M
        lanes = [("in line with it", lateral, 0.0), ("one lane beside it", next_lane, SECOND)]
    gap = sign * along - reference.half_extent_m(reference.travel_rad) - ego_half
    fits = (gap >= gaps.least_m) & (gap <= gaps.most_m)
    passes = query.action in PASSING_ACTIONS and query.distance_m is None
    along_cost = gap_cost(gap, gaps.preferred_m, _FURTHER_ON_M if passes else ALONG_M)
    found = []
    for where, off_m, extra in lanes:
        region = fits & (np.abs(off_m) <= IN_LINE_M)
        cost = along_cost + (off_m / LATERAL_M) ** 2 + extra
        found.append(
            reference.candidates_in(
                region, words=f"{words}, {where}", cost=cost, heading_rad=heading, gap_m=gap, gap_kind=BUMPERS
            )
        )
    return found, []


def propose_opposite(query: Query, item: SceneObject, road: RoadMap) -> Proposal:
    """Propose candidates across the road from a vehicle, level with it."""
    reference = ReferenceVehicle(item, road, _ACROSS_M)
    forward = reference.travel_rad
    left_m, right_m = _edge_distances_m(reference)
    along, left = reference.offsets(forward)
    # Offsets to the left of the road's middle.
    item_offset = (right_m - left_m) / 2
    cell_offset, half_road = left + item_offset, (left_m + right_m) / 2
    sign = -1.0 if item_offset > 0 else 1.0
    level_m = reference.half_extent_m(forward) + _LEVEL_M + road.grid.cell_m / 2  # a candidate is a whole cell
    region = (np.abs(along) <= level_m) & (sign * cell_offset > 0)
    region &= np.abs(cell_offset) < half_road
    if query.action in PARKING:
        lateral = (half_road - np.abs(cell_offset) - road.ego.width_m / 2 - _EDGE_M) / _EDGE_SPREAD_M
    else:
        lateral = (np.abs(cell_offset) - half_road / 2) / 1.5
    cost = (along / _LEVEL_SPREAD_M) ** 2 + lateral**2
    stands = f"{abs(item_offset):.1f} m {'left' if item_offset > 0 else 'right'} of its middle"
    reason = f"the road is {2 * half_road:.0f} m wide there and the vehicle stands {stands}"
    heading = reference.road_heading_rad
    candidates = reference.candidates_in(
        region,
        words=f"across the road from it, on the {'left' if sign > 0 else 'right'} side",
        cost=cost,
        heading_rad=heading,
        gap_m=reference.gaps_m(heading),
        gap_kind="away from it",
    )
    return [candidates], [reason]


def _edge_distances_m(reference: ReferenceVehicle) -> tuple[float, float]:
    """Return distances from a vehicle's centre to the left and right road edge; negative beyond an edge."""
    road, forward = reference.road, reference.travel_rad
    ahead, left = np.array([np.cos(forward), np.sin(forward)]), np.array([-np.sin(forward), np.cos(forward)])
    base = np.array(road.nearest_drivable(reference.item.centre_m))
    cells = base + np.rint(_WIDTH_AT_M[:, None] * ahead / road.grid.cell_m).astype(np.int64)
    cells = cells[road.grid.contains(cells)]
    cells = cells[road.drivable[tuple(cells.T)]]
    if not len(cells):
        return 0.0, 0.0
    edges = (road.edge_distance_m(cells, np.full(len(cells), forward + turn)) for turn in (np.pi / 2, -np.pi / 2))
    left_m, right_m = (float(np.quantile(edge, _WIDTH_QUANTILE)) for edge in edges)
    moved = float((road.grid.centre_of(base) - reference.item.centre_m) @ left)
    return left_m + moved, right_m - moved


def propose_between(item: SceneObject, partner: SceneObject, road: RoadMap) -> Proposal:
    """Propose candidates in the gap between two vehicles."""
    line = partner.centre_m - item.centre_m
    distance_m, angle = float(np.hypot(*line)), float(np.arctan2(line[1], line[0]))
    reference = ReferenceVehicle(item, road, distance_m + road.ego.length_m)
    heading = reference.aligned_heading_rad
    along, lateral = reference.offsets(angle)
    first = reference.gaps_m(heading)
    second = gap_m(partner, road.ego, reference.xy_m, round_heading(heading))
    region = (along > 0) & (along < distance_m) & (np.abs(lateral) <= _MIDDLE_M)
    # In a wide gap the exact middle matters less.
    cost = ((first - second) / max(ALONG_M, distance_m / 8)) ** 2 + lateral**2
    partner_half = ReferenceVehicle(partner, road, 0.0).half_extent_m(angle)
    room = distance_m - reference.half_extent_m(angle) - partner_half
    candidates = reference.candidates_in(
        region,
        words="between both",
        cost=cost,
        heading_rad=heading,
        gap_m=np.minimum(first, second),
        gap_kind="from the nearer of them",
    )
    return [candidates], [f"the two stand {max(room, 0.0):.1f} m apart, we are {road.ego.length_m:.1f} m long"]
