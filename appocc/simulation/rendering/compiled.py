"""How the kernels are compiled, and when what was compiled is out of date."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba

# Reordering and reciprocals are welcome; infinite distances must stay what they are.
_OPTIONS: dict[str, Any] = {
    "nogil": True,
    "fastmath": {"reassoc", "contract", "arcp", "nsz", "afn"},
    "error_model": "numpy",
    "no_cfunc_wrapper": True,  # leaving it out shortens the first run
}
_Function = TypeVar("_Function", bound=Callable[..., Any])


def kernel(function: _Function) -> _Function:
    """Compile a function over many elements."""
    return _kept(function, {})


def outer(function: _Function) -> _Function:
    """Compile a function over many elements that makes no arrays, without counting references to those it is given.

    Small functions that pass tuples of arrays on would spend two thirds of their time on the counts.
    """
    return _kept(function, {"_nrt": False})


def inner(function: _Function) -> _Function:
    """Compile a function that others call for each element: it makes no arrays, and becomes a part of its callers."""
    options: dict[str, Any] = {**_OPTIONS, "_nrt": False, "forceinline": True}
    compiled: _Function = numba.njit(**options)(function)
    return compiled


def _stamp() -> tuple[float, int]:
    """When any module of this package was last changed, and their size."""
    files = [path.stat() for path in Path(__file__).parent.glob("*.py")]
    return max(file.st_mtime for file in files), sum(file.st_size for file in files)


_STAMP = _stamp()


def _kept(function: _Function, more: dict[str, Any]) -> _Function:
    """Compile, and make the copy on disk depend on the whole package: numba looks at the function's own module only.

    A kernel with old versions of the small functions of other modules inside would read beyond its arrays. Numba
    compares the version before it unpickles an index: one that names modules which are gone is never unpickled.
    """
    options: dict[str, Any] = {**_OPTIONS, **more, "cache": True}
    compiled: Any = numba.njit(**options)(function)
    index: Any = getattr(getattr(compiled, "_cache", None), "_cache_file", None)
    if hasattr(index, "_version"):
        index._version = (numba.__version__, *_STAMP)
    result: _Function = compiled
    return result
