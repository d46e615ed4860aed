"""Exposure of dark pictures: they are brightened for the network, and its colours are darkened by as much again."""

from __future__ import annotations

import math

from torch import Tensor

# Mean of sRGB, 0..1, up to which pictures are brightened; those by day are brighter, simulated and real ones.
DARK = 0.3
_LEAST_MEAN, _LEAST_EXPONENT = 0.02, 0.35


def brightening_exponent(images: Tensor) -> float:
    """Return the exponent, 0..1, that brings the mean of all images of a frame near `DARK`; 1 if they are brighter.

    One exponent for all cameras keeps their differences, as between sun and shade.

    Args:
        images: sRGB in [0, 1], of any shape.
    """
    mean = max(float(images.mean()), _LEAST_MEAN)
    return max(math.log(DARK) / math.log(mean), _LEAST_EXPONENT) if mean < DARK else 1.0
