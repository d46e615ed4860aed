from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from panda_twin import PandaTwin

from appocc.nuscenes import Dataset
from cli.main import run


@pytest.fixture
def twin(tmp_path: Path) -> PandaTwin:
    return PandaTwin(tmp_path)


def command(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], *words: object
) -> tuple[int, str, str]:
    """Return exit code, stdout and stderr of `appocc WORDS`."""
    monkeypatch.setattr(sys, "argv", ["appocc", *map(str, words)])
    with pytest.raises(SystemExit) as ended:
        run()
    out, err = capsys.readouterr()
    return int(ended.value.code or 0), out, err


def test_convert(twin: PandaTwin, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    out = twin.root / "out"
    words = ("convert", "pandaset", twin.source, out, "--lidar", twin.lidar)
    code, stdout, stderr = command(monkeypatch, capsys, *words)
    assert (code, stdout) == (0, "")
    assert "3 samples, 18 images, 2 LiDAR sweeps, 12 boxes of scenes 002" in stderr
    assert len(Dataset(out).scenes) == 1


def test_json(twin: PandaTwin, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    words = ("convert", "pandaset", twin.source, twin.root / "out", "--json")
    code, stdout, stderr = command(monkeypatch, capsys, *words)
    assert code == 0
    expected = {"scenes": ["002"], "samples": 3, "images": 18, "sweeps": 0, "annotations": 12}
    assert json.loads(stdout) == expected
    assert "no LiDAR was converted: name its folder with --lidar" in stderr


def refused(code: int, stdout: str, stderr: str) -> str:
    """Return the error message; it is the only line of output."""
    assert code == 2
    assert stdout == ""
    lines = [line for line in stderr.splitlines() if line.strip()]
    assert len(lines) == 1
    assert lines[0].startswith("error: ")
    return lines[0]


@pytest.mark.parametrize("fault", ["key", "nan", "gone", "cut", "sweep", "pickles", "source", "full"])
def test_bad_input(
    twin: PandaTwin, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], fault: str
) -> None:
    source, out, image = twin.source, twin.root / "out", twin.source / "002/camera/back_camera/04.jpg"
    why = {"key": "'T_world_ego'", "nan": "T_world_ego: expected finite", "gone": str(image), "cut": str(image)}.get(
        fault
    )
    if fault == "key":
        del twin.data["frames"][2]["T_world_ego"]
    elif fault == "nan":
        twin.data["frames"][2]["T_world_ego"][1][1] = float("nan")
    twin.write()
    if fault == "gone":
        image.unlink()
    elif fault == "cut":
        image.write_bytes(image.read_bytes()[:300])
    elif fault == "sweep":
        (twin.lidar / "npz" / "02.npz").write_bytes(b"PK")
        why = "02.npz: damaged sweep"
    elif fault == "pickles":
        source, why = twin.publish(), "--trust-pickles"
    elif fault == "source":
        source, why = twin.root / "none", "none: no such folder"
    elif fault == "full":
        out.mkdir()
        (out / "mine").touch()
        why = "exists already; name a new folder"
    before = sorted(path.name for path in twin.root.iterdir())
    words = ("convert", "pandaset", source, out, "--lidar", twin.lidar)
    line = refused(*command(monkeypatch, capsys, *words))
    assert why is not None
    assert why in line
    assert sorted(path.name for path in twin.root.iterdir()) == before


@pytest.mark.parametrize(
    "words",
    [("convert",), ("convert", "cityscapes", "a", "b"), ("convert", "kitti", "a"), ("convert", "pandaset", "a")],
)
def test_wrong_usage(
    words: tuple[str, ...], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    code, stdout, stderr = command(monkeypatch, capsys, *words)
    assert (code, stdout) == (2, "")
    assert "Usage" in stderr


def test_help_has_an_example(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    code, stdout, _ = command(monkeypatch, capsys, "convert", "pandaset", "--help")
    assert code == 0
    assert "appocc convert pandaset" in stdout
    assert "--trust-pickles" in stdout


def test_pickles_are_read_only_if_trusted(
    twin: PandaTwin, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("pandas")
    words = ("convert", "pandaset", twin.publish(), twin.root / "out", "--trust-pickles", "--json")
    code, stdout, _ = command(monkeypatch, capsys, *words)
    assert code == 0
    assert json.loads(stdout)["sweeps"] == 2


def test_an_interrupted_conversion_leaves_nothing(
    twin: PandaTwin, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from appocc.nuscenes.writer import Writer

    def interrupted(self: Writer) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Writer, "save", interrupted)
    code, stdout, stderr = command(monkeypatch, capsys, "convert", "pandaset", twin.source, twin.root / "out")
    assert (code, stdout) == (130, "")
    assert "Traceback" not in stderr
    assert sorted(path.name for path in twin.root.iterdir()) == ["panda", "panda_lidar"]


def test_in_a_separate_process(twin: PandaTwin) -> None:
    repository = Path(__file__).parents[2]
    words = [
        sys.executable,
        "-m",
        "cli.main",
        "convert",
        "pandaset",
        str(twin.source),
        str(twin.root / "out"),
        "--json",
    ]
    environment = {**os.environ, "PYTHONPATH": str(repository)}
    done = subprocess.run(words, capture_output=True, text=True, cwd=twin.root, env=environment, check=False)
    assert done.returncode == 0
    assert json.loads(done.stdout)["samples"] == 3
    again = subprocess.run(words, capture_output=True, text=True, cwd=twin.root, env=environment, check=False)
    assert "exists already" in refused(again.returncode, again.stdout, again.stderr)


@pytest.mark.realdata
def test_the_recorded_street(panda_root: Path) -> None:
    """The recording converted by the fixture."""
    dataset = Dataset(panda_root)
    egos = np.stack([dataset.world_from_ego(sample)[:3, 3] for sample in dataset.samples(dataset.scenes[0])])
    assert np.linalg.norm(np.diff(egos, axis=0), axis=1).sum() == pytest.approx(21.7, abs=0.8)
