"""Writer of vector maps in the format of nuScenes' map expansion, for the layers that `maps` reads."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from appocc.checks import FloatArray
from appocc.nuscenes.writer import token_of


class MapExpansion:
    """Collects nodes, lines, polygons and layers; tokens depend on the name of the map and their order."""

    def __init__(self, name: str) -> None:
        """Start an empty map."""
        self._name = name
        areas = ("drivable_area", "stop_line", "road_segment", "ped_crossing", "carpark_area")
        layers = ("node", "line", "polygon", "lane_divider", "road_divider", *areas)
        self.tables: dict[str, Any] = {"version": "1.3", **{layer: [] for layer in layers}}

    def add_drivable(self, outline_m: FloatArray, holes_m: Iterable[FloatArray] = ()) -> None:
        """Add a drivable area with outline (N, 2) and holes, world frame."""
        holes = [{"node_tokens": self._nodes(hole)} for hole in holes_m]
        self._add("drivable_area", polygon_tokens=[self._polygon(outline_m, holes)])

    def add_line(self, layer: str, line_m: FloatArray) -> None:
        """Add a painted line (N, 2), world frame, to `lane_divider` or `road_divider`."""
        self._add(layer, line_token=self._add("line", node_tokens=self._nodes(line_m)))

    def add_area(self, layer: str, outline_m: FloatArray, **fields: Any) -> None:
        """Add an area with outline (N, 2), world frame, to a layer of single polygons, with further fields."""
        self._add(layer, polygon_token=self._polygon(outline_m, []), **fields)

    def _add(self, layer: str, **fields: Any) -> str:
        rows = self.tables[layer]
        rows.append({"token": token_of("map", self._name, layer, len(rows)), **fields})
        return str(rows[-1]["token"])

    def _polygon(self, outline_m: FloatArray, holes: list[Any]) -> str:
        return self._add("polygon", exterior_node_tokens=self._nodes(outline_m), holes=holes)

    def _nodes(self, xy_m: FloatArray) -> list[str]:
        return [self._add("node", x=round(float(x), 3), y=round(float(y), 3)) for x, y in xy_m]
