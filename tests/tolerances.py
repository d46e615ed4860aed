"""Tolerances of tests that compute one thing in two ways: from the type, the length of sums, the size of numbers.

Processors, libraries and numbers of threads add in other orders; no tolerance is what one machine happened to give.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from appocc.models.rounding import rounding


def assert_rounded(
    found: Any, expected: Any, terms: int = 1, size: float | None = None, dtype: torch.dtype | None = None
) -> None:
    """Two ways of computing the same agree up to rounding.

    Args:
        found: arrays, tensors or numbers of one shape; numbers of Python count as float64.
        expected: the same by the other way.
        terms: of the sums in it, one after the other; `terms_of` a network.
        size: of the largest number on the way; None: of the expected ones.
        dtype: of the coarsest step; None: the coarser type of the two.
    """
    one, other = _array(found), _array(expected)
    largest = float(np.abs(other[np.isfinite(other)]).max(initial=0.0)) if size is None else size
    share = max(rounding(terms, dtype or _dtype(values)) for values in (found, expected))
    np.testing.assert_allclose(one, other, rtol=0, atol=share * largest)


def _array(values: Any) -> NDArray[np.float64]:
    return np.asarray(values.detach().double().numpy() if isinstance(values, Tensor) else values, np.float64)


def _dtype(values: Any) -> torch.dtype:
    if isinstance(values, Tensor):
        return values.dtype
    return torch.float32 if np.asarray(values).dtype == np.float32 else torch.float64
