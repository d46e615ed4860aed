"""Ctrl-C and SIGTERM end a command with one line that names the command to resume it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from cli import main
from cli.common import Interrupted

WAITING = """
import sys, time
from cli import main
main.app.command("wait")(lambda name: (print("begun", flush=True), time.sleep(600)))
main.run()
"""


@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM])
def test_interruption_prints_the_resuming_command(sent: signal.Signals) -> None:
    # Background jobs of a shell ignore Ctrl-C, and their children inherit that.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    command = [sys.executable, "-c", WAITING, "wait", "a b"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "begun\n"
        process.send_signal(sent)
        said = process.communicate(timeout=60)[1]
    assert said == "interrupted; to resume: appocc wait 'a b'\n"
    assert process.returncode == 128 + sent


def test_an_interrupted_training_names_resume(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(config: object, folder: object, resume: bool, monitor: object) -> None:
        os.kill(os.getpid(), signal.SIGTERM)

    monkeypatch.setattr("appocc.training.session.run_training", interrupted)
    config, out = tmp_path / "c.yaml", tmp_path / "run"
    config.write_text("data: {train: a, val: b}\ntrain: {steps: 1}\n")
    words = ["train", str(config), "--out", str(out)]
    for more in ([], ["--resume"]):
        monkeypatch.setattr(sys, "argv", ["appocc", *words])
        with pytest.raises(Interrupted) as ended:
            main.app()
        assert str(ended.value) == f"interrupted; to resume: appocc {' '.join([*words, *more])}"
        out.mkdir(exist_ok=True)
        (out / "config.yaml").touch()  # a run that has started has this file
