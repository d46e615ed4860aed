"""The console script without the seconds that a process of its own takes to start."""

from __future__ import annotations

import signal
from collections.abc import Sequence
from typing import NamedTuple

import pytest

from cli.main import run


class Ended(NamedTuple):
    """How a command ended: its exit code, and what it wrote."""

    returncode: int
    stdout: str
    stderr: str


def run_command(words: Sequence[str], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Ended:
    """Run `appocc WORDS`, from its entry point to its exit code."""
    code, before = 0, signal.getsignal(signal.SIGTERM)
    capsys.readouterr()
    with monkeypatch.context() as patched:
        patched.setattr("sys.argv", ["appocc", *words])
        try:
            run()
        except SystemExit as ended:
            code = int(ended.code or 0)
        finally:
            signal.signal(signal.SIGTERM, before)
    return Ended(code, *capsys.readouterr())
