"""Bounds on rounding errors: instruction sets and threads change the order of the sums in a network."""

from __future__ import annotations

import math

import torch
from torch import nn

# Rounding errors add up like a random walk, which rarely exceeds a few standard deviations.
_DEVIATIONS = 8.0


def rounding(terms: int, dtype: torch.dtype = torch.float32) -> float:
    """Return the largest relative difference to expect between two orders of the same sums.

    Args:
        terms: number of terms of all consecutive sums; each may round once.
        dtype: type of the computation.
    """
    return _DEVIATIONS * torch.finfo(dtype).eps * math.sqrt(terms)


def count_terms(model: nn.Module) -> int:
    """Count the terms of all sums between the images and an output of a network: weights per output, by layer."""
    return sum(weight[0].numel() for weight in model.parameters() if weight.ndim > 1)
