"""An empty name is not accepted as the output of a command."""

from __future__ import annotations

from pathlib import Path

import pytest
from tiny_dataset import TinyDataset
from typer.testing import CliRunner

from cli.main import app


@pytest.mark.parametrize(
    "words",
    [
        ["ablate", "c.yaml", "--test", "{root}", "--out", ""],
        ["check-rig", "{root}", "--out", ""],
        ["convert", "pandaset", "{root}", ""],
        ["convert", "images", "{root}", "", "--rig", "paper"],
        ["demo", "--out", ""],
        ["export", "--out", ""],
        ["groundtruth", "{root}", "--out", ""],
        ["infer", "{root}", "--out", ""],
        ["rig", "fit", "{root}", "--points", "p.csv", "--out", ""],
        ["simulate", ""],
        ["track", "{root}", "--scene", "scene-tiny", "--bev", "x", "--out", ""],
        ["train", "c.yaml", "--out", ""],
        ["weights", "ship", "w.safetensors", "--out", ""],
    ],
    ids=lambda words: words[0],
)
def test_an_empty_out_is_rejected(
    tiny: TinyDataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: list[str]
) -> None:
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    result = CliRunner().invoke(app, [word.format(root=tiny.root) for word in words])
    assert result.exit_code == 2
    assert "expected a name, got an empty one" in result.stderr
    assert not list((tmp_path / "here").iterdir())
