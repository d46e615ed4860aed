"""Bootstrap confidence intervals; scenes are resampled, since samples of one scene are correlated."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from appocc.checks import FloatArray, IntArray

LEVEL, DRAWS, SEED = 0.95, 1000, 0


def confidence_interval(scenes: int, statistic: Callable[[IntArray], float]) -> tuple[float, float] | None:
    """Return the 95 % interval of a statistic over 1,000 resamplings of the scenes; None for a single scene.

    The random seed is fixed: the same scenes give the same interval.

    Args:
        scenes: number of scenes.
        statistic: returns the statistic if scene i is drawn weights[i] times, weights (S,); NaN if undefined.
    """
    if scenes < 2:
        return None
    generator = np.random.default_rng(SEED)
    drawn = generator.multinomial(scenes, np.full(scenes, 1 / scenes), DRAWS)
    values = np.array([statistic(weights) for weights in drawn])
    values = values[np.isfinite(values)]
    if not len(values):
        return None
    low, high = np.quantile(values, [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    return float(low), float(high)


def resampled_median(values: FloatArray, scene: IntArray, weights: IntArray) -> float:
    """Return the median of values (V,), value v repeated weights[scene[v]] times; NaN if there is none."""
    drawn = np.repeat(values, weights[scene])
    return float(np.median(drawn)) if len(drawn) else float("nan")
