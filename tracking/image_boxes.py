"""Image boxes (N, 4), left, top, right, bottom: intersections, and KITTI's rule for false positives."""

from __future__ import annotations

import numpy as np

from appocc.checks import BoolArray, FloatArray

MIN_HEIGHT_PX, MAX_REGION_SHARE = 25.0, 0.5


def intersection_px2(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return the intersection areas (N, M) of boxes (N, 4) and (M, 4)."""
    start, end = np.maximum(one[:, None, :2], other[:, :2]), np.minimum(one[:, None, 2:], other[:, 2:])
    return np.asarray(np.prod(np.maximum(end - start, 0.0), axis=2))


def kitti_penalised(boxes_px: FloatArray, regions_px: FloatArray) -> BoolArray:
    """(M,) whether unmatched tracks with boxes (M, 4) are false positives, given DontCare regions (K, 4).

    Boxes up to 25 pixels high, or with more than half of their area in one region, are not penalised.
    """
    size = boxes_px[:, 2:] - boxes_px[:, :2]
    covered = (intersection_px2(boxes_px, regions_px) > MAX_REGION_SHARE * size.prod(axis=1)[:, None]).any(axis=1)
    return np.asarray((size[:, 1] > MIN_HEIGHT_PX) & ~covered)
