from __future__ import annotations

import json
from pathlib import Path

import pytest
from made_kitti import detection, made_kitti, write
from typer.testing import CliRunner, Result

from appocc.errors import AppoccError, DataError
from cli.main import app

FRAMES = 8


def run(*words: object) -> Result:
    return CliRunner().invoke(app, ["track", *map(str, words)])


def test_all_sequences_are_tracked_written_and_scored(tmp_path: Path) -> None:
    root = made_kitti(tmp_path / "kitti", FRAMES, ("0001", "0007"))
    result = run("--kitti", root, "--out", tmp_path / "out", "--json")
    assert result.exit_code == 0, result.output
    answer = json.loads(result.stdout)
    own = ["metrics", "metrics_at_best_cut", "metrics_at_causal_cut"]
    assert list(answer) == ["sequences", "files", *own, "classes"]
    assert answer["classes"] == {"car": {name: answer[name] for name in own}}
    assert answer["sequences"] == ["0001", "0007"]
    assert answer["files"] == [str(tmp_path / "out" / f"{name}.txt") for name in ("0001", "0007")]
    metrics, best = answer["metrics"], answer["metrics_at_best_cut"]
    assert (metrics["GT"], metrics["FP"], metrics["IDS"], metrics["MT"]) == (2 * FRAMES, 0, 0, 2)
    assert best["cut"] > -2
    assert (best["MOTA"], best["FN"], best["FP"]) == (1.0, 0, 0)
    first, second = (Path(name).read_text().splitlines() for name in answer["files"])
    assert first == second
    assert len(first) == FRAMES - metrics["FN"] // 2
    assert first[-1].split()[:5] == [str(FRAMES - 1), "1", "Car", "-1", "-1"]
    assert "2 objects in 2 sequences" in result.stderr
    assert "track cut: mean score from" in result.stderr


def test_smoothing_drops_predictions_after_the_last_detection(tmp_path: Path) -> None:
    """The car is missed in the last frames, where the tracker reports it for a while."""
    root = made_kitti(tmp_path / "kitti", FRAMES)
    found = next((root / "detection_made").iterdir())
    found.write_text("".join(line + "\n" for line in found.read_text().splitlines()[:-2]))
    lines = {}
    for name, words in (("online", ()), ("smoothed", ("--smooth",))):
        result = run("--kitti", root, "--out", tmp_path / name, "--json", *words)
        assert result.exit_code == 0, result.output
        lines[name] = Path(json.loads(result.stdout)["files"][0]).read_text().splitlines()
    assert lines["online"][-1].split()[0] == str(FRAMES - 1)
    assert lines["smoothed"][-1].split()[0] == str(FRAMES - 3)


def test_without_labels_metrics_are_null(tmp_path: Path) -> None:
    root = made_kitti(tmp_path / "kitti", FRAMES, labels=False)
    result = run("--kitti", root, "--json")
    answer = json.loads(result.stdout)
    assert answer["metrics"] is answer["metrics_at_best_cut"] is None
    assert answer["files"] == [str(root / "tracks" / "0001.txt")]
    assert "no labels" in result.stderr


@pytest.mark.parametrize("folder", ["label", "label_02", "calib", "pose", "oxts", "detection_made"])
def test_the_input_is_not_overwritten(tmp_path: Path, folder: str) -> None:
    root = made_kitti(tmp_path / "kitti", FRAMES)
    before = {path: path.read_text() for path in root.rglob("*.txt")}
    error = run("kitti", root, "--out", root / "pose" / ".." / folder).exception
    assert isinstance(error, DataError)
    assert f"the tracks would be written over the files of '{folder}'" in str(error)
    assert {path: path.read_text() for path in root.rglob("*.txt")} == before


def test_tracks_below_the_minimum_score_are_counted(tmp_path: Path) -> None:
    root = made_kitti(tmp_path / "kitti", FRAMES)
    write(root / "detection_made" / "0001.txt", [detection(frame, score=-1.0) for frame in range(FRAMES)])
    result = run("kitti", root, "--json")
    assert "0 objects in 1 sequences\n1 more stay below --min-score 0.5; their highest score is 0." in result.stderr
    answer = json.loads(result.stdout)
    assert Path(answer["files"][0]).read_text() == ""
    assert (answer["metrics"]["MOTA"], answer["metrics"]["FN"]) == (0, FRAMES)


def test_without_detections_all_objects_are_missed(tmp_path: Path) -> None:
    root = made_kitti(tmp_path / "kitti", FRAMES)
    write(root / "detection_made" / "0001.txt", [])
    result = run("kitti", root, "--json")
    metrics = json.loads(result.stdout)["metrics"]
    assert (metrics["MOTA"], metrics["GT"], metrics["FN"], metrics["FP"]) == (0, FRAMES, FRAMES, 0)
    assert "0 objects in 1 sequences" in result.stderr
    assert "labels" not in result.stderr


def test_detections_of_classes_without_labels(tmp_path: Path) -> None:
    root = made_kitti(tmp_path / "kitti", FRAMES)
    write(root / "detection_made" / "0001.txt", [detection(frame, kind=1) for frame in range(FRAMES)])
    result = run("kitti", root, "--json")
    assert json.loads(result.stdout)["classes"] == {}
    assert "no labels of the detected classes (pedestrian): nothing to be scored against" in result.stderr


def test_only_sequences_with_labels_are_scored(tmp_path: Path) -> None:
    root = made_kitti(tmp_path / "kitti", FRAMES, ("0001", "0002"))
    (root / "label" / "0002.txt").unlink()
    answer = json.loads(run("--kitti", root, "--json").stdout)
    assert (answer["sequences"], answer["metrics"]["GT"]) == (["0001", "0002"], FRAMES)


def test_nothing_is_written_if_a_sequence_is_damaged(tmp_path: Path) -> None:
    root = made_kitti(tmp_path / "kitti", FRAMES, ("0001", "0002"))
    write(root / "pose" / "0002.txt", ["1 2"])
    assert isinstance(run("--kitti", root, "--out", tmp_path / "out").exception, DataError)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        ((), "expected one of --bev, --detections, --kitti and --mot, got none"),
        (("ROOT",), "expected one of --bev, --detections, --kitti and --mot, got none"),
        (("ROOT", "--scene", "one"), "expected one of --bev, --detections, --kitti and --mot, got none"),
        (("--scene", "one", "--bev", "exact"), "--bev needs ROOT and --scene, got no ROOT"),
        (("ROOT", "--kitti", "KITTI"), "--kitti goes only with --smooth, --min-score, --out and --json"),
        (("--kitti", "KITTI", "--scene", "one"), "--kitti goes only with --smooth, --min-score, --out and --json"),
        (
            ("--kitti", "KITTI", "--bev", "exact"),
            "expected one of --bev, --detections, --kitti and --mot, got --bev and --kitti",
        ),
        (("--kitti", "KITTI", "--video", "t.webm"), "--kitti goes only with --smooth, --min-score, --out and --json"),
        (
            ("--kitti", "KITTI", "--version", "v1.0-mini"),
            "--kitti goes only with --smooth, --min-score, --out and --json",
        ),
    ],
)
def test_invalid_combinations_with_kitti(words: tuple[str, ...], complaint: str) -> None:
    error = run(*words).exception
    assert isinstance(error, AppoccError)
    assert error.exit_code == 2
    assert complaint in str(error)
    assert "\n" not in str(error)
