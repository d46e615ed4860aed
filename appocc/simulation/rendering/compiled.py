"""How the kernels are compiled."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numba

# Reordering and reciprocals are welcome; infinite distances must stay what they are.
_MATHS = {"reassoc", "contract", "arcp", "nsz", "afn"}
_Function = TypeVar("_Function", bound=Callable[..., Any])


def kernel(function: _Function) -> _Function:
    """Compile a function that makes arrays."""
    compiled: _Function = numba.njit(cache=True, nogil=True, fastmath=_MATHS, error_model="numpy")(function)
    return compiled


def inner(function: _Function) -> _Function:
    """Compile a function that makes no arrays, without counting references to those it is given.

    Small functions that pass arrays on would spend two thirds of their time on the counts.
    """
    compiled: _Function = numba.njit(nogil=True, fastmath=_MATHS, error_model="numpy", _nrt=False)(function)
    return compiled


def outer(function: _Function) -> _Function:
    """Compile a function over many elements that makes no arrays itself."""
    compiled: _Function = numba.njit(cache=True, nogil=True, fastmath=_MATHS, error_model="numpy", _nrt=False)(function)
    return compiled
