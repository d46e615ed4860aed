"""Soft truth: 0..1 instead of yes and no; what is unknown is half open."""

from __future__ import annotations

import numpy as np

from appocc.checks import FloatArray

UNKNOWN = 0.5


def rises(value: FloatArray, middle: float, step: float) -> FloatArray:
    """0..1 of values of any shape, a half at `middle`, almost all of it within three steps; NaN of NaN."""
    return np.asarray(1 / (1 + np.exp(-np.clip((value - middle) / step, -50, 50))))


def falls(value: FloatArray, middle: float, step: float) -> FloatArray:
    """The same the other way round: 1 of low values."""
    return rises(-value, -middle, step)


def bell(value: FloatArray, spread: float) -> FloatArray:
    """1 at 0, and less to both sides; NaN of NaN."""
    return np.asarray(np.exp(-0.5 * np.square(value / spread)))


def half_open(fit: FloatArray) -> FloatArray:
    """The same with a half where it is NaN, because a value that it depends on is unknown."""
    return np.where(np.isnan(fit), UNKNOWN, fit)
