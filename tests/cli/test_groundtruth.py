from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest
from tiny_dataset import TinyDataset, token

from appocc.bevmap import BEVMap, bev_path
from cli.main import run


def command(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], *words: object
) -> tuple[int, str, str]:
    """Return exit code, stdout and stderr of `appocc groundtruth WORDS` with one process."""
    monkeypatch.setattr(sys, "argv", ["appocc", "groundtruth", *map(str, words), "--workers", "1"])
    with pytest.raises(SystemExit) as ended:
        run()
    out, err = capsys.readouterr()
    return int(ended.value.code or 0), out, err


def refused(code: int, stdout: str, stderr: str) -> str:
    """Return the error message; it is the only line of output."""
    assert code == 2
    assert stdout == ""
    lines = [line for line in stderr.splitlines() if line.strip()]
    assert len(lines) == 1
    assert lines[0].startswith("error: ")
    return lines[0]


def tokens(folder: Path) -> set[str]:
    return {path.stem for path in folder.glob("*.npz")}


ALL = {token("sample", i) for i in range(3)}


def test_groundtruth(tiny_root: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    code, stdout, stderr = command(monkeypatch, capsys, tiny_root)
    assert (code, stdout) == (0, "")
    assert "3 maps made" in stderr
    assert "0 kept" in stderr
    assert tokens(tiny_root / "bev" / "groundtruth") == ALL
    bev = BEVMap.load(bev_path(tiny_root, "groundtruth", token("sample", 0)))
    assert bev.grid.shape == (200, 200)
    assert bev.meta["settings"]["paint"] == "robust"


def test_what_stays_unknown_is_told(
    tiny: TinyDataset, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    told = "unknown for want of a LiDAR, a road map or boxes: "
    assert "ground" not in command(monkeypatch, capsys, tiny.root)[2].partition(told)[2]
    tiny.tables["sample_data"] = [row for row in tiny.tables["sample_data"] if "LIDAR" not in row["filename"]]
    code, _, stderr = command(monkeypatch, capsys, tiny.write(), "--out", tiny.root.parent / "without")
    assert code == 0
    assert "colour of the ground" in stderr.partition(told)[2]


def test_json_and_out(
    tiny_root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "elsewhere"
    before = sorted(tiny_root.rglob("*"))
    for made, kept in ((3, 0), (0, 3)):
        code, stdout, _ = command(monkeypatch, capsys, tiny_root, "--out", out, "--json")
        assert code == 0
        value = json.loads(stdout)
        assert (value["made"], value["kept"]) == (made, kept)
        assert value["folder"] == str(out / "bev" / "groundtruth")
    assert tokens(out / "bev" / "groundtruth") == ALL
    assert sorted(tiny_root.rglob("*")) == before  # the dataset is only read


def test_a_scene_without_key_frames_is_skipped_with_a_message(
    tiny: TinyDataset, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    tiny.tables["scene"].append({**tiny.tables["scene"][0], "token": "other", "name": "empty"})
    code, _, stderr = command(monkeypatch, capsys, tiny.write())
    assert code == 0
    assert "skipped: scene 'empty' has no key frames" in stderr


def test_paint_and_scene(
    tiny_root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    words = (tiny_root, "--out", tmp_path / "o", "--paint", "mode", "--scene", "scene-tiny")
    code, _, _ = command(monkeypatch, capsys, *words)
    assert code == 0
    bev = BEVMap.load(bev_path(tmp_path / "o", "groundtruth", token("sample", 0)))
    assert bev.meta["settings"]["paint"] == "mode"


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("samples/CAM_BACK/1600000000990000.jpg", "the image is truncated"),
        ("sweeps/LIDAR_TOP", "expected rows of 5 float32"),
    ],
)
def test_damaged_files(
    tiny: TinyDataset, name: str, message: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tiny.root / name
    path = next(path.iterdir()) if path.is_dir() else path
    path.write_bytes(path.read_bytes()[:-3])
    line = refused(*command(monkeypatch, capsys, tiny.root))
    assert f"{path}: {message}" in line
    folder = tiny.root / "bev" / "groundtruth"
    left = list(folder.iterdir()) if folder.exists() else []
    assert all(not file.name.startswith(".") for file in left)


def test_a_missing_dataset(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert "no such folder" in refused(*command(monkeypatch, capsys, tmp_path / "none"))
    assert "no nuScenes-schema dataset" in refused(*command(monkeypatch, capsys, tmp_path))


def test_an_unknown_scene(
    tiny_root: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    line = refused(*command(monkeypatch, capsys, tiny_root, "--scene", "scene-0061"))
    assert "no scene 'scene-0061'; it has scene-tiny" in line
    assert not (tiny_root / "bev").exists()


def test_an_output_that_cannot_be_written(
    tiny_root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").touch()
    line = refused(*command(monkeypatch, capsys, tiny_root, "--out", tmp_path / "file"))
    assert "cannot be written" in line


@pytest.mark.parametrize("words", [(), ("ROOT", "--paint", "pink"), ("ROOT", "--workers", "0")])
def test_wrong_usage(
    words: tuple[str, ...], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["appocc", "groundtruth", *words])
    with pytest.raises(SystemExit) as ended:
        run()
    assert ended.value.code == 2
    assert "Usage" in capsys.readouterr().err


def test_help_has_an_example(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    code, stdout, _ = command(monkeypatch, capsys, "--help")
    assert code == 0
    assert "appocc groundtruth ROOT --out OUT" in stdout
