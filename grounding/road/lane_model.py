"""Lane geometry: the centreline of the ego lane, positions relative to it, and the lanes to both sides."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np

from appocc.bevmap import ROAD, BEVMap
from appocc.checks import BoolArray, FloatArray, IntArray
from appocc.ego_vehicle import EgoVehicle
from appocc.grid import BEVGrid

LANE_M = 3.5
# Spacing of the points of a centreline.
POINT_M = 1.0
# Extent of the ego lane's centreline behind and ahead of the ego origin.
_BACK_M, _AHEAD_M = 40.0, 90.0
# Without a map, curvature applies only between these distances along the ego heading.
_CURVED_FROM_M, _CURVED_TO_M = -25.0, 45.0
# Hypotheses for the road without a map: its direction at the ego and its curvature, with priors on both.
_SLANTS_RAD = np.linspace(-0.2, 0.2, 11)
_CURVATURES_PER_M = np.linspace(-0.018, 0.018, 13)
_SLANT_SPREAD_RAD, _CURVATURE_SPREAD_PER_M = 0.035, 0.004
# Spreads for vehicles that support a hypothesis: angle to the road, and lateral offset from it.
_PARALLEL_RAD, _LATERAL_SPREAD_M = 0.08, 6.0
# Least share of road cells in a lane of the map.
_MIN_ROAD_SHARE = 0.6
_MAX_LANES, _MAX_VOTING_LANES = 3, 7
# A place at such a lateral offset from a lane is at the side of it, and no lane of its own, if it has its direction
# (cosine).
_BESIDE_M, _SAME_WAY = (0.8, 3.3), 0.7


@dataclass(frozen=True, eq=False)
class Centreline:
    """Centreline of a lane in the direction of travel, ego frame.

    Attributes:
        points_m: (K, 2) points one metre apart; at least two.
        start_m: along-track distance of the first point, zero or negative.
        at_road_end: whether the road ends at the last point, rather than the map or the search range.
    """

    points_m: FloatArray
    start_m: float
    at_road_end: bool = False

    @property
    def origin_m(self) -> FloatArray:
        """(2,) point at along-track distance zero."""
        return np.asarray(self.points_m[round(-self.start_m / POINT_M)])

    @property
    def end_m(self) -> float:
        """Along-track distance of the last point."""
        return self.start_m + (len(self.points_m) - 1) * POINT_M

    @cached_property
    def tangents(self) -> FloatArray:
        """(K, 2) unit tangents."""
        step = np.gradient(self.points_m, axis=0)
        return np.asarray(step / np.linalg.norm(step, axis=1, keepdims=True))

    def _nearest(self, xy_m: FloatArray) -> IntArray:
        """(...) indices of the points nearest to positions (..., 2)."""
        squared = ((xy_m[..., None, :] - self.points_m) ** 2).sum(axis=-1)
        return np.asarray(squared.argmin(axis=-1), dtype=np.int64)

    def project(self, xy_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return along-track distance and lateral offset (left is positive), (...) each, of positions (..., 2)."""
        nearest = self._nearest(xy_m)
        offset, tangent = xy_m - self.points_m[nearest], self.tangents[nearest]
        x, y, tx, ty = offset[..., 0], offset[..., 1], tangent[..., 0], tangent[..., 1]
        return self.start_m + nearest * POINT_M + x * tx + y * ty, y * tx - x * ty

    def direction_rad(self, xy_m: FloatArray) -> FloatArray:
        """Return the direction of travel (...) at the points nearest to positions (..., 2)."""
        tangent = self.tangents[self._nearest(xy_m)]
        return np.asarray(np.arctan2(tangent[..., 1], tangent[..., 0]))

    def heading_rad(self, along_m: FloatArray) -> FloatArray:
        """Return the direction of travel (...) at along-track distances (...)."""
        nearest = np.clip(np.rint((along_m - self.start_m) / POINT_M), 0, len(self.points_m) - 1).astype(np.int64)
        return np.asarray(np.arctan2(self.tangents[nearest, 1], self.tangents[nearest, 0]))

    def from_beside(self, xy_m: FloatArray, heading_rad: float) -> Centreline | None:
        """Return the line with its distances from a place (2,) beside it, parallel to it; None from another place."""
        along_m, lateral_m = (float(each) for each in self.project(xy_m))
        parallel = np.cos(heading_rad - float(self.direction_rad(xy_m))) > _SAME_WAY
        beside = _BESIDE_M[0] < abs(lateral_m) < _BESIDE_M[1]
        inside = self.start_m < along_m < self.end_m
        return replace(self, start_m=self.start_m - along_m) if parallel and beside and inside else None

    def offset_points(self, along_m: FloatArray, lateral_m: float) -> FloatArray:
        """Return points (N, 2) at along-track distances (N,) and one lateral offset."""
        nearest = np.rint(along_m - self.start_m).astype(np.int64)
        left = self.tangents[nearest][:, ::-1] * [-1.0, 1.0]
        return np.asarray(self.points_m[nearest] + lateral_m * left)

    def cell_coordinates(self, grid: BEVGrid) -> tuple[FloatArray, FloatArray]:
        """Return along-track distance and lateral offset of all cells, (X, Y) each, by the nearest point."""
        cells = grid.cell_of(self.points_m)
        inside = np.flatnonzero(grid.contains(cells))
        i, j = cells[inside].T
        off = np.ones(grid.shape, np.uint8)
        number = np.zeros(grid.shape, np.int64)
        off[i, j], number[i, j] = 0, inside
        _, label = cv2.distanceTransformWithLabels(off, cv2.DIST_L2, cv2.DIST_MASK_3, labelType=cv2.DIST_LABEL_PIXEL)
        point = np.zeros(int(label.max()) + 1, np.int64)
        point[label[off == 0]] = number[off == 0]
        nearest = point[label]
        x, y = (grid.centre_of(np.arange(size)[:, None])[:, axis] for axis, size in enumerate(grid.shape))
        tx, ty = self.tangents.T
        px, py = self.points_m.T
        before = self.start_m + np.arange(len(px)) * POINT_M - px * tx - py * ty
        along = before[nearest] + x[:, None] * tx[nearest] + y * ty[nearest]
        lateral = (py * tx - px * ty)[nearest]
        return along, y * tx[nearest] - x[:, None] * ty[nearest] - lateral

    def straighten_at_corner(self, corner_rad: float, within_m: float) -> Centreline:
        """Return the line straight on from its first corner: where it turns by that angle within that distance."""
        heading = np.unwrap(np.arctan2(self.tangents[:, 1], self.tangents[:, 0]))
        window = round(within_m / POINT_M)
        corners = np.flatnonzero(np.abs(heading[window:] - heading[:-window]) > corner_rad)
        if not len(corners):
            return self
        at = max(int(corners[0]), 1)
        beyond = np.arange(1, len(self.points_m) - at)[:, None] * POINT_M * self.tangents[at]
        return Centreline(np.concatenate([self.points_m[: at + 1], self.points_m[at] + beyond]), self.start_m)


