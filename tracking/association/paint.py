"""Density of paint colours among vehicles."""

from __future__ import annotations

import numpy as np

from appocc.checks import FloatArray

# Mixture of two Gaussians in CIELAB: white, grey and black paints, and all others.
_MEAN = np.array([55.0, 0.0, 0.0])
_STDS = np.array([[30.0, 4.0, 5.0], [30.0, 25.0, 25.0]])
_PEAKS = np.array([0.7, 0.3]) / _STDS.prod(axis=1)
_HALF_PRECISIONS = (1 / _STDS**2).T / 2


def paint_density(lab: FloatArray) -> FloatArray:
    """Return the density (N,) of CIELAB colours (N, 3) among vehicles, up to a Gaussian's factors of 2 pi."""
    return np.asarray(np.exp(-((lab - _MEAN) ** 2 @ _HALF_PRECISIONS)) @ _PEAKS)
