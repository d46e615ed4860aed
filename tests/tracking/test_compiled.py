"""Compiled loops where nothing but the temporary folder can be written."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

CODE = """
import tempfile

import appocc.environment

appocc.environment._writable = lambda folder: str(folder).startswith(tempfile.gettempdir())
import tracking
import numba

print(numba.config.CACHE_DIR)
"""


def test_the_loops_are_cached_in_a_private_folder_where_the_package_cannot_be_written(tmp_path: Path) -> None:
    environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    done = subprocess.run(
        [sys.executable, "-c", CODE],
        env={**environment, "TMPDIR": str(tmp_path)},
        cwd=Path(__file__).parents[2],
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.strip() == str(tmp_path / f"appocc-{os.getuid()}" / "numba")
