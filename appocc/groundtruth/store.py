"""Coloured points of a scene on disk, in strips of the world, so that one strip at a time is in memory."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from appocc.groundtruth.colouring import ColouredPoints

FINE_M = 0.1
_STRIP_CELLS = 80  # along x, in fine cells
_ROW = np.dtype([("xyz_m", np.float32, 3), ("rgb", np.uint8, 3), ("camera", np.uint8), ("ground", np.uint8)])


class PointStore:
    """Files of points, one per strip of 8 m along x; points keep the order in which they were added."""

    def __init__(self, folder: Path) -> None:
        """Store points in an empty folder."""
        self._folder = folder
        self.strips: set[int] = set()

    def add(self, points: ColouredPoints) -> None:
        """Add the points of a sweep.

        Raises:
            OSError: if they cannot be written.
        """
        rows = np.empty(len(points.xyz_m), _ROW)
        for name in _ROW.names or ():
            rows[name] = getattr(points, name)
        strip = np.floor(points.xyz_m[:, 0] / FINE_M).astype(np.int64) // _STRIP_CELLS
        for number in np.unique(strip).tolist():
            with self._file(number).open("ab") as file:
                file.write(rows[strip == number].tobytes())
            self.strips.add(number)

    def strip(self, number: int) -> ColouredPoints:
        """Return all points of a strip; empty if it has none."""
        rows = np.fromfile(self._file(number), _ROW) if number in self.strips else np.empty(0, _ROW)
        return ColouredPoints(*(np.ascontiguousarray(rows[name]) for name in _ROW.names or ()))

    def _file(self, number: int) -> Path:
        return self._folder / f"strip{number}"
