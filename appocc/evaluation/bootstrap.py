"""Confidence intervals: scenes are drawn anew, with replacement, since samples of one scene resemble each other."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from appocc.checks import FloatArray, IntArray

LEVEL, DRAWS, SEED = 0.95, 1000, 0


def interval(scenes: int, statistic: Callable[[IntArray], float]) -> tuple[float, float] | None:
    """The range in which a figure lies in 95 % of 1,000 draws of as many scenes; None of a single scene.

    The same scenes give the same range.

    Args:
        scenes: how many there are.
        statistic: the figure when scene i was drawn weights[i] times, weights (S,); NaN where it has none.
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


def median_of_drawn(values: FloatArray, scene: IntArray, weights: IntArray) -> float:
    """Median of values (V,) of scenes scene[v], each as often as its scene was drawn; NaN of none."""
    drawn = np.repeat(values, weights[scene])
    return float(np.median(drawn)) if len(drawn) else float("nan")
