from __future__ import annotations

import hashlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from in_process import run_command
from typer.testing import CliRunner, Result

from appocc.errors import DataError
from appocc.files import read_image
from appocc.nuscenes import Dataset
from appocc.nuscenes.validate import validate
from appocc.rigs import read_source_rig
from appocc.simulation.builtin import TEST_TOWNS, TRAIN_TOWNS
from cli.main import app

RIG = """
cameras:
  CAM_FRONT: {size_px: [64, 32], fov_deg: 90, position_m: [1.7, 0, 1.5], yaw_deg: 0}
  CAM_BACK: {size_px: [48, 32], fov_deg: 90, position_m: [0, 0, 1.5], yaw_deg: 180}
"""
WIDE = """
cameras:
  nose: {size_px: [160, 120], fov_deg: 190, fisheye: [0.01, 0, 0, 0], position_m: [3, 0, 1], yaw_deg: 0}
"""


def run(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments))


def command(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "cli.main", "simulate", *arguments]


def digests(root: Path) -> dict[str, str]:
    files = (path for path in root.rglob("*") if path.is_file())
    return {str(path.relative_to(root)): hashlib.md5(path.read_bytes()).hexdigest() for path in files}


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("rig") / "two.yaml"
    path.write_text(RIG)
    return str(path)


def test_a_system_without_file_locks_ends_with_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("appocc.temporary.fcntl", None)
    done = run_command(["simulate", str(tmp_path / "new" / "out"), "--scenes", "1"], capsys, monkeypatch)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.count("\n") == 1
    assert "expected a Unix system with file locks (fcntl)" in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_rig_of_ones_own_full_maps_and_no_lidar(tmp_path: Path, rig: str) -> None:
    out = tmp_path / "out"
    options = ["--rig", rig, "--no-lidar", "--full-maps", "--weather", "wet", "--town", TEST_TOWNS[0]]
    result = run("simulate", str(out), "--scenes", "1", "--seconds", "1", "--workers", "1", "--json", *options)
    assert result.exit_code == 0, result.output
    value = json.loads(result.stdout)
    assert (value["scenes"], value["frames"], value["made"]) == (1, 2, 2)
    dataset = Dataset(out)
    frame = dataset.frame(dataset.samples(dataset.scenes[0])[0])
    assert {name: image.shape for name, image in frame.images.items()} == {
        "CAM_FRONT": (32, 64, 3),
        "CAM_BACK": (32, 48, 3),
    }
    assert "wet" in dataset.scenes[0].description
    assert not (out / "samples" / "LIDAR_TOP").exists()
    assert len(list((out / "views_full").glob("*.npz"))) == 2
    assert validate(dataset, images=True) == ()
    again = run("simulate", str(out), "--scenes", "1", "--seconds", "1", "--workers", "1", "--json", *options)
    assert json.loads(again.stdout)["made"] == 0


def test_other_lenses_keep_their_pictures_beside_the_rectified_ones(tmp_path: Path) -> None:
    (tmp_path / "rig.yaml").write_text(WIDE)
    out, options = tmp_path / "out", ["--no-lidar", "--town", TEST_TOWNS[0], "--workers", "1"]
    sizes = ["--scenes", "1", "--seconds", "0.5", "--rig", str(tmp_path / "rig.yaml")]
    result = run("simulate", str(out), *sizes, *options)
    assert result.exit_code == 0, result.output
    dataset = Dataset(out)
    assert validate(dataset, images=True) == ()
    frame = dataset.frame(dataset.samples(dataset.scenes[0])[0])
    rig = read_source_rig(tmp_path / "rig.yaml")
    assert set(frame.images) == set(rig.rig.channels) == {"CAM_NOSE_1", "CAM_NOSE_2"}
    np.testing.assert_allclose(frame.rig["CAM_NOSE_1"].ego_from_cam, rig.rig["CAM_NOSE_1"].ego_from_cam, atol=1e-6)
    picture = read_image(out / "raw" / "scene-0000" / "0000" / "nose.jpg")
    assert picture.shape == (120, 160, 3)
    for channel, image in rig.rectify({"nose": picture}).items():
        # Both were stored as JPEG, one before it was rectified.
        assert np.abs(frame.images[channel].astype(int) - image).mean() < 6
    (tmp_path / "rig.yaml").write_text(WIDE.replace("0.01", "0.02"))
    other = run("simulate", str(out), *sizes, *options)
    assert isinstance(other.exception, DataError)
    assert "other settings (rig, lenses)" in str(other.exception)


