"""`python -m appocc` in folders with modules that have the names of the project's packages."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


def launch(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "appocc", *words]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)


def test_the_package_runs_the_command(tmp_path: Path) -> None:
    done = launch(tmp_path, "weights", "--help")
    assert done.returncode == 0, done.stderr
    assert "python -m appocc weights" in done.stdout


@pytest.mark.parametrize("place", ["tracking.py", "grounding/__init__.py", "cli/__init__.py"])
def test_a_module_that_shadows_a_package_is_reported(tmp_path: Path, place: str) -> None:
    path = tmp_path / place
    path.parent.mkdir(exist_ok=True)
    path.write_text("raise SystemExit('imported')")
    done = launch(tmp_path, "--help")
    hidden, name = tmp_path / Path(place).parts[0], Path(place).parts[0].removesuffix(".py")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(
        f"error: expected the package '{name}' of appocc in {ROOT}, but {hidden} hides it: rename"
    )
    assert done.stderr.count("\n") == 1
