"""The carriageway as a raster of distances, used to place things next to it."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from appocc.checks import ByteArray, Float32Array, FloatArray
from appocc.simulation.network import Lane, RoadNetwork

_CELL_M, _MARGIN_M = 0.25, 30.0
_SUBPIXEL = 4


@dataclass(frozen=True, eq=False)
class Carriageway:
    """Distances from the carriageway of a town in cells of 0.25 m.

    Attributes:
        low_m: (2,) its lower corner.
        outside_m: (H, W) distance of each cell from the carriageway, 0 on it; first index y.
    """

    low_m: FloatArray
    outside_m: Float32Array

    def distance_m(self, points_m: FloatArray) -> FloatArray:
        """Return the distance (N,) of points (N, 2) from the carriageway."""
        cell = ((points_m - self.low_m) / _CELL_M).astype(np.int64)
        height, width = self.outside_m.shape
        x, y = np.clip(cell[:, 0], 0, width - 1), np.clip(cell[:, 1], 0, height - 1)
        return np.asarray(self.outside_m[y, x], dtype=np.float64)

    def contours(self, distance_m: float) -> list[FloatArray]:
        """Return closed lines (N, 2) at a distance from the carriageway, around blocks and around the town."""
        mask = (self.outside_m <= distance_m).astype(np.uint8)
        lines, _ = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
        return [line[:, 0].astype(np.float64) * _CELL_M + self.low_m + _CELL_M / 2 for line in lines]


def draw_carriageway(network: RoadNetwork) -> Carriageway:
    """Draw the carriageway of a network: all lanes except pavements, and the junctions between them."""
    low = network.low_m - _MARGIN_M
    width, height = (int(v) for v in np.ceil((network.high_m + _MARGIN_M - low) / _CELL_M))
    image: ByteArray = np.ones((height, width), np.uint8)
    for junction in network.junctions:
        _fill(image, junction.outline_m, low)
    paved = [lane for edge in network.edges for lane in edge.lanes if lane.kind not in ("walking", "other")]
    for lane in [*paved, *(lane for lane in network.inner_lanes if lane.kind == "driving")]:
        for outline in lane_pieces(lane):
            _fill(image, outline, low)
    return Carriageway(low, np.asarray(cv2.distanceTransform(image, cv2.DIST_L2, 5) * _CELL_M, dtype=np.float32))


def lane_pieces(lane: Lane) -> list[FloatArray]:
    """Return the outlines (4, 2) of a lane between consecutive points of its centre line."""
    line = lane.centre_m
    if len(line) < 2:
        return []
    across = normals(line) * lane.width_m / 2
    left, right = line + across, line - across
    return [np.stack([left[k], left[k + 1], right[k + 1], right[k]]) for k in range(len(line) - 1)]


def normals(line_m: FloatArray) -> FloatArray:
    """Return (N, 2) unit normals to the left of a line (N, 2) at its points."""
    step = np.gradient(line_m, axis=0)
    step /= np.maximum(np.hypot(*step.T), 1e-9)[:, None]
    return np.stack([-step[:, 1], step[:, 0]], axis=1)


def _fill(image: ByteArray, outline_m: FloatArray, low_m: FloatArray) -> None:
    points = np.round(((outline_m - low_m) / _CELL_M - 0.5) * 2**_SUBPIXEL).astype(np.int32)
    if len(points) > 2:
        cv2.fillPoly(image, [points], (0,), cv2.LINE_8, _SUBPIXEL)
