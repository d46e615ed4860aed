"""Positions next to the carriageway: behind the kerb, on the pavement, with the directions of the street."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from appocc.checks import BoolArray, FloatArray, IntArray
from appocc.simulation.network import Edge, Lane, RoadNetwork
from appocc.simulation.scenery.site import Site, resample

_STEP_M = 0.1
_FARTHEST_M = 14.0


@dataclass(frozen=True, eq=False)
class Roadside:
    """N positions next to streets.

    Attributes:
        xy_m: (N, 2) positions on the pavement, town frame.
        heading: (N, 2) unit direction of travel of the adjacent lane.
        outward: (N, 2) unit direction away from the carriageway.
        behind_m: (N,) depth of the paved ground behind the position, up to the next garden or wall.
        edge: (N,) index of the edge in the network.
    """

    xy_m: FloatArray
    heading: FloatArray
    outward: FloatArray
    behind_m: FloatArray
    edge: IntArray

    def __len__(self) -> int:
        """Number of positions."""
        return len(self.xy_m)

    def select(self, which: BoolArray) -> Roadside:
        """Return the positions of a mask (N,)."""
        return Roadside(
            self.xy_m[which], self.heading[which], self.outward[which], self.behind_m[which], self.edge[which]
        )


def kerb_offset(site: Site, xy_m: FloatArray, outward: FloatArray, clear_m: float) -> FloatArray:
    """Return (N,) distance from points on the road to the first `clear_m` of ground without road; NaN if too far."""
    reach = np.arange(0.0, _FARTHEST_M, _STEP_M)
    points = xy_m[:, None] + reach[:, None] * outward[:, None]
    road = site.is_set(points.reshape(-1, 2), site.road).reshape(len(xy_m), -1)
    width = max(1, round(clear_m / _STEP_M))
    total = np.cumsum(np.pad(road, ((0, 0), (1, width))).astype(np.int64), axis=1)
    total[:, -width:] += np.arange(1, width + 1)  # ground beyond reach counts as road
    clear = (total[:, width:] - total[:, :-width])[:, : len(reach)] == 0
    first = clear.argmax(axis=1)
    return np.where(clear.any(axis=1), reach[first], np.nan)


def outer_lanes(network: RoadNetwork) -> list[tuple[int, Edge, Lane, float]]:
    """Return the outermost lanes of each street: index of the edge, edge, lane, and the side (-1 right, 1 left)."""
    found = []
    for number, edge in enumerate(network.edges):
        if not any(lane.kind == "driving" for lane in edge.lanes):
            continue
        carriageway = [lane for lane in edge.lanes if lane.kind != "walking" and len(lane.centre_m) > 1]
        found.append((number, edge, carriageway[0], -1.0))
        if network.opposite(edge) is None:
            found.append((number, edge, carriageway[-1], 1.0))
    return found


def along_streets(
    site: Site, network: RoadNetwork, step_m: float, back_m: float, alternate: bool, skip_m: float = 9.0
) -> Roadside:
    """Return positions every `step_m` along both sides of all streets, `back_m` behind the kerb, except at junctions.

    Args:
        site: ground raster.
        network: streets.
        step_m: spacing on one side.
        back_m: distance from the carriageway to the position.
        alternate: whether the two sides alternate.
        skip_m: distance without positions at both ends of a street.
    """
    parts: list[tuple[FloatArray, FloatArray, FloatArray, IntArray]] = []
    for number, edge, lane, side in outer_lanes(network):
        first = edge.from_junction < edge.to_junction if side < 0 else True
        start = skip_m + (0.0 if first or not alternate else step_m / 2)
        points, heading = resample(lane.centre_m, step_m, start)
        length = np.linalg.norm(np.diff(lane.centre_m, axis=0), axis=1).sum()
        inside = start + step_m * np.arange(len(points)) < length - skip_m
        out = side * np.stack([-heading[:, 1], heading[:, 0]], axis=1)
        parts.append((points[inside], heading[inside], out[inside], np.full(int(inside.sum()), number)))
    if not parts:
        none = np.zeros((0, 2))
        return Roadside(none, none, none, np.zeros(0), np.zeros(0, np.int64))
    points, heading, out = (np.concatenate([part[k] for part in parts]) for k in range(3))
    return place_behind_kerb(site, points, heading, out, np.concatenate([part[3] for part in parts]), back_m)


def place_behind_kerb(
    site: Site, xy_m: FloatArray, heading: FloatArray, outward: FloatArray, edge: IntArray, back_m: float
) -> Roadside:
    """Return positions `back_m` behind the kerb of carriageway points, if there is one."""
    offset = kerb_offset(site, xy_m, outward, back_m + 0.5) + back_m
    found = np.isfinite(offset)
    at = xy_m[found] + offset[found, None] * outward[found]
    reach = np.arange(0.0, 4.0, 0.2)
    beyond = (at[:, None] + reach[:, None] * outward[found][:, None]).reshape(-1, 2)
    free = (site.is_set(beyond, site.paved) & ~site.is_set(beyond, site.road)).reshape(len(at), -1)
    behind = 0.2 * np.logical_and.accumulate(free, axis=1).sum(axis=1)
    return Roadside(at, heading[found], outward[found], behind, edge[found])


def keep_distance(xy_m: FloatArray, others_m: FloatArray, least_m: float) -> BoolArray:
    """Return (N,) whether positions (N, 2) keep a minimum distance from occupied ones (M, 2)."""
    if not len(others_m) or not len(xy_m):
        return np.ones(len(xy_m), np.bool_)
    return np.asarray(cKDTree(others_m).query(xy_m)[0] >= least_m)
