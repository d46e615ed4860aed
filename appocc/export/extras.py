"""The packages of the extra `export`, imported only where they are used."""

from __future__ import annotations

import warnings
from importlib import import_module
from types import ModuleType

from appocc.errors import AppoccError

_MISSING = "exporting needs {name}: pip install 'appocc[export]'"


def package(name: str) -> ModuleType:
    """A package of the extra.

    Raises:
        AppoccError: if it is not installed, or does not run here.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # what they use of each other is not ours to mend
            return import_module(name)
    except ImportError as error:
        raise AppoccError(f"{_MISSING.format(name=name)} ({' '.join(str(error).split())})") from error
