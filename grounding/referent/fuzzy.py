"""Fuzzy membership: degrees of truth from 0 to 1; unknown = 0.5."""

from __future__ import annotations

import numpy as np

from appocc.checks import FloatArray

UNKNOWN = 0.5


def rising(value: FloatArray, midpoint: float, scale: float) -> FloatArray:
    """Return a sigmoid of values of any shape: 0.5 at `midpoint`, 0.95 three scales above it; NaN for NaN."""
    return np.asarray(1 / (1 + np.exp(-np.clip((value - midpoint) / scale, -50, 50))))


def falling(value: FloatArray, midpoint: float, scale: float) -> FloatArray:
    """Return the mirrored sigmoid: 1 for low values, 0 for high ones."""
    return rising(-value, -midpoint, scale)


def gaussian(value: FloatArray, sigma: float) -> FloatArray:
    """Return a Gaussian membership with its peak of 1 at 0; NaN for NaN."""
    return np.asarray(np.exp(-0.5 * np.square(value / sigma)))


def fill_unknown(membership: FloatArray) -> FloatArray:
    """Replace NaN, the membership of unknown values, by 0.5."""
    return np.where(np.isnan(membership), UNKNOWN, membership)
