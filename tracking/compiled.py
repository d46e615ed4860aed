"""Compilation of loops over the few tracks and detections of a frame, for which many small array calls are slow."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from appocc.environment import choose_cache_folders

choose_cache_folders(Path(__file__).parent)

_Function = TypeVar("_Function", bound=Callable[..., Any])
# Without reference counting, Python's division errors and a wrapper for C, compilation takes less time.
_OPTIONS: dict[str, Any] = {
    "cache": True,
    "nogil": True,
    "error_model": "numpy",
    "no_cfunc_wrapper": True,
    "_nrt": False,
}


def compiled(function: _Function) -> _Function:
    """Compile a function when it is first called, and cache it.

    It allocates no arrays, but writes to given ones, element by element: array expressions take seconds to compile.
    Each type, memory layout and writeability is compiled anew: callers pass floats and contiguous arrays. It calls
    compiled functions of its own module only, because the cache depends on that.
    """
    import numba  # after the choice of its cache folder

    result: _Function = numba.njit(**_OPTIONS)(function)
    return result
