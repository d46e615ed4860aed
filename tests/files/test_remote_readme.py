"""The commands of the README's part on remote data, and of its page, run as written against an S3 server."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest
from in_process import run_command
from made_model import predictor, save_road_everywhere
from s3_server import S3Server
from tiny_dataset import TinyDataset
from walkthrough import README, blocks

from appocc.inference import loading

PAGE = README.parent / "docs" / "remote.md"


@pytest.fixture
def drives(s3: S3Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> S3Server:
    """The bucket s3://drives with a dataset SIM and its true maps; the network is a made one."""
    tiny = TinyDataset(tmp_path / "drives" / "SIM")
    save_road_everywhere(tiny)
    s3.put(tiny.root.parent, "drives")
    monkeypatch.setattr(loading, "load_predictor", lambda *_: predictor())
    return s3


def test_the_lines_run(drives: S3Server, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    (lines,) = blocks("## Data where it lies")
    assert lines in PAGE.read_text()
    for line in lines.splitlines():
        done = run_command(shlex.split(line)[1:], capsys, monkeypatch)
        assert done.returncode == 0, done.stderr
    maps = [name for name in drives.contents("drives", "SIM/bev/predicted/") if name.endswith(".npz")]
    assert len(maps) == 3
