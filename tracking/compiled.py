"""Compilation of loops over tracks and detections: a frame has few of both, so that many small array calls are slow."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numba

_Function = TypeVar("_Function", bound=Callable[..., Any])


def compiled(function: _Function) -> _Function:
    """Compile a function when it is first called, and cache it; division by zero gives infinity or NaN.

    Each memory layout and writeability of an array is compiled anew: callers pass contiguous arrays.
    """
    result: _Function = numba.njit(cache=True, nogil=True, error_model="numpy", no_cfunc_wrapper=True)(function)
    return result
