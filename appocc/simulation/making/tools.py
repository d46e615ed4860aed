"""SUMO's tools, which only the making of new towns needs."""

from __future__ import annotations

import subprocess
from importlib import import_module
from pathlib import Path
from types import ModuleType

from appocc.errors import AppoccError, DataError

_MISSING = "making a town needs SUMO: pip install 'appocc[sumo]'"


def simulator() -> ModuleType:
    """The module libsumo.

    Raises:
        AppoccError: if it is not installed.
    """
    try:
        return import_module("libsumo")
    except ImportError as error:
        raise AppoccError(f"{_MISSING} ({error})") from error


def netconvert(source: Path, arguments: list[str]) -> None:
    """Run SUMO's netconvert; `source` is the file that is to blame when it fails.

    Raises:
        AppoccError: if it is not installed.
        DataError: if it fails; the message holds its first error.
    """
    try:
        program = Path(import_module("sumo").SUMO_HOME) / "bin" / "netconvert"
    except ImportError as error:
        raise AppoccError(f"{_MISSING} ({error})") from error
    try:
        done = subprocess.run([program, *arguments], capture_output=True, text=True, errors="replace", check=False)
    except OSError as error:
        raise AppoccError(f"{program}: cannot be run ({error.strerror})") from error
    if done.returncode:
        errors = [line.strip() for line in done.stderr.splitlines() if line.strip().startswith("Error:")]
        reason = errors[0].removeprefix("Error:").strip() if errors else f"netconvert ended with {done.returncode}"
        raise DataError(f"{source}: no road network ({reason})")
