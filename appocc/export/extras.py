"""Lazy import of the packages of the extra `export`."""

from __future__ import annotations

import warnings
from importlib import import_module
from types import ModuleType

from appocc.errors import AppoccError

_MISSING = "exporting needs {name}: pip install 'appocc[export]'"


def import_package(name: str) -> ModuleType:
    """Import a package of the extra.

    Raises:
        AppoccError: if it is not installed or cannot be imported.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # deprecations among these packages
            return import_module(name)
    except ImportError as error:
        raise AppoccError(f"{_MISSING.format(name=name)} ({' '.join(str(error).split())})") from error
