"""Schedules: training budget, learning rate and EMA decay."""

from __future__ import annotations

import math
from dataclasses import dataclass

# One-cycle schedule (Smith and Topin 2018): start at lr / 25, end at lr / 10,000.
_START, _END = 1 / 25, 1e-4


@dataclass(frozen=True)
class Budget:
    """Training budget, in steps or in seconds of steps; the other is None."""

    steps: int | None
    seconds: float | None

    def share(self, steps: int, seconds: float) -> float:
        """Return the spent share of the budget, 0..1."""
        if self.steps is not None:
            return min(1.0, steps / self.steps)
        assert self.seconds is not None
        return min(1.0, seconds / self.seconds)


def learning_rate(share: float, highest: float, warmup: float) -> float:
    """Return the one-cycle learning rate at a spent share of the budget.

    It rises to `highest` over the share `warmup` and falls afterwards, both along half a cosine.
    """
    if share < warmup:
        return _interpolate(_START * highest, highest, share / warmup)
    return _interpolate(highest, _END * highest, (share - warmup) / (1 - warmup) if warmup < 1 else 0.0)


def ema_decay(step: int, decay: float) -> float:
    """Return the EMA decay of a step (from 1): lower in the first steps, so that the initial weights fade fast."""
    return min(decay, (1 + step) / (10 + step))


def _interpolate(start: float, end: float, share: float) -> float:
    return end + (start - end) * (1 + math.cos(math.pi * share)) / 2
