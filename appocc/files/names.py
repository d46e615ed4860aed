"""Names of files that tables state: they stay below their root."""

from __future__ import annotations

import os
from pathlib import Path

from appocc.errors import DataError


def inside(root: Path, name: str) -> Path:
    """Return the path of a file below `root` that a table names.

    Only the name is checked: folders below the root may be links to other disks.

    Raises:
        DataError: if the name is empty or absolute, or has a part '..'.
    """
    if not stays_inside(name):
        raise DataError(f"{root}: the file name '{name}' leads out of this folder")
    return root / name


def stays_inside(name: str) -> bool:
    """Return whether a file name, joined to a folder, is a path below this folder."""
    parts = name.replace("\\", "/").split("/")
    anchored = not parts[0] or os.path.splitdrive(name)[0]
    return not anchored and bool(name.strip("./\\")) and ".." not in parts and "\0" not in name


def plain_name(root: Path, name: str) -> str:
    """Check a name from a table of `root` that becomes the name of a file or folder, and return it.

    Raises:
        DataError: if it is empty or has path separators.
    """
    if name in ("", ".", "..") or any(character in name for character in "/\\\0"):
        raise DataError(f"{root}: expected a name for a file, got '{name}', which is none or leads elsewhere")
    return name
