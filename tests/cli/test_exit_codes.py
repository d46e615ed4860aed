"""Bad input through the command line: one line that says why, exit code 2, nothing on stdout, nothing written."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from tiny_dataset import TinyDataset

REPOSITORY = Path(__file__).parents[2]
CASES = [
    (["doctor", "{root}/none"], "no such folder"),
    (["groundtruth", "{root}/v1.0-tiny/scene.json"], "no such folder"),
    (["groundtruth", "{root}", "--scene", "other"], "no scene 'other'"),
    (["groundtruth", "{root}", "--out", "{root}/v1.0-tiny/scene.json"], "cannot be written"),
    (["track", "{root}", "--scene", "scene-tiny", "--bev", "model"], "no BEV map"),
    (["track", "{root}", "--scene", "scene-tiny", "--bev", "x", "--video", "t.mov"], ".webm"),
    (["ground", "park", "{root}", "--scene", "scene-tiny", "--frame", "99"], "frames 0..2, not 99"),
    (["ground", "park", "{root}", "--scene", "scene-tiny", "--frame", "-1"], "not -1"),
    (["convert", "pandaset", "{root}", "{root}/out"], "no frames.json"),
    (["demo", "--out", "{root}"], "{root}"),
]


@pytest.mark.parametrize(("words", "reason"), CASES, ids=[" ".join(words)[:40] for words, _ in CASES])
def test_bad_input_is_told_in_one_line(tiny: TinyDataset, words: list[str], reason: str) -> None:
    before = sorted(tiny.root.rglob("*"))
    command = [sys.executable, "-m", "cli.main", *(word.format(root=tiny.root) for word in words)]
    done = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stdout == ""
    lines = [line for line in done.stderr.splitlines() if line.strip()]
    assert len(lines) == 1
    assert lines[0].startswith("error: ")
    assert reason.format(root=tiny.root) in lines[0]
    assert sorted(tiny.root.rglob("*")) == before
