"""How far a training has come, and the learning rate that belongs there."""

from __future__ import annotations

import math
from dataclasses import dataclass

# One-cycle (Smith and Topin 2018): begin at lr / 25, end at lr / 10,000.
_BEGIN, _END = 1 / 25, 1e-4


@dataclass(frozen=True)
class Budget:
    """What may be spent: steps, or seconds of steps; the other is None."""

    steps: int | None
    seconds: float | None

    def share(self, steps: int, seconds: float) -> float:
        """Share of the budget that is spent, 0..1."""
        if self.steps is not None:
            return min(1.0, steps / self.steps)
        assert self.seconds is not None
        return min(1.0, seconds / self.seconds)


def learning_rate(share: float, highest: float, warmup: float) -> float:
    """One-cycle: up to the highest rate over a share `warmup` of the budget, then down, both as half a cosine."""
    if share < warmup:
        return _between(_BEGIN * highest, highest, share / warmup)
    return _between(highest, _END * highest, (share - warmup) / (1 - warmup) if warmup < 1 else 0.0)


def ema_decay(step: int, decay: float) -> float:
    """How much of the average stays after step `step` (from 1): less at first, when it holds little but the start."""
    return min(decay, (1 + step) / (10 + step))


def _between(start: float, end: float, share: float) -> float:
    return end + (start - end) * (1 + math.cos(math.pi * share)) / 2
