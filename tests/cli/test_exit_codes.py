"""Bad input on the command line: one error line, exit code 2, nothing on stdout, nothing written."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from in_process import run_command
from tiny_dataset import TinyDataset, token

REPOSITORY = Path(__file__).parents[2]
BOX = '{"translation": [100, NaN, 1], "size": [2, 4, 1], "rotation": [1, 0, 0, 0], "detection_name": "car"}'
# Files of detections and tracks in the dataset's root.
FILES = {
    "good.txt": "1,-1,10,20,30,60,0.9\n",
    "short.txt": "1,-1,10,20,30,60,0.9\n2,-1,10,2",
    "nan.txt": "1,-1,10,20,nan,60,0.9\n",
    "blanks.txt": "1 -1 10 20 30 60 0.9\n",
    "empty.txt": "",
    "cut.json": '{"results": {"a": [{"transl',
    "nan.json": f'{{"results": {{"{token("sample", 0)}": [{BOX}]}}}}',
    "others.json": '{"results": {"another-sample": []}}',
    "tracks.json": '{"results": {"a": [{"tracking_id": "1", "tracking_name": "car"}]}}',
}
SCENE = ["track", "{root}", "--scene", "scene-tiny"]
MOT = ["track", "--fps", "25", "--out", "{root}/out", "--mot"]
TRACKS = ["eval", "tracks", "--gt", "{root}/none.json", "--tracks", "{root}/tracks.json"]
CASES = [
    (["doctor", "{root}/none"], "no such folder"),
    (["groundtruth", "{root}/v1.0-tiny/scene.json"], "scene.json: expected a folder, got a file"),
    (
        ["ground", "{root}", "stop behind the car", "--frame", "0"],
        "expected TEXT, then ROOT, got the folder {root} first",
    ),
    (["groundtruth", "{root}", "--scene", "other"], "no scene 'other'"),
    (["groundtruth", "{root}", "--out", "{root}/v1.0-tiny/scene.json"], "cannot be written"),
    (["track", "{root}", "--scene", "scene-tiny", "--bev", "model"], "no BEV map"),
    (["track", "{root}", "--scene", "scene-tiny", "--bev", "x", "--video", "t.mov"], ".webm"),
    ([*SCENE, "--bev", "x", "--detections", "{root}/nan.json"], "expected one of --bev, --detections"),
    ([*SCENE, "--detections", "{root}/none.json"], "{root}/none.json: cannot be read"),
    ([*SCENE, "--detections", "{root}/cut.json"], "{root}/cut.json: no valid JSON"),
    ([*SCENE, "--detections", "{root}/nan.json"], "0.translation.1: expected a finite number"),
    ([*SCENE, "--detections", "{root}/others.json"], "expected boxes, or an empty list, for sample"),
    ([*SCENE, "--detections", "{root}/good.txt"], "{root}/good.txt: no valid JSON"),
    ([*MOT, "{root}/none.txt"], "{root}/none.txt: cannot be read"),
    ([*MOT, "{root}"], "{root}: cannot be read"),
    ([*MOT, "{root}/empty.txt"], "{root}/empty.txt: expected detections, got an empty file"),
    ([*MOT, "{root}/short.txt"], "{root}/short.txt: line 2: expected at least 7 columns, got 4"),
    ([*MOT, "{root}/nan.txt"], "{root}/nan.txt: line 1: expected finite numbers"),
    ([*MOT, "{root}/blanks.txt"], "{root}/blanks.txt: line 1: expected at least 7 columns, got 1"),
    ([*MOT, "{root}/good.txt", "--kitti", "{root}"], "expected one of --bev, --detections, --kitti and --mot"),
    (["track", "--mot", "{root}/good.txt"], "--mot needs --fps"),
    (["track", "--mot", "{root}/good.txt", "--fps", "nan"], "frames a second, got nan"),
    (["track", "--mot", "{root}/good.txt", "--fps", "1e-300"], "frames a second, got 1e-300"),
    ([*TRACKS, "--gate", "inf"], "--gate: expected metres, above 0 and finite, got inf"),
    (
        ["eval", "bev", "{root}", "--bev", "x", "--range", "inf"],
        "--range: expected metres, above 0 and finite, got inf",
    ),
    (["track", "--mot", "{root}/good.txt", "--fps", "25", "--out", "{root}"], "written over the detections"),
    (["track", "--mot", "{root}/good.txt", "--fps", "25", "--out", "{root}/nan.txt"], "cannot be written"),
    (["eval", "tracks", "--gt", "{root}/none.txt", "--tracks", "{root}/good.txt"], "{root}/none.txt: cannot be read"),
    (["eval", "tracks", "--gt", "{root}/good.txt", "--tracks", "{root}/short.txt"], "short.txt: line 2: expected at"),
    (["eval", "tracks", "--gt", "{root}/good.txt", "--tracks", "{root}/nan.txt"], "nan.txt: line 1: expected finite"),
    (
        ["eval", "tracks", "--gt", "{root}/blanks.txt", "--tracks", "{root}/good.txt"],
        "blanks.txt: line 1: expected at",
    ),
    (["eval", "tracks", "--gt", "{root}/good.txt", "--tracks", "{root}/cut.json"], "cut.json: no valid JSON"),
    (["eval", "tracks", "--gt", "{root}", "--tracks", "{root}/tracks.json"], "translation: expected a value"),
    (["eval", "tracks", "--gt", "{root}", "--tracks", "{root}/good.txt"], "expected nuScenes JSON"),
    (["ground", "park", "{root}", "--scene", "scene-tiny", "--frame", "99"], "frames 0..2, not 99"),
    (["ground", "park", "{root}", "--scene", "scene-tiny", "--frame", "-1"], "not -1"),
    (["convert", "pandaset", "{root}", "{root}/out"], "no frames.json"),
    (["rig", "fit", "{root}/none", "--points", "p.csv", "--out", "{root}/r.yaml"], "{root}/none: no such folder"),
    (["rig", "fit", "{root}", "--points", "p.csv", "--out", "r.yaml", "--board", "9"], "such as 9x6, got '9'"),
    (
        ["rig", "fit", "{root}", "--points", "{root}/none.csv", "--out", "{root}/r.yaml"],
        "none.csv: cannot be read",
    ),
    (["demo", "--out", "{root}"], "{root}"),
]


@pytest.mark.parametrize(("words", "reason"), CASES, ids=[" ".join(words)[:75] for words, _ in CASES])
def test_bad_input_is_reported_in_one_line(
    tiny: TinyDataset,
    words: list[str],
    reason: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name, text in FILES.items():
        (tiny.root / name).write_text(text)
    before = sorted(tiny.root.rglob("*"))
    done = run_command([word.format(root=tiny.root) for word in words], capsys, monkeypatch)
    assert done.returncode == 2
    assert done.stdout == ""
    lines = [line for line in done.stderr.splitlines() if line.strip()]
    assert len(lines) == 1
    assert lines[0].startswith("error: ")
    assert reason.format(root=tiny.root) in lines[0]
    assert sorted(tiny.root.rglob("*")) == before


def test_bad_input_in_a_separate_process(tiny: TinyDataset) -> None:
    command = [sys.executable, "-m", "cli.main", "doctor", str(tiny.root / "none")]
    done = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == f"error: {tiny.root / 'none'}: no such folder\n"
