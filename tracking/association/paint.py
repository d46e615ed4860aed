"""Density of paint colours among vehicles."""

from __future__ import annotations

import numpy as np

from appocc.checks import FloatArray
from tracking.compiled import compiled

# Mixture of two Gaussians in CIELAB: white, grey and black paints, and all others.
_MEAN = np.array([55.0, 0.0, 0.0])
_STDS = np.array([[30.0, 4.0, 5.0], [30.0, 25.0, 25.0]])
_PEAKS = np.array([0.7, 0.3]) / _STDS.prod(axis=1)


def paint_density(lab: FloatArray) -> FloatArray:
    """Return the density (N,) of CIELAB colours (N, 3) among vehicles, up to a Gaussian's factors of 2 pi."""
    density = np.zeros(len(lab))
    _add_density(lab, density)
    return density


@compiled
def _add_density(lab: FloatArray, density: FloatArray) -> None:
    """Add the density (N,) of colours (N, 3), see `paint_density`."""
    for n in range(len(lab)):
        for paint in range(len(_PEAKS)):
            chi2 = 0.0
            for k in range(3):
                chi2 += ((lab[n, k] - _MEAN[k]) / _STDS[paint, k]) ** 2
            density[n] += _PEAKS[paint] * np.exp(-chi2 / 2)