@dataclass(frozen=True, eq=False)
class LaneModel:
    """The ego lane and the lanes to both sides, ego frame.

    Attributes:
        centreline: of the ego lane; along-track distance counts from the ego origin.
        lowest: number of the rightmost lane in our direction; the ego lane is 0, lanes to its left are positive.
        highest: number of the leftmost lane in our direction.
        oncoming_left: whether oncoming traffic is on our left.
    """

    centreline: Centreline
    lowest: int = 0
    highest: int = 0
    oncoming_left: bool = True

    def direction_rad(self, xy_m: FloatArray) -> FloatArray:
        """Return our direction of travel (...) along the road at positions (..., 2)."""
        return self.centreline.direction_rad(xy_m)

    def project(self, xy_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return along-track distance and lateral offset (left is positive), (...) each, of positions (..., 2)."""
        return self.centreline.project(xy_m)


@dataclass(frozen=True, eq=False)
class LaneTraffic:
    """Poses and motion of N vehicles, ego frame.

    Attributes:
        xy_m: (N, 2) centres.
        yaw_rad: (N,) directions of the long axes.
        front_known: (N,) whether `yaw_rad` is the heading.
        moving: (N,) whether the vehicle certainly moves.
        standing: (N,) whether the vehicle certainly stands.
    """

    xy_m: FloatArray
    yaw_rad: FloatArray
    front_known: BoolArray
    moving: BoolArray
    standing: BoolArray


def lanes_from_vehicles(traffic: LaneTraffic) -> LaneModel:
    """Estimate the lanes from vehicles alone, without a map."""
    centreline = _arc_centreline(*_fit_arc(traffic))
    lateral = centreline.project(traffic.xy_m)[1]
    lane = lateral / LANE_M
    # Most countries drive on the right; oncoming vehicles, moving ones above all, are evidence for the left.
    votes = np.clip(lane, -2, 2) * np.where(traffic.moving, 2, 1)
    votes = votes * (_split_by_direction(centreline, traffic)[1] & (np.abs(lane) < _MAX_VOTING_LANES))
    return _count_lanes(centreline, traffic, {}, bool(votes.sum() > -0.5))


def lanes_from_map(
    traffic: LaneTraffic, bev: BEVMap, ego_lane: Centreline, oncoming_left: bool, ego: EgoVehicle
) -> LaneModel:
    """Estimate the lanes from a map and the vehicles on it.

    Args:
        traffic: vehicles on the map.
        bev: the map.
        ego_lane: centreline of the ego lane; along-track distance counts from the ego's centre.
        oncoming_left: whether oncoming traffic is on our left.
        ego: size of the ego vehicle.
    """
    centreline = _extend(ego_lane.points_m, ego_lane.start_m + ego.centre_m)
    return _count_lanes(centreline, traffic, _lanes_on_road(centreline, bev), oncoming_left)


def _split_by_direction(centreline: Centreline, traffic: LaneTraffic) -> tuple[BoolArray, BoolArray]:
    """Return which vehicles (N,) head in our direction, and which (N,) against it."""
    turn = np.cos(traffic.yaw_rad - centreline.direction_rad(traffic.xy_m))
    return traffic.front_known & (turn > 0.9), traffic.front_known & (-turn > 0.9)


def _count_lanes(
    centreline: Centreline, traffic: LaneTraffic, on_road: dict[int, bool], oncoming_left: bool
) -> LaneModel:
    """Number the lanes in our direction by the vehicles in them and by the map, if `on_road` is not empty."""
    along, lateral = centreline.project(traffic.xy_m)
    with_us, facing = _split_by_direction(centreline, traffic)
    near = (along > -15) & (along < 45)
    chosen = (near & with_us & traffic.moving, near & facing & traffic.moving, near & traffic.standing)
    driven, oncoming, parked = (np.round(lateral[each] / LANE_M).astype(int) for each in chosen)
    right = _lanes_to_side(-1, on_road, -driven, -oncoming, -parked)
    left = _lanes_to_side(1, on_road, driven, oncoming, parked)
    if on_road and not len(oncoming):
        # Without oncoming vehicles, half of the lanes belong to the other direction, unless they are driven our way.
        half = (left + right + 2) // 2 - 1
        if oncoming_left:
            left = max(half - right, *driven[driven <= left].tolist(), 0)
        else:
            right = max(half - left, *(-driven[-driven <= right]).tolist(), 0)
    return LaneModel(centreline, -right, left, oncoming_left)


def _extend(points_m: FloatArray, start_m: float) -> Centreline:
    """Extend points one metre apart straight on at both ends, to the extent of the ego lane's centreline."""
    back = max(round(_BACK_M + start_m), 0)
    ahead = max(round(_AHEAD_M - start_m) - len(points_m), 0)
    first, last = points_m[1] - points_m[0], points_m[-1] - points_m[-2]
    before = points_m[0] - np.arange(back, 0, -1)[:, None] * first
    after = points_m[-1] + np.arange(1, ahead + 1)[:, None] * last
    return Centreline(np.concatenate([before, points_m, after]), start_m - back)


def _fit_arc(traffic: LaneTraffic) -> tuple[float, float]:
    """Return slant and curvature of the road: the mean over all hypotheses, weighted by parallel vehicles."""
    slant, curvature = (grid.ravel() for grid in np.meshgrid(_SLANTS_RAD, _CURVATURES_PER_M))
    score = -0.5 * (slant / _SLANT_SPREAD_RAD) ** 2 - 0.5 * (curvature / _CURVATURE_SPREAD_PER_M) ** 2
    x, y = traffic.xy_m[:, 0], traffic.xy_m[:, 1]
    near = (x > _CURVED_FROM_M) & (x < 70)
    x, y, yaw, weight = x[near], y[near], traffic.yaw_rad[near], np.where(traffic.moving, 2.0, 1.0)[near]
    lateral = y - _arc_offset_m(slant[:, None], curvature[:, None], x)
    on_road = np.exp(-0.5 * (lateral / _LATERAL_SPREAD_M) ** 2)
    angle = slant[:, None] + curvature[:, None] * np.clip(x, _CURVED_FROM_M, _CURVED_TO_M)
    off = np.sin(yaw - angle) / _PARALLEL_RAD
    score += (weight * on_road * np.exp(-0.5 * off**2)).sum(axis=1)
    share = np.exp(score - score.max())
    share /= share.sum()
    return float(share @ slant), float(share @ curvature)


def _arc_offset_m(slant_rad: FloatArray | float, curvature_per_m: FloatArray | float, x_m: FloatArray) -> FloatArray:
    """Return how far the ego lane is to the left of the ego's x axis at distances ahead."""
    curved = np.clip(x_m, _CURVED_FROM_M, _CURVED_TO_M)
    return np.asarray(slant_rad * x_m + curvature_per_m * curved * (x_m - curved / 2))


def _arc_centreline(slant_rad: float, curvature_per_m: float) -> Centreline:
    """Return the centreline of a road with a slant and a curvature."""
    along = np.arange(-_BACK_M, _AHEAD_M)
    angle = slant_rad + curvature_per_m * np.clip(along, _CURVED_FROM_M, _CURVED_TO_M)
    step = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    line = np.cumsum(step, axis=0) - step
    return Centreline(np.asarray(line - line[round(_BACK_M)]), -_BACK_M)


def _lanes_on_road(centreline: Centreline, bev: BEVMap) -> dict[int, bool]:
    """Return which lanes to both sides of the ego lane are road on the map."""
    found = {}
    for lane in range(-_MAX_LANES, _MAX_LANES + 1):
        cells = bev.grid.cell_of(centreline.offset_points(np.arange(2.0, 26.0, 2.0), lane * LANE_M))
        i, j = cells[bev.grid.contains(cells)].T
        known = bev.occupancy_valid[ROAD][i, j]
        found[lane] = bool(known.any() and bev.on[ROAD][i, j][known].mean() > _MIN_ROAD_SHARE)
    return found


def _lanes_to_side(
    side: int, on_road: dict[int, bool], driven: IntArray, oncoming: IntArray, parked: IntArray
) -> int:
    """Count lanes in our direction on one side (1 left, -1 right) of the ego lane; lane numbers grow to that side."""
    count = 0
    for lane in range(1, _MAX_LANES + 1):
        if lane in oncoming or (on_road and not on_road[side * lane]):
            break
        if lane in driven or (on_road and lane not in parked):
            count = lane
        elif lane in parked:
            break
    return count
