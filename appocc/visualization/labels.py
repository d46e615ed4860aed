"""Placement of non-overlapping labels: a short text, with or without a colour chip."""

from __future__ import annotations

import cv2
import numpy as np

from appocc.checks import ByteArray, FloatArray
from appocc.visualization.canvas import BLACK, UNKNOWN_COLOUR, Colour, put_text

_SCALE, _HEIGHT_PX, _CHIP_PX = 0.4, 13, 11


class LabelPlacer:
    """Places labels on an image without overlaps; draw important labels first."""

    def __init__(self, picture: ByteArray, avoid: FloatArray | None = None) -> None:
        """Start with an image (H, W, 3) and rectangles to avoid (K, 4): left, top, right, bottom."""
        self._picture = picture
        self._avoid = np.zeros((0, 4)) if avoid is None else avoid
        self._taken = np.zeros((0, 4))

    def put(self, at: tuple[int, int], text: str, ink: Colour, chip: FloatArray | None, away_px: int) -> bool:
        """Draw a label right, left, above or below a pixel (column, row), at a distance of `away_px`.

        `chip` is a colour (3,) to show before the text; None: only the text, on a darkened ground. Returns whether
        there was room; without room, nothing is drawn.
        """
        (wide, _), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, _SCALE, 1)
        before = 1 if chip is None else _CHIP_PX + 3
        wide += before + 1
        half = _HEIGHT_PX // 2
        corners = [
            (at[0] + away_px, at[1] - half),
            (at[0] - away_px - wide, at[1] - half),
            (at[0] - wide // 2, at[1] - away_px - _HEIGHT_PX),
            (at[0] - wide // 2, at[1] + away_px),
        ]
        boxes = [np.array([left, top, left + wide, top + _HEIGHT_PX], dtype=np.float64) for left, top in corners]
        free = [box for box in boxes if self._inside(box) and not _overlap(box, self._taken)]
        if not free:
            return False
        box = min(free, key=lambda box: _overlap(box, self._avoid))
        left, top = int(box[0]), int(box[1])
        self._taken = np.vstack([self._taken, box])
        if chip is None:
            behind = self._picture[top : top + _HEIGHT_PX, left : left + wide]
            behind[:] = behind // 3
        else:
            draw_colour_chip(self._picture, (left, top + 1), chip)
        put_text(self._picture, text, (left + before, top + _HEIGHT_PX - 2), ink, _SCALE)
        return True

    def _inside(self, box: FloatArray) -> bool:
        height, width = self._picture.shape[:2]
        return bool((box >= 0).all() and box[2] <= width and box[3] <= height)


def _overlap(box: FloatArray, others: FloatArray) -> int:
    """Return the number of rectangles (K, 4) that overlap a rectangle (4,)."""
    apart = (others[:, :2] >= box[2:]) | (others[:, 2:] <= box[:2])
    return int((~apart.any(axis=1)).sum())


def draw_colour_chip(picture: ByteArray, corner: tuple[int, int], rgb: FloatArray, side_px: int = _CHIP_PX) -> None:
    """Draw a square of a colour (3,) with its upper left corner at (column, row); crossed out if unknown."""
    known = bool(np.isfinite(rgb).all())
    red, green, blue = (int(v) for v in (rgb if known else np.array(UNKNOWN_COLOUR)))
    opposite = (corner[0] + side_px - 1, corner[1] + side_px - 1)
    cv2.rectangle(picture, corner, opposite, (red, green, blue), -1)
    cv2.rectangle(picture, corner, opposite, BLACK, 1)
    if not known:
        cv2.line(picture, corner, opposite, BLACK, 1)
