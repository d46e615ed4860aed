"""Compilation of the numba kernels, and invalidation of their cache."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba

# Reordering and reciprocals are allowed; infinite distances must stay infinite.
_OPTIONS: dict[str, Any] = {
    "nogil": True,
    "fastmath": {"reassoc", "contract", "arcp", "nsz", "afn"},
    "error_model": "numpy",
    "no_cfunc_wrapper": True,  # saves time in the first run
}
_Function = TypeVar("_Function", bound=Callable[..., Any])


def kernel(function: _Function) -> _Function:
    """Compile a function over many elements."""
    return _compile_cached(function, {})


def array_free_kernel(function: _Function) -> _Function:
    """Compile a function over many elements that allocates no arrays, without reference counting.

    Otherwise, small functions that pass on tuples of arrays spend two thirds of their time on reference counting.
    """
    return _compile_cached(function, {"_nrt": False})


def inlined(function: _Function) -> _Function:
    """Compile a function that kernels call per element: it allocates no arrays and is inlined."""
    options: dict[str, Any] = {**_OPTIONS, "_nrt": False, "forceinline": True}
    compiled: _Function = numba.njit(**options)(function)
    return compiled


def _stamp() -> tuple[float, int]:
    """Return the latest modification time of this package's modules, and their total size."""
    files = [path.stat() for path in Path(__file__).parent.glob("*.py")]
    return max(file.st_mtime for file in files), sum(file.st_size for file in files)


_STAMP = _stamp()


def _compile_cached(function: _Function, more: dict[str, Any]) -> _Function:
    """Compile a function and make its cache depend on the whole package, not only on the function's own module.

    A kernel with outdated inlined functions of other modules would read beyond its arrays. Numba compares the version
    before it unpickles an index, so an index that refers to removed modules is never unpickled.
    """
    options: dict[str, Any] = {**_OPTIONS, **more, "cache": True}
    compiled: Any = numba.njit(**options)(function)
    index: Any = getattr(getattr(compiled, "_cache", None), "_cache_file", None)
    if hasattr(index, "_version"):
        index._version = (numba.__version__, *_STAMP)
    result: _Function = compiled
    return result
