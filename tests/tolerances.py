"""Tolerances of tests that compute one thing in two ways: from the type, the length of the sums and the size of numbers.

Processors, libraries and numbers of threads add in other orders; no tolerance is chosen by what one machine gave.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from appocc.models.rounding import rounding


def assert_rounded(found: Any, expected: Any, terms: int = 1, size: float | None = None) -> None:
    """Two ways of computing the same agree up to rounding.

    Args:
        found: arrays, tensors or numbers of one shape; those of Python count as float64.
        expected: the same by the other way.
        terms: of the sums in it, one after the other; `terms_of` a network.
        size: of the largest number on the way; None: of the expected ones.
    """
    one, other = _array(found), _array(expected)
    largest = float(np.abs(other[np.isfinite(other)]).max(initial=0.0)) if size is None else size
    np.testing.assert_allclose(one, other, rtol=0, atol=tolerance(terms, largest, found, expected))


def tolerance(terms: int, size: float, *values: Any) -> float:
    """The largest difference that rounding explains, in the coarsest type among some values."""
    return max(rounding(terms, _dtype(value)) for value in values) * size


def _array(values: Any) -> NDArray[np.float64]:
    plain = values.detach().double().numpy() if isinstance(values, Tensor) else values
    return np.asarray(plain, np.float64)


def _dtype(values: Any) -> torch.dtype:
    if isinstance(values, torch.dtype):
        return values
    if isinstance(values, Tensor):
        return values.dtype
    kind = np.asarray(values).dtype
    return torch.float32 if kind == np.float32 else torch.float64
