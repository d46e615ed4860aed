"""Building site of a town: paved ground, distances to it, and occupied ground."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.spatial import cKDTree

from appocc.checks import BoolArray, ByteArray, Float32Array, FloatArray, IntArray
from appocc.simulation.network import Edge, RoadNetwork
from appocc.simulation.scenery.builder import LocalFrame
from appocc.simulation.surface import CELL_M, ROAD_SURFACES, Ground, Surface, surface_table

_COARSE = 2  # ground cells per site cell
SITE_M = CELL_M * _COARSE
_MARGIN_M = 4.0
REACH_M = 60.0  # nothing farther from a street is visible
_ISLAND_M = 40.0  # ground enclosed by streets more tightly is a roundabout's centre, not a block
_WIDE = 3  # driving lanes in both directions from which a street is an arterial
_ROAD, _ANY = 1, 2  # bits
_PAVED = (*ROAD_SURFACES, Surface.PAVEMENT, Surface.KERB)


@dataclass(frozen=True)
class Frontage:
    """A straight section of the border between paved ground and a block; s runs along it, d into the block."""

    frame: LocalFrame
    length_m: float
    arterial: bool


class Site:
    """The ground in cells of 0.2 m, with a margin around it.

    Attributes:
        low_m: (2,) lower corner, town frame.
        road: (H, W) road.
        paved: (H, W) roads, car parks and pavements.
        island: (H, W) centres of roundabouts: grass without buildings.
        occupied: (H, W) uint8 occupied or reserved ground.
        to_road_m: (H, W) distance to the nearest road.
        to_paved_m: (H, W) distance to paved ground.
    """

    def __init__(self, ground: Ground, network: RoadNetwork) -> None:
        """Downsample the labels: a cell is road, or paved, if any part of it is."""
        self.low_m = ground.low_m - _MARGIN_M
        flags = surface_table(ROAD_SURFACES) * np.uint8(_ROAD) + surface_table(_PAVED) * np.uint8(_ANY)
        coarse = _downsample(np.asarray(cv2.LUT(ground.label, flags), dtype=np.uint8))
        self.road, self.paved = (coarse & _ROAD) > 0, (coarse & _ANY) > 0
        self.to_road_m, self.to_paved_m = _distance(self.road), _distance(self.paved)
        self.island = _islands(self.paved)
        self.occupied: ByteArray = self.paved.astype(np.uint8)
        self._streets = _streets(network)

    def cell(self, xy_m: FloatArray) -> tuple[IntArray, IntArray]:
        """Return row and column (N,) of positions (N, 2); positions outside are moved to the border."""
        index = np.floor((xy_m - self.low_m) / SITE_M).astype(np.int64)
        high = self.occupied.shape
        return np.clip(index[..., 1], 0, high[0] - 1), np.clip(index[..., 0], 0, high[1] - 1)

    def may_be_free(self, outlines_m: FloatArray) -> BoolArray:
        """Return (N,) whether a few points of convex outlines (N, K, 2) are free: rejects most candidates cheaply."""
        middle = outlines_m.mean(axis=1, keepdims=True)
        probes = np.concatenate([outlines_m, (outlines_m + middle) / 2, middle], axis=1)
        cells = np.floor((probes - self.low_m) / SITE_M).astype(np.int64)
        height, width = self.occupied.shape
        inside = ((cells >= 1) & (cells < [width - 2, height - 2])).all(axis=(1, 2))
        cells[~inside] = 0
        return np.asarray(inside & ~self.occupied[cells[..., 1], cells[..., 0]].any(axis=1))

    def is_free(self, outline_m: FloatArray) -> bool:
        """Return whether a convex outline (K, 2) is inside the site and overlaps no occupied ground."""
        if not self.may_be_free(outline_m[None])[0]:
            return False
        low, high, mask = self._stamp(outline_m)
        return not (self.occupied[low[1] : high[1], low[0] : high[0]] & mask).any()

    def occupy(self, outline_m: FloatArray) -> None:
        """Occupy a convex outline (K, 2) inside the site."""
        low, high, mask = self._stamp(outline_m)
        self.occupied[low[1] : high[1], low[0] : high[0]] |= mask

    def _stamp(self, outline_m: FloatArray) -> tuple[IntArray, IntArray, ByteArray]:
        points = (outline_m - self.low_m) / SITE_M
        low = np.floor(points.min(axis=0)).astype(np.int64)
        high = np.ceil(points.max(axis=0)).astype(np.int64) + 1
        mask = np.zeros((high - low)[::-1], np.uint8)
        corners = np.round((points - low - 0.5) * 256).astype(np.int32)
        cv2.fillConvexPoly(mask, corners.reshape(-1, 1, 2), 1, shift=8)
        return low, high, mask

    def arterial(self, xy_m: FloatArray) -> BoolArray:
        """Return whether the street nearest to each of (N, 2) is an arterial."""
        if self._streets is None:
            return np.zeros(len(xy_m), np.bool_)
        tree, wide = self._streets
        return np.asarray(wide[tree.query(xy_m)[1]])

    def frontages(self, beyond_m: float = 0.0, shortest_m: float = 5.0) -> list[Frontage]:
        """Return straight sections along the paved edges, or along a line at a distance from them, longest first."""
        near = np.pad(self.to_paved_m <= beyond_m, 1).astype(np.uint8)
        outlines, _ = cv2.findContours(near, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
        found: list[Frontage] = []
        for outline in outlines:
            corners = cv2.approxPolyDP(outline, 0.5 / SITE_M, True)[:, 0].astype(np.float64)
            points = self.low_m + (corners - 1 + 0.5) * SITE_M
            ends = np.roll(points, -1, axis=0)
            length = np.linalg.norm(ends - points, axis=1)
            for i in np.flatnonzero(length >= shortest_m):
                found.append(self._orient(points[i], ends[i], float(length[i]), beyond_m))
        wide = self.arterial(np.array([f.frame.at(f.length_m / 2, 0.0) for f in found]).reshape(-1, 2))
        order = sorted(range(len(found)), key=lambda i: (-round(found[i].length_m, 3), i))
        return [Frontage(found[i].frame, found[i].length_m, bool(wide[i])) for i in order]

    def _orient(self, start: FloatArray, end: FloatArray, length_m: float, beyond_m: float) -> Frontage:
        """Return the section between two points, oriented such that the block is to its left."""
        along = (end - start) / length_m
        side = (start + end) / 2 + 2.0 * np.array([-along[1], along[0]])
        left = self.distance_at(side[None], self.to_paved_m)[0] > beyond_m
        return Frontage(LocalFrame(start, along) if left else LocalFrame(end, -along), length_m, False)

    def distance_at(self, xy_m: FloatArray, what: Float32Array) -> Float32Array:
        """Return (N,) values of a distance raster at positions (N, 2)."""
        return np.asarray(what[self.cell(xy_m)])

    def is_set(self, xy_m: FloatArray, what: BoolArray | ByteArray) -> BoolArray:
        """Return (N,) whether a raster is set at positions (N, 2)."""
        return np.asarray(what[self.cell(xy_m)] > 0)


def _downsample(flags: ByteArray) -> ByteArray:
    """Downsample bits, with a margin: set where any part of a cell is set."""
    height, width = (-(-size // _COARSE) for size in flags.shape)
    fine = np.zeros((height * _COARSE, width * _COARSE), np.uint8)
    fine[: flags.shape[0], : flags.shape[1]] = flags
    coarse = fine[0::2, 0::2] | fine[1::2, 0::2] | fine[0::2, 1::2] | fine[1::2, 1::2]
    return np.pad(coarse, round(_MARGIN_M / SITE_M))


def _islands(paved: BoolArray) -> BoolArray:
    """Return small pieces of ground with paving all around."""
    _, number, box, _ = cv2.connectedComponentsWithStats((~paved).astype(np.uint8), connectivity=4)
    left, top, width, height = box[:, :4].T
    small = (np.maximum(width, height) * SITE_M < _ISLAND_M) & (left > 0) & (top > 0)
    small &= (left + width < paved.shape[1]) & (top + height < paved.shape[0])
    small[0] = False  # the paved ground
    return np.asarray(small[number])


def _distance(mask: BoolArray) -> Float32Array:
    """Return the distance of each cell to the nearest set cell, metres; a large distance if there is none."""
    if not mask.any():
        return np.full(mask.shape, 1e6, np.float32)
    distance = cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, 3)
    return np.asarray(distance, dtype=np.float32) * np.float32(SITE_M)


def lanes_across(network: RoadNetwork, edge: Edge) -> int:
    """Return the number of driving lanes of a street, both directions."""
    opposite = network.opposite(edge)
    both = (*edge.lanes, *(opposite.lanes if opposite else ()))
    return sum(lane.kind == "driving" for lane in both)


def _streets(network: RoadNetwork) -> tuple[cKDTree, BoolArray] | None:
    """Return points of all lanes, and whether each belongs to an arterial."""
    points, wide = [], []
    for edge in network.edges:
        arterial = lanes_across(network, edge) >= _WIDE
        for lane in edge.lanes:
            if lane.kind != "driving":
                continue
            dense = resample(lane.centre_m, 6.0)[0]
            points.append(dense)
            wide.append(np.full(len(dense), arterial))
    return (cKDTree(np.concatenate(points)), np.concatenate(wide)) if points else None


def resample(line_m: FloatArray, step_m: float, start_m: float = 0.0) -> tuple[FloatArray, FloatArray]:
    """Resample a polyline: (N, 2) points every `step_m` from `start_m`, and (N, 2) unit directions."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line_m, axis=0), axis=1))])
    at = np.arange(start_m, length[-1] + 1e-9, step_m)
    points = np.stack([np.interp(at, length, line_m[:, axis]) for axis in (0, 1)], axis=1)
    ahead = np.stack(
        [np.interp(np.minimum(at + 0.5, length[-1]), length, line_m[:, axis]) for axis in (0, 1)], axis=1
    )
    behind = np.stack([np.interp(np.maximum(at - 0.5, 0.0), length, line_m[:, axis]) for axis in (0, 1)], axis=1)
    step = ahead - behind
    return points, step / np.maximum(np.linalg.norm(step, axis=1, keepdims=True), 1e-9)
