"""Trace the outlines of raster areas as polygons without holes."""

from __future__ import annotations

import cv2
import numpy as np

from appocc.checks import ByteArray, FloatArray
from appocc.polylines import normals
from appocc.simulation.surface import CELL_M

_SIMPLE_CELLS = 0.6


def trace_outlines(mask: ByteArray, low_m: FloatArray) -> tuple[FloatArray, ...]:
    """Return the outlines (N, 2), town frame, of a mask (H, W) uint8 of 0 and 1; no area has a hole.

    The mask is cut along rows through every hole, so that each hole touches the border of an area.
    """
    rows = _rows_through_holes(mask)
    found = []
    for low, high in zip([0, *rows], [*rows, len(mask)], strict=True):
        contours, _ = cv2.findContours(mask[low:high], cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        for contour in contours:
            if len(contour) > 2:
                cells = _widen(contour[:, 0].astype(np.float64)) + np.array([0.5, low + 0.5])
                found.append(cells * CELL_M + low_m)
    return tuple(found)


def _rows_through_holes(mask: ByteArray) -> list[int]:
    """Return the smallest set of rows such that each hole has cells on both sides of one, or begins at one."""
    contours, family = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_SIMPLE)
    holes = [] if family is None else [c for c, f in zip(contours, family[0], strict=True) if f[3] >= 0]
    spans = sorted((int(hole[:, 0, 1].max()) - 1, int(hole[:, 0, 1].min()) + 1) for hole in holes)
    rows: list[int] = []
    for last, first in spans:
        if not rows or rows[-1] < first:
            rows.append(last)
    return rows


def _widen(contour: FloatArray) -> FloatArray:
    """Move a contour from the centres of the outermost cells to their outer edges, and simplify it."""
    around = np.concatenate([contour[-1:], contour, contour[:1]])
    # OpenCV's contours run counter-clockwise with y down, so the outside is to the left here.
    out = (contour + normals(around)[1:-1] * 0.5).astype(np.float32)
    return np.asarray(cv2.approxPolyDP(out[:, None], _SIMPLE_CELLS, True)[:, 0], dtype=np.float64)
