"""Maps of imported logs: a mask of the drivable area, and a vector map of its own for each log."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from appocc.checks import BoolArray, FloatArray
from appocc.files import write_image, write_json
from appocc.nuscenes.map_writer import MapExpansion
from appocc.nuscenes.maps import PX_PER_M, Area
from appocc.nuscenes.writer import Writer, token_of

_MARGIN_M = 5.0
# Outlines of merged areas may be off by this much.
_SIMPLER_PX = 2.0


class LogMap:
    """The vector map of a log, in its world frame."""

    def __init__(self, name: str, drivable_m: Sequence[Area]) -> None:
        """Start with the drivable areas, outlines with holes; `name` is the location of the log."""
        points = np.concatenate([outline.reshape(-1, 2) for outline, _ in drivable_m])
        self._name = name
        self._low_m = np.floor(points.min(axis=0) - _MARGIN_M)
        size = np.ceil((points.max(axis=0) + _MARGIN_M - self._low_m) * PX_PER_M).astype(int)
        self._shape = (int(size[1]), int(size[0]))
        self._drivable = self._raster(drivable_m)
        self.expansion = MapExpansion(name)
        for outline, holes in drivable_m:
            self.expansion.add_drivable(outline, holes)

    def merged(self, outlines_m: Sequence[FloatArray]) -> list[FloatArray]:
        """Return the outlines (K, 2) of the union of areas, within the map, without holes."""
        raster = self._raster([(outline, ()) for outline in outlines_m]).astype(np.uint8)
        found = cv2.findContours(raster, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)[0]
        simpler = [cv2.approxPolyDP(contour, _SIMPLER_PX, True)[:, 0] for contour in found]
        return [self._low_m + (pixels + 0.5) / PX_PER_M for pixels in simpler if len(pixels) > 2]

    def write(self, writer: Writer, log: str) -> None:
        """Write the mask and the vector map below the root of the writer, and the row for a log.

        The lower corner of the mask is stored as `origin_m`; readers without this field see a shifted mask.

        Raises:
            DataError: if a file cannot be written.
        """
        token = token_of("map", self._name)
        filename = f"maps/{token}.png"
        grey = self._drivable[::-1].astype(np.uint8) * 255
        write_image(writer.root / filename, np.ascontiguousarray(grey))
        write_json(writer.root / "maps" / "expansion" / f"{self._name}.json", self.expansion.tables, indent=None)
        writer.add(
            "map",
            token,
            category="semantic_prior",
            filename=filename,
            log_tokens=[log],
            origin_m=self._low_m.tolist(),
        )

    def _raster(self, areas_m: Sequence[Area]) -> BoolArray:
        """Return the pixels (rows, columns) of areas, first row = smallest y."""
        raster = np.zeros(self._shape, np.uint8)
        for outline, holes in areas_m:
            rings = [np.floor((ring - self._low_m) * PX_PER_M).astype(np.int32) for ring in (outline, *holes)]
            cv2.fillPoly(raster, rings, 1)
        return raster > 0
