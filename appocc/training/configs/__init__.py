"""Shipped training configurations: `appocc train small` reads `small.yaml` of this folder."""

from __future__ import annotations

from pathlib import Path

from appocc.errors import DataError

FOLDER = Path(__file__).parent


def config_names() -> tuple[str, ...]:
    """Return the names of the shipped configurations."""
    return tuple(sorted(path.stem for path in FOLDER.glob("*.yaml")))


def config_path(name_or_path: Path) -> Path:
    """Return the file of a configuration: an existing file, otherwise the shipped configuration of this name.

    Raises:
        DataError: if it is neither.
    """
    if name_or_path.exists() and not name_or_path.is_dir():
        return name_or_path
    names = config_names()
    if str(name_or_path) in names:
        return FOLDER / f"{name_or_path}.yaml"
    raise DataError(f"{name_or_path}: cannot be read (no such file; shipped are {', '.join(names)})")
