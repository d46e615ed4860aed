"""Options of the command itself, before the name of a sub-command."""

from __future__ import annotations

from pathlib import Path

import pytest
from in_process import run_command

from appocc import __version__


def test_the_version(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    done = run_command(["--version"], capsys, monkeypatch)
    assert (done.returncode, done.stdout) == (0, f"appocc {__version__}\n")


def test_quiet_prints_errors_only(
    tiny_root: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    words = ["check-rig", str(tiny_root), "--out", str(tmp_path / "rig.png")]
    assert "CAM_FRONT" in run_command(words, capsys, monkeypatch).stderr
    quiet = run_command(["-q", *words], capsys, monkeypatch)
    assert (quiet.returncode, quiet.stdout, quiet.stderr) == (0, "", "")
    wrong = run_command(["-q", *words, "--frame", "9"], capsys, monkeypatch)
    assert wrong.returncode == 2
    assert wrong.stderr.startswith("error: ")
    assert '"cameras"' in run_command(["-q", *words, "--json"], capsys, monkeypatch).stdout


def test_verbose_shows_where_an_error_arose(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    words = ["track", "scene", str(tmp_path)]
    assert "Traceback" not in run_command(words, capsys, monkeypatch).stderr
    done = run_command(["-v", *words], capsys, monkeypatch)
    assert done.returncode == 2
    assert "Traceback" in done.stderr
    assert done.stderr.splitlines()[-1].startswith("error: ")
