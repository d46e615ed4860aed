"""The map of the demo: nuScenes' drivable-area mask and the layers of its map expansion that are read here."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

from appocc.checks import ByteArray, FloatArray
from appocc.demo.street import (
    HIGH_M,
    LOW_M,
    centre_lines,
    drivable_areas,
    in_world,
    lane_lines,
    rectangle,
    stop_lines,
)
from appocc.nuscenes.writer import token_of


def mask(px_per_m: int) -> ByteArray:
    """Drivable-area mask of the world from (0, 0) on, top row = largest y: 255 drivable, 0 not."""
    low, high = LOW_M.tolist(), HIGH_M.tolist()
    corners = in_world(rectangle(low[0], high[0], low[1], high[1]))
    width, height = (np.ceil(corners.max(axis=0)) * px_per_m).astype(int)
    picture = np.zeros((height, width), np.uint8)
    for area in drivable_areas():
        cv2.fillConvexPoly(picture, np.round(in_world(area) * px_per_m - 0.5).astype(np.int32), 255)
    return np.ascontiguousarray(picture[::-1])


def map_expansion() -> dict[str, Any]:
    """The vector map in the layout of nuScenes' map expansion, world frame: the layers that are read here."""
    made = _Expansion()
    for area in drivable_areas():
        made.add("drivable_area", polygon_tokens=[made.polygon(area)])
    for line in lane_lines():
        made.add("lane_divider", line_token=made.line(line))
    for line in centre_lines():
        made.add("road_divider", line_token=made.line(line))
    for area in stop_lines():
        made.add("stop_line", polygon_token=made.polygon(area))
    return made.tables


class _Expansion:
    """Collects nodes, lines, polygons and layers; tokens follow from their order."""

    def __init__(self) -> None:
        self.tables: dict[str, Any] = {"version": "1.3", "node": [], "line": [], "polygon": []}

    def add(self, layer: str, **fields: Any) -> str:
        rows = self.tables.setdefault(layer, [])
        rows.append({"token": token_of("map", layer, len(rows)), **fields})
        return str(rows[-1]["token"])

    def line(self, xy_m: FloatArray) -> str:
        return self.add("line", node_tokens=self._nodes(xy_m))

    def polygon(self, xy_m: FloatArray) -> str:
        return self.add("polygon", exterior_node_tokens=self._nodes(xy_m), holes=[])

    def _nodes(self, xy_m: FloatArray) -> list[str]:
        return [self.add("node", x=float(x), y=float(y)) for x, y in in_world(xy_m)]
