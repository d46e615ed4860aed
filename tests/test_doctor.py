"""`appocc doctor`: one screen for people, everything in JSON, and an exit code that scripts can trust."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tiny_dataset import TinyDataset, token
from typer.testing import CliRunner

from appocc import environment
from appocc.doctor import examine
from appocc.environment import Package
from appocc.errors import DataError
from cli import main

SCREEN = 45


@pytest.fixture(autouse=True)
def sound_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    """The machine that runs the tests may lack packages: that is not what is tested here."""
    monkeypatch.setattr(environment, "required_packages", lambda lines: ((Package("numpy", "2.0", "2.4.6"),), {}))
    monkeypatch.setattr(environment, "version_of", lambda name: "0.1.0" if name == "appocc" else None)
    monkeypatch.setattr(environment, "gpu", lambda: None)


def run(*arguments: str) -> tuple[int, str, str]:
    result = CliRunner().invoke(main.app, ["doctor", *arguments])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result.exit_code, result.stdout, result.stderr


def test_the_environment_alone() -> None:
    code, out, err = run()
    assert (code, out) == (0, "")
    assert err.startswith("appocc 0.1.0, Python 3.")
    assert "packages: 1 of 1 in order (numpy 2.4.6, ...)" in err
    assert err.endswith("healthy\n")


def test_a_package_that_is_missing_is_a_failed_check(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        environment,
        "required_packages",
        lambda lines: ((Package("numpy", "2.0", None),), {"video": (Package("av", "14", None),), "x": ()}),
    )
    code, _, err = run()
    assert code == 1
    assert "error: numpy is not installed" in err
    assert "extras: video lacks av; x yes" in err


def test_a_healthy_dataset_on_one_screen(tiny: TinyDataset) -> None:
    (tiny.root / "bev" / "groundtruth").mkdir(parents=True)
    (tiny.root / "bev" / "groundtruth" / "a.npz").write_bytes(b"")
    (tiny.root / "bev" / "notes.txt").write_text("")
    (tiny.root / "maps" / "expansion").mkdir()
    (tiny.root / "maps" / "expansion" / "nowhere.json").write_text("{}")
    code, out, err = run(str(tiny.root))
    assert (code, out) == (0, "")
    lines = err.splitlines()
    assert len(lines) <= SCREEN
    for wanted in (
        f"{tiny.root}: v1.0-tiny, nowhere",
        "scenes: 1; samples: 3; boxes: 5; objects: 2",
        "sensor files: 12",
        "  CAM_FRONT            camera            3          1",
        "masks: 1, for 1 of 1 scenes; vector maps: 1",
        "ground truth: road (vector map), lane markings (vector map), vehicles (boxes), colours (cameras and LiDAR)",
        "no camera looks: left, right",
        "LiDAR files with point labels: 0",
        "bev: groundtruth 1",
        "findings: none",
    ):
        assert wanted in lines
    assert lines[-1] == "healthy"


def test_json_holds_the_same_and_nothing_else_is_printed(tiny_root: Path) -> None:
    code, out, err = run(str(tiny_root), "--json")
    assert (code, err.strip()) == (0, "")
    report = json.loads(out)
    assert report["healthy"] is True
    assert report["problems"] == []
    assert report["environment"]["packages"] == [{"name": "numpy", "least": "2.0", "version": "2.4.6"}]
    dataset = report["dataset"]
    assert dataset["channels"]["LIDAR_TOP"] == {"modality": "lidar", "key_frames": 3, "sweeps": 1}
    assert (dataset["scenes"], dataset["samples"], dataset["annotations"], dataset["instances"]) == (1, 3, 5, 2)
    assert (dataset["masks"], dataset["scenes_with_mask"], dataset["lidarseg"], dataset["bev"]) == (1, 1, 0, {})


def test_a_truncated_image_is_a_failed_check(tiny: TinyDataset) -> None:
    path = tiny.root / tiny.tables["sample_data"][0]["filename"]
    path.write_bytes(path.read_bytes()[:-2])
    code, _, err = run(str(tiny.root))
    assert code == 1
    assert "error: sample_data: unreadable camera file (1)" in err
    assert f"  {token('CAM_FRONT', -10_000)} {path}: the image is truncated" in err
    assert err.endswith("not healthy: see the errors above\n")


def test_whole_files_are_read_only_when_asked(tiny: TinyDataset) -> None:
    path = tiny.root / tiny.row("sample_data", token("LIDAR_TOP", 0))["filename"]
    path.write_bytes(np.array([[1] * 5, [np.nan] * 5], np.float32).tobytes())
    assert run(str(tiny.root))[0] == 0
    assert run(str(tiny.root), "--images")[0] == 1


def test_two_sensors_of_one_channel_are_a_failed_check(tiny: TinyDataset) -> None:
    tiny.row("sensor", token("sensor", "CAM_BACK"))["channel"] = "CAM_FRONT"
    code, _, err = run(str(tiny.write()))
    assert code == 1
    assert "error: sample_data: two key frames (3)" in err
    assert "  CAM_FRONT            camera            6          2" in err


def test_notes_do_not_make_a_dataset_ill(tiny: TinyDataset) -> None:
    shutil.rmtree(tiny.root / "sweeps")
    code, _, err = run(str(tiny.root))
    assert code == 0
    assert "note: sample_data: missing sweeps (3)" in err


def test_many_findings_still_fit_one_screen_and_json_has_all(tiny: TinyDataset) -> None:
    shutil.rmtree(tiny.root / "samples")
    for name, rows in tiny.tables.items():
        for row in rows:
            for field in row:
                if field.endswith("_token") or field in ("prev", "next"):
                    row[field] = "gone"
            if name in ("ego_pose", "sample_annotation", "calibrated_sensor"):
                row["rotation"] = [0, 0, 0, 0]
            if "size" in row:
                row["size"] = [0, 0, 0]
            row.update(nbr_samples=9, nbr_annotations=9)
    code, _, err = run(str(tiny.write()))
    assert code == 1
    assert len(err.splitlines()) <= SCREEN
    assert "kinds more: see --json" in err
    problems = json.loads(run(str(tiny.root), "--json")[1])["problems"]
    assert len(problems) > 60
    assert {problem["severity"] for problem in problems} >= {"error"}


def test_a_damaged_table_leaves_no_contents(tiny: TinyDataset) -> None:
    (tiny.root / tiny.version / "ego_pose.json").write_text("[{")
    code, _, err = run(str(tiny.root))
    assert code == 1
    assert "error: ego_pose: damaged table (1)" in err
    assert json.loads(run(str(tiny.root), "--json")[1])["dataset"] is None


def test_a_folder_without_a_dataset(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no nuScenes-schema dataset"):
        examine(tmp_path)
    with pytest.raises(DataError, match="no such folder"):
        examine(tmp_path / "nowhere")


def test_no_dataset_is_exit_code_2_and_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["appocc", "doctor", str(tmp_path)])
    with pytest.raises(SystemExit) as ended:
        main.run()
    assert ended.value.code == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith(f"error: {tmp_path}: no nuScenes-schema dataset")
    assert printed.err.count("\n") == 1


def test_the_version_is_passed_on(tiny: TinyDataset) -> None:
    tiny.version = "v1.0-other"
    tiny.write()
    assert run(str(tiny.root), "--version", "v1.0-tiny")[0] == 0
    with pytest.raises(DataError, match="several versions"):
        examine(tiny.root)


def test_notes_alone_are_healthy_and_shown_after_errors(tiny: TinyDataset) -> None:
    shutil.rmtree(tiny.root / "sweeps")
    (tiny.root / "maps" / "drivable.png").unlink()
    lines = examine(tiny.root).lines()
    kinds = [line for line in lines if line.startswith(("error", "note"))]
    assert kinds == ["error: map: missing file (1)", "note: sample_data: missing sweeps (3)"]


def test_memory_that_cannot_be_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(environment, "memory", lambda: (None, None))
    assert "memory" not in "\n".join(examine(None).lines())
    monkeypatch.setattr(environment, "memory", lambda: (8_000_000_000, 2_500_000_000))
    assert "8.0 GB memory (2.5 GB free)" in "\n".join(examine(None).lines())


@pytest.mark.realdata
def test_recorded_datasets_are_healthy(data_root: Path) -> None:
    report = examine(data_root / "nuscenes_real", images=True)
    assert report.healthy
    contents: Any = report.contents
    assert (contents.scenes, contents.samples, contents.masks, contents.scenes_with_mask) == (2, 2, 4, 2)
    assert len(contents.channels) == 7
    assert 1.5 < contents.ground_tilt_deg < 2.5  # nuScenes' ego poses are flat, its streets are not
    assert any("level the calibration" in line for line in report.lines())


@pytest.mark.realdata
def test_a_levelled_recording_is_level(panda_root: Path) -> None:
    contents = examine(panda_root).contents
    assert contents is not None
    assert contents.ground_tilt_deg is not None
    assert contents.ground_tilt_deg < 0.5
