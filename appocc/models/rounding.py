"""How far two right ways of computing a network may be apart: instruction sets and threads reorder its sums."""

from __future__ import annotations

import math

import torch
from torch import nn

# Roundings add up as a random walk, whose length is rarely beyond a few deviations.
_DEVIATIONS = 8.0


def rounding(terms: int, dtype: torch.dtype = torch.float32) -> float:
    """Largest difference between two orders of the same sums, as a share of the size of the numbers.

    Args:
        terms: of all sums, one after the other; each may round once.
        dtype: in which they are computed.
    """
    return _DEVIATIONS * torch.finfo(dtype).eps * math.sqrt(terms)


def terms_of(model: nn.Module) -> int:
    """Terms of all sums between a network's pictures and one of its answers: the weights of an output, by layer."""
    return sum(weight[0].numel() for weight in model.parameters() if weight.ndim > 1)
