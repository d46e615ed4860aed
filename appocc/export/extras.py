"""Lazy import of the packages of the extra `export`."""

from __future__ import annotations

from typing import Any

from appocc.extras import import_extra


def import_package(name: str) -> Any:
    """Import a package of the extra.

    Raises:
        AppoccError: if it is not installed or cannot be imported.
    """
    return import_extra(name, "export", "exporting")
