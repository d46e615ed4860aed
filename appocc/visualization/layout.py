"""Arrangement of RGB pictures (H, W, 3) on white."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from appocc.checks import ByteArray


def resized(picture: ByteArray, scale: float) -> ByteArray:
    """Return a picture enlarged or reduced by a factor."""
    size = (max(round(picture.shape[1] * scale), 1), max(round(picture.shape[0] * scale), 1))
    how = cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC
    return np.asarray(cv2.resize(picture, size, interpolation=how), np.uint8)


def side_by_side(pictures: Sequence[ByteArray], gap_px: int = 0) -> ByteArray:
    """Return pictures in a row with gaps between them; they begin at the top."""
    height = max(picture.shape[0] for picture in pictures)
    gaps = [0, *[gap_px] * (len(pictures) - 1)]
    return np.hstack(
        [_padded(p, bottom=height - p.shape[0], left=gap) for p, gap in zip(pictures, gaps, strict=True)]
    )


def stack_centred(pictures: Sequence[ByteArray]) -> ByteArray:
    """Return pictures one below the other, each in the middle of the width."""
    width = max(picture.shape[1] for picture in pictures)
    missing = [width - picture.shape[1] for picture in pictures]
    return np.vstack([_padded(p, left=m // 2, right=m - m // 2) for p, m in zip(pictures, missing, strict=True)])


def _padded(picture: ByteArray, bottom: int = 0, left: int = 0, right: int = 0) -> ByteArray:
    return np.pad(picture, ((0, bottom), (left, right), (0, 0)), constant_values=255)
