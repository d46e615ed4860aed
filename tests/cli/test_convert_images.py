from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from in_process import run_command
from made_own_recording import write_cameras, write_video
from made_pack_source import contents
from walkthrough import run_line

from appocc.files import write_image
from appocc.nuscenes import Dataset

RIG = """
cameras:
  CAM_FRONT: {size_px: [48, 32], fov_deg: 90, position_m: [1.7, 0, 1.5], yaw_deg: 0}
  CAM_BACK: {size_px: [48, 32], fov_deg: 90, position_m: [0, 0, 1.5], yaw_deg: 180}
"""
VIDEO_NAMES = ("mp4", "webm", "avi", "mkv", "mov")
GREY = np.full((32, 48, 3), 90, np.uint8)


@pytest.fixture
def drive(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working folder: `drive` with two seconds of frame numbers, `rig.yaml` and `poses.txt`."""
    write_cameras(tmp_path / "drive", ("CAM_FRONT", "CAM_BACK"), [f"{n:06d}" for n in range(4)], lambda c, n: GREY)
    (tmp_path / "rig.yaml").write_text(RIG)
    (tmp_path / "poses.txt").write_text("".join(f"{s} {s} 0 0 0 0 0 1\n" for s in range(-1, 5)))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_images_with_poses(drive: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    line = "convert images drive out --rig rig.yaml --poses poses.txt --fps 2 --json"
    done = run_command(line.split(), capsys, monkeypatch)
    assert done.returncode == 0, done.stderr
    expected = {"scene": "drive", "samples": 4, "images": 8, "missing": {}, "left_out": {}, "notes": []}
    assert json.loads(done.stdout) == {**expected, "folder": "out"}
    assert "out: 4 key frames, 8 images of scene drive" in done.stderr
    assert len(Dataset("out").scenes) == 1


def test_several_drives_are_resumed(
    drive: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("first", "second"):
        shutil.copytree(drive / "drive", drive / "drives" / name)
        shutil.copy(drive / "poses.txt", drive / "drives" / name)
    damaged = drive / "drives" / "second" / "CAM_BACK" / "000002.png"
    whole = damaged.read_bytes()
    write_image(damaged, np.zeros((32, 32, 3), np.uint8))
    text = "convert images drives out --rig rig.yaml --poses poses.txt --fps 2 --json"
    line = text.split()
    done = run_command(line, capsys, monkeypatch)
    assert (done.returncode, (drive / "out").exists()) == (2, False)
    assert "000002.png: CAM_BACK: expected 48x32 pixels" in done.stderr
    damaged.write_bytes(whole)
    first = next((drive / ".out.unfinished" / "scenes" / "first").rglob("*.jpg"))
    written = first.stat().st_mtime_ns, first.name
    done = run_command(line, capsys, monkeypatch)
    assert done.returncode == 0, done.stderr
    assert [each["scene"] for each in json.loads(done.stdout)["scenes"]] == ["first", "second"]
    assert [len(Dataset("out").samples(scene)) for scene in Dataset("out").scenes] == [4, 4]
    (kept,) = (drive / "out").rglob(written[1])
    assert kept.stat().st_mtime_ns == written[0], "the first drive was converted once"
    assert "holds this conversion already" in run_command(line, capsys, monkeypatch).stderr
    named = run_command([*line, "--scene", "mine"], capsys, monkeypatch)
    assert "has 2 drives, which are named by their folders" in named.stderr
    both = run_command([*[word.replace("out", "both") for word in line], "--workers", "2"], capsys, monkeypatch)
    assert (both.returncode, both.stdout) == (0, done.stdout.replace('"out"', '"both"'))
    assert contents(drive / "both") == contents(drive / "out")


def test_what_is_assumed_or_missing_is_told(
    drive: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (drive / "drive" / "CAM_BACK" / "000001.png").unlink()
    line = "convert images drive out --rig rig.yaml --speed 3 --fps 2 --scene mine --start 1700000000"
    done = run_command(line.split(), capsys, monkeypatch)
    assert done.returncode == 0, done.stderr
    assert "CAM_BACK: missing in 1 of 4 key frames (no picture at this time)" in done.stderr
    assert "no poses: the ego vehicle is taken for straight ahead at 3 m/s" in done.stderr
    dataset = Dataset("out")
    assert dataset.samples(dataset.scene("mine"))[0].timestamp_us == 1_700_000_000_000_000


def test_a_mosaic_video(drive: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    write_video(drive / "all.avi", [np.hstack([GREY, GREY])] * 3, 2.0)
    line = "convert images all.avi out --rig rig.yaml --mosaic 1x2"
    done = run_command(line.split(), capsys, monkeypatch)
    assert done.returncode == 0, done.stderr
    assert "standing (--speed, --poses)" in done.stderr
    assert "out: 3 key frames, 6 images of scene all" in done.stderr


def test_a_damaged_video_is_one_line_also_of_the_video_library(drive: Path) -> None:
    (drive / "all.webm").write_bytes(b"no video")
    ended, said = run_line("appocc convert images all.webm out --rig rig.yaml --mosaic 1x2", drive)
    assert (ended, said) == (2, f"error: all.webm: cannot be opened as a video (expected {', '.join(VIDEO_NAMES)})\n")


@pytest.mark.parametrize(
    ("words", "why"),
    [
        ("none out --rig rig.yaml", "none: no such folder"),
        ("drive out --rig none.yaml", "none.yaml: no rig of this name"),
        ("drive out --rig paper --fps 2", "no pictures of CAM_FRONT_LEFT"),
        ("drive out --rig rig.yaml", "name the rate of frames (--fps)"),
        ("drive out --rig rig.yaml --fps 2 --poses none.txt", "none.txt: cannot be read"),
        ("drive out --rig rig.yaml --fps 2 --poses poses.txt --speed 2", "either --poses or --speed"),
        ("drive out --rig rig.yaml --fps 2 --poses-of CAM_FRONT", "--poses-of: expected --poses with it"),
        ("drive out --rig rig.yaml --fps 2 --poses poses.txt --poses-of CAM_TOP", "no camera 'CAM_TOP'"),
        ("drive out --rig rig.yaml --fps 2 --poses poses.txt --start 1700000000", "do not cover the pictures"),
        ("drive out --rig rig.yaml --mosaic 2by3", "expected ROWSxCOLUMNS, such as 2x3, got '2by3'"),
        ("rig.yaml out --rig rig.yaml --mosaic 1x2", "rig.yaml: cannot be opened as a video"),
        ("drive out --rig rig.yaml --fps 2 --start noon", "--start: expected a time in seconds or of ISO 8601"),
        ("drive drive --rig rig.yaml --fps 2", "drive: exists already; name a new folder"),
        ("drive out --rig rig.yaml --fps 2 --scene a/b", "expected a name for a file, got 'a/b'"),
    ],
)
def test_bad_input_is_one_line(
    drive: Path, words: str, why: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    before = sorted(drive.iterdir())
    done = run_command(["convert", "images", *words.split()], capsys, monkeypatch)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert done.stderr.startswith("error: ")
    assert why in done.stderr
    assert sorted(drive.iterdir()) == before
