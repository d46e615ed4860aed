"""SUMO's tools; only the generation of new towns needs them."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from types import ModuleType

from appocc.errors import AppoccError, DataError

_MISSING = "generating a town needs SUMO: pip install '.[sumo]'"


def load_sumo() -> ModuleType:
    """Return the module libsumo.

    Raises:
        AppoccError: if it is not installed.
    """
    try:
        return import_module("libsumo")
    except ImportError as error:
        raise AppoccError(f"{_MISSING} ({error})") from error


@contextmanager
def captured_errors() -> Iterator[list[str]]:
    """Capture what a library writes to stderr; at the end, the list holds its error lines."""
    errors: list[str] = []
    sys.stderr.flush()
    kept = os.dup(2)
    with tempfile.TemporaryFile() as heard:
        os.dup2(heard.fileno(), 2)
        try:
            yield errors
        finally:
            os.dup2(kept, 2)
            os.close(kept)
            heard.seek(0)
            errors += _errors(heard.read().decode(errors="replace"))


def _errors(text: str) -> list[str]:
    lines = [line.strip() for line in text.splitlines()]
    return [line.removeprefix("Error:").strip() for line in lines if line.startswith("Error:")]


def netconvert(source: Path, arguments: list[str]) -> None:
    """Run SUMO's netconvert; `source` is the file named in the error message.

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
        reason = next(iter(_errors(done.stderr)), f"netconvert ended with {done.returncode}")
        raise DataError(f"{source}: no road network ({reason})")
