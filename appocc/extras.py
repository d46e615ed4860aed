"""Lazy import of the packages of the optional extras."""

from __future__ import annotations

import warnings
from importlib import import_module
from typing import Any

from appocc.errors import AppoccError


def import_extra(name: str, extra: str, purpose: str) -> Any:
    """Import a module of an extra and return it.

    Args:
        name: the module.
        extra: name of the extra in pyproject.toml.
        purpose: what needs it, as in "exporting".

    Raises:
        AppoccError: if it is not installed or cannot be imported.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # deprecations among these packages
            return import_module(name)
    except ImportError as error:
        reason = " ".join(str(error).split())
        raise AppoccError(f"{purpose} needs {name}: pip install '.[{extra}]' ({reason})") from error
