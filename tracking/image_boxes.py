"""Rectangles in images, (N, 4) left, top, right, bottom: what they have in common, and which of them KITTI judges."""

from __future__ import annotations

import numpy as np

from appocc.checks import BoolArray, FloatArray

LEAST_HEIGHT_PX, MOST_IN_REGION = 25.0, 0.5


def common_px(one: FloatArray, other: FloatArray) -> FloatArray:
    """(N, M) areas that boxes (N, 4) and (M, 4) have in common."""
    start, end = np.maximum(one[:, None, :2], other[:, :2]), np.minimum(one[:, None, 2:], other[:, 2:])
    return np.asarray(np.prod(np.maximum(end - start, 0.0), axis=2))


def judged(boxes_px: FloatArray, regions_px: FloatArray) -> BoolArray:
    """(M,) KITTI's rule, whether unmatched tracks with boxes (M, 4) count as wrong beside regions (K, 4).

    Not judged is who is 25 pixels high or less, or lies by more than half in one region of unmarked objects.
    """
    size = boxes_px[:, 2:] - boxes_px[:, :2]
    excused = (common_px(boxes_px, regions_px) > MOST_IN_REGION * size.prod(axis=1)[:, None]).any(axis=1)
    return np.asarray((size[:, 1] > LEAST_HEIGHT_PX) & ~excused)
