"""The sub-commands of `appocc track` and the older form give the same results."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from made_kitti import made_kitti
from made_scene import with_maps
from tiny_dataset import TinyDataset, token
from typer.testing import CliRunner

from cli.main import app

BOX = {
    "translation": [100, 210, 0.8],
    "size": [1.8, 4.5, 1.6],
    "rotation": [1, 0, 0, 0],
    "detection_name": "car",
    "detection_score": 0.9,
}


def run(*words: object) -> Any:
    result = CliRunner().invoke(app, ["track", *map(str, words), "--json"])
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout)


def assert_equal_files(one: Path, other: Path) -> None:
    names = {path.name for path in one.iterdir()}
    assert names == {path.name for path in other.iterdir()}
    assert all((one / name).read_bytes() == (other / name).read_bytes() for name in names)


def test_scene(tiny: TinyDataset, tmp_path: Path) -> None:
    with_maps(tiny)
    words = ("--scene", "scene-tiny", "--bev", "groundtruth")
    new, old = run("scene", tiny.root, *words), run(tiny.root, *words)
    assert new == old
    assert Path(new["files"][0]).parent == tiny.root / "tracks" / "groundtruth" / "scene-tiny"
    for name, form in (("new", ("scene", tiny.root)), ("old", (tiny.root,))):
        run(*form, *words, "--smooth", "--out", tmp_path / name)
    assert_equal_files(tmp_path / "new", tmp_path / "old")


def test_detections(tiny: TinyDataset, tmp_path: Path) -> None:
    path = tmp_path / "found.json"
    path.write_text(json.dumps({"results": {token("sample", i): [BOX] for i in range(3)}}))
    new = run("detections", tiny.root, path, "--scene", "scene-tiny")
    assert new == run(tiny.root, "--detections", path, "--scene", "scene-tiny")
    assert Path(new["files"][0]).parent == tiny.root / "tracks" / "found" / "scene-tiny"


def test_kitti(tmp_path: Path) -> None:
    root = made_kitti(tmp_path / "kitti", 4)
    new = run("kitti", root)
    assert new == run("--kitti", root)
    assert new["files"] == [str(root / "tracks" / "0001.txt")]


def test_mot(tmp_path: Path) -> None:
    path = tmp_path / "det.txt"
    path.write_text("".join(f"{i},-1,{100 + 2 * i},50,60,170,0.9\n" for i in range(1, 10)))
    new = run("mot", path, "--fps", 25)
    assert new == run("--mot", path, "--fps", 25)
    assert new["files"] == [str(tmp_path / "tracks" / "det.txt")]


@pytest.mark.parametrize("name", ["scene", "detections", "kitti", "mot"])
def test_help_shows_an_example(name: str) -> None:
    result = CliRunner().invoke(app, ["track", name, "--help"])
    assert result.exit_code == 0
    assert f"Example: appocc track {name}" in " ".join(result.stdout.replace("│", " ").split())


def test_the_hidden_command_is_not_listed() -> None:
    assert "older-form" not in CliRunner().invoke(app, ["track", "--help"]).stdout