@pytest.mark.slow
def test_other_lenses_vary(tmp_path: Path) -> None:
    (tmp_path / "rig.yaml").write_text(WIDE)
    sizes = ["--scenes", "1", "--seconds", "0.5", "--rig", str(tmp_path / "rig.yaml"), "--town", TEST_TOWNS[0]]
    varied = run("simulate", str(tmp_path / "varied"), *sizes, "--no-lidar", "--workers", "1", "--vary")
    assert varied.exit_code == 0, varied.output
    dataset = Dataset(tmp_path / "varied")
    assert validate(dataset, images=True) == ()
    camera = dataset.frame(dataset.samples(dataset.scenes[0])[0]).rig["CAM_NOSE_1"]
    still = read_source_rig(tmp_path / "rig.yaml").rig["CAM_NOSE_1"]
    assert np.linalg.norm(camera.ego_from_cam[:3, 3] - still.ego_from_cam[:3, 3]) > 0.02


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--town", "atlantis"], "atlantis"),
        (["--weather", "hail"], "hail"),
        (["--rig", "/nowhere/rig.yaml"], "no rig of this name"),
        (["--sheet", "sheet.gif"], ".png"),
        (["--sheet", f"{__file__}/sheet.png"], "below a file"),
        (["--town", TRAIN_TOWNS[0], "--town", TRAIN_TOWNS[0]], "different names"),
        (["--town", __file__], "expected an OpenDRIVE"),
        (["--seconds", "599", "--town", TRAIN_TOWNS[0]], "no vehicle drives"),
    ],
)
def test_bad_input_is_told_and_leaves_nothing(
    tmp_path: Path,
    arguments: list[str],
    message: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    done = run_command(["simulate", str(tmp_path / "out"), "--scenes", "1", *arguments], capsys, monkeypatch)
    assert done.returncode == 2
    assert message in done.stderr
    assert "Traceback" not in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("out", "arguments", "message"),
    [
        (".", [], "working folder"),
        ("out.png", ["--sheet", "out.png"], "a file name for the sheet"),
        ("new/folder/out", ["--seconds", "599"], "no vehicle drives"),
        ("new/" + "x" * 250, [], "too long"),
    ],
)
def test_a_folder_that_cannot_be_is_told_before_the_work(
    tmp_path: Path,
    out: str,
    arguments: list[str],
    message: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    done = run_command(["simulate", out, "--scenes", "1", *arguments], capsys, monkeypatch)
    assert done.returncode == 2
    assert message in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


def test_where_compiled_code_cannot_be_kept_a_line_tells_what_to_set(tmp_path: Path) -> None:
    code = "import sys; from numba.core import caching; from cli.main import run\n"
    code += "caching.CacheImpl._locator_classes = []\n"  # as where neither the package nor HOME can be written
    code += f"sys.argv = ['appocc', 'simulate', {str(tmp_path / 'out')!r}]; run()"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "NUMBA_CACHE_DIR" in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.parametrize("more", [(), ("--vary",)])
def test_neither_workers_nor_kill_9_change_a_byte(tmp_path: Path, rig: str, more: tuple[str, ...]) -> None:
    options = ["--scenes", "4", "--seconds", "2", "--rig", rig, "--split", "test", "--seed", "9", *more]
    subprocess.run(command(str(tmp_path / "one"), *options, "--workers", "1"), check=True, capture_output=True)
    out = tmp_path / "two"
    process = subprocess.Popen(
        command(str(out), *options, "--workers", "2"), start_new_session=True, stderr=subprocess.DEVNULL
    )
    rows = f".{out.name}.unfinished/scenes/scene-????/v1.0-simulation"
    deadline = time.monotonic() + 300
    while not list(tmp_path.glob(rows)):
        assert process.poll() is None, "it ended before it could be killed"
        assert time.monotonic() < deadline
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    assert not out.exists()
    done = subprocess.run(command(str(out), *options, "--workers", "2"), check=True, capture_output=True, text=True)
    assert "resuming after" in done.stderr
    assert digests(out) == digests(tmp_path / "one")
    assert [path.name for path in sorted(tmp_path.iterdir())] == ["one", "two"]


@pytest.mark.slow
def test_ctrl_c_keeps_finished_scenes_and_says_so(tmp_path: Path, rig: str) -> None:
    out = tmp_path / "out"
    options = ["--scenes", "40", "--seconds", "1", "--rig", rig, "--town", TEST_TOWNS[0], "--workers", "2"]
    # What a shell starts in the background ignores Ctrl-C, and so does all that it starts.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    process = subprocess.Popen(command(str(out), *options), stderr=subprocess.PIPE, text=True)
    while not list(tmp_path.glob(".out.unfinished/scenes/scene-????/v1.0-simulation")):
        assert process.poll() is None
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    said = process.communicate(timeout=300)[1]
    assert process.returncode not in (0, 1)
    assert "interrupted; to resume" in said
    assert "kept in" in said
    assert "Traceback" not in said
    assert not list(tmp_path.glob(".out.unfinished/scenes/*.part"))


@pytest.mark.slow
def test_two_hundred_frames_over_all_towns(tmp_path: Path) -> None:
    out = tmp_path / "out"
    sheet = tmp_path / "sheet.png"
    options = ["--scenes", "8", "--seconds", "12.5", "--hz", "2", "--split", "all", "--seed", "3"]
    subprocess.run(command(str(out), *options, "--sheet", str(sheet)), check=True, capture_output=True)
    dataset = Dataset(out)
    assert {dataset.location(scene) for scene in dataset.scenes} == {*TRAIN_TOWNS, *TEST_TOWNS}
    assert sum(len(dataset.samples(scene)) for scene in dataset.scenes) == 200
    assert validate(dataset, images=True) == ()
    assert read_image(sheet).std() > 20
    nuscenes = pytest.importorskip("nuscenes", reason="nuscenes-devkit is not installed")
    kit = nuscenes.NuScenes("v1.0-simulation", str(out), verbose=False)
    assert len(kit.sample) == 200
