"""The vector map of a segment: what Waymo's map features tell, and the drivable area that follows from them.

Waymo has no drivable area: it is what can be reached from the middle of a lane without crossing a road edge.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from appocc.checks import BoolArray, ByteArray, FloatArray
from appocc.importers.maps import LogMap
from appocc.nuscenes.maps import Area
from appocc.nuscenes.writer import Writer

_PX_PER_M = 5.0
_MARGIN_M = 10.0
# Half the width of a lane; farthest edge of the road from the middle of its outer lane, with a parking lane.
_HALF_LANE_M, _REACH_M = 1.8, 6.0
_SIMPLER_PX = 1.0
# A hole or an area that is smaller is no road.
_LEAST_M2 = 4.0
# A map that is larger is damaged: segments are 20 s long.
_LARGEST_M = 5000.0


@dataclass(frozen=True, eq=False)
class Roads:
    """Lines and areas (K, 2) in the world frame.

    Attributes:
        lanes: middles of lanes for vehicles.
        junctions: those of them that lead through a junction.
        edges: edges of the road.
        markings: painted lines, each with its layer, `lane_divider` or `road_divider`.
        crossings: outlines.
        driveways: outlines.
    """

    lanes: Sequence[FloatArray]
    junctions: Sequence[FloatArray]
    edges: Sequence[FloatArray]
    markings: Sequence[tuple[str, FloatArray]]
    crossings: Sequence[FloatArray]
    driveways: Sequence[FloatArray]


def write_roads(roads: Roads, name: str, writer: Writer, log: str) -> None:
    """Write the drivable area, painted lines, crossings and junctions; nothing without a lane.

    Raises:
        ValueError: if the map is too large.
        DataError: if it cannot be written.
    """
    if not roads.lanes:
        return
    canvas = _Canvas(roads.lanes)
    drivable = canvas.areas(_drivable(canvas, roads))
    if not drivable:
        return
    made = LogMap(name, drivable)
    for layer, line in roads.markings:
        made.expansion.add_line(layer, line)
    for outline in roads.crossings:
        made.expansion.add_area("ped_crossing", outline)
    for outline, _ in canvas.areas(canvas.lines(roads.junctions, 2 * _HALF_LANE_M)):
        made.expansion.add_area("road_segment", outline, is_intersection=True)
    made.write(writer, log)


def _drivable(canvas: _Canvas, roads: Roads) -> BoolArray:
    """Return the pixels within reach of a lane, neither behind an edge nor in a driveway."""
    lanes = canvas.lines(roads.lanes, 2 * _HALF_LANE_M)
    free = ~canvas.lines(roads.edges, 0) & (lanes | ~canvas.filled(roads.driveways))
    reached = (canvas.lines(roads.lanes, 0) & free).astype(np.uint8)
    for step in range(round(_REACH_M * _PX_PER_M)):
        # Crosses and squares in turn grow octagons, which are nearly circles.
        shape = cv2.MORPH_CROSS if step % 2 else cv2.MORPH_RECT
        reached = np.asarray(cv2.dilate(reached, cv2.getStructuringElement(shape, (3, 3))), np.uint8) & free
    # An edge itself is a pixel of the road.
    return cv2.morphologyEx(reached, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8)) > 0


class _Canvas:
    """Pixels around lines in the world frame; first row = smallest y."""

    def __init__(self, lines_m: Sequence[FloatArray]) -> None:
        points = np.concatenate(lines_m)
        self._low_m = points.min(axis=0) - _MARGIN_M
        size = points.max(axis=0) + _MARGIN_M - self._low_m
        if size.max() > _LARGEST_M:
            raise ValueError(f"expected a map of up to {_LARGEST_M:g} m, got {size.max():.0f} m")
        columns, rows = np.ceil(size * _PX_PER_M).astype(int).tolist()
        self._shape = rows, columns

    def lines(self, lines_m: Sequence[FloatArray], width_m: float) -> BoolArray:
        """Return the pixels of lines of a width; 0: one pixel, without gaps even between neighbours at corners."""
        image = self._empty()
        cv2.polylines(image, self._pixels(lines_m), False, 1, max(1, round(width_m * _PX_PER_M)), cv2.LINE_4)
        return image > 0

    def filled(self, outlines_m: Sequence[FloatArray]) -> BoolArray:
        """Return the pixels of areas."""
        image = self._empty()
        for pixels in self._pixels(outlines_m):
            cv2.fillPoly(image, [pixels], 1)
        return image > 0

    def areas(self, image: BoolArray) -> list[Area]:
        """Return the outlines of areas, with their holes."""
        found, tree = cv2.findContours(image.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
        rings = [cv2.approxPolyDP(ring, _SIMPLER_PX, True)[:, 0] for ring in found]
        large = [len(ring) > 2 and cv2.contourArea(ring) >= _LEAST_M2 * _PX_PER_M**2 for ring in rings]
        outlines = [self._low_m + (ring + 0.5) / _PX_PER_M for ring in rings]
        areas = []
        for index, outline in enumerate(outlines):
            if large[index] and tree[0, index, 3] < 0:
                holes = (other for other in range(len(rings)) if tree[0, other, 3] == index and large[other])
                areas.append((outline, tuple(outlines[hole] for hole in holes)))
        return areas

    def _pixels(self, lines_m: Sequence[FloatArray]) -> list[np.ndarray]:
        # A damaged point far away must not overflow.
        scaled = (np.floor((line - self._low_m) * _PX_PER_M) for line in lines_m)
        return [np.clip(pixels, -1e6, 1e6).astype(np.int32) for pixels in scaled]

    def _empty(self) -> ByteArray:
        return np.zeros(self._shape, np.uint8)
