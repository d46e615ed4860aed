"""The commands and the Python code of docs/own_cameras.md work as written, with simulated webcams with distortion."""

from __future__ import annotations

import re
import shutil
import threading
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
from made_boards import write_boards, write_points
from made_own_recording import poses_of
from typer.testing import CliRunner
from walkthrough import README, blocks, run_line

from appocc.checks import ByteArray
from appocc.files import read_image
from appocc.frame import Frame
from appocc.geometry import yaw_of
from appocc.nuscenes import Dataset
from appocc.rigs import read_source_rig
from cli.main import app

PAGE = README.parent / "docs" / "own_cameras.md"
_LENS = "size_px: [416, 234], distortion: [-0.22, 0.05, 0.001, -0.001]"
RIG = f"""
cameras:
  front: {{{_LENS}, fov_deg: 95, position_m: [1.6, 0, 1.5], yaw_deg: 0, pitch_deg: 5}}
  front_left: {{{_LENS}, fov_deg: 95, position_m: [1.4, 0.5, 1.5], yaw_deg: 65, pitch_deg: 6}}
  front_right: {{{_LENS}, fov_deg: 95, position_m: [1.4, -0.5, 1.5], yaw_deg: -65, pitch_deg: 6}}
  back_left: {{{_LENS}, fov_deg: 95, position_m: [0.6, 0.5, 1.5], yaw_deg: 140, pitch_deg: 6}}
  back_right: {{{_LENS}, fov_deg: 95, position_m: [0.6, -0.5, 1.5], yaw_deg: -140, pitch_deg: 6}}
"""
FRAMES = 4


def code(heading: str, language: str) -> list[str]:
    """The code blocks of a language below a heading of the page."""
    text = PAGE.read_text().split(f"\n## {heading}\n", 1)[1].split("\n## ", 1)[0]
    return [block.strip() for block in re.findall(rf"```{language}\n(.*?)```", text, flags=re.DOTALL)]


def commands(heading: str) -> list[str]:
    return [line for block in code(heading, "") for line in block.splitlines() if line.startswith("appocc ")]


@pytest.fixture(scope="module")
def webcams(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the page's reader: DRIVE, BOARDS, points.csv and poses.csv of simulated webcams."""
    folder = tmp_path_factory.mktemp("webcams")
    (folder / "true.yaml").write_text(RIG)
    words = f"simulate {folder}/SIM --scenes 1 --seconds {FRAMES / 2} --split test --no-lidar --weather overcast"
    done = CliRunner().invoke(app, [*words.split(), "--workers", "1", "--rig", str(folder / "true.yaml")])
    assert done.exit_code == 0, done.output
    times, poses = poses_of(folder / "SIM")
    rig = read_source_rig(folder / "true.yaml")
    for number, time_us in enumerate(times):
        for name in rig.names:
            target = folder / "DRIVE" / name / f"{time_us}.jpg"
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(next(folder.glob(f"SIM/raw/*/{number:04d}/{name}.jpg")), target)
    rows = [
        f"{t / 1e6:.6f},{pose[0, 3]:.4f},{pose[1, 3]:.4f},{np.degrees(float(yaw_of(pose))):.4f}"
        for t, pose in zip(times, poses, strict=True)
    ]
    (folder / "poses.csv").write_text("time,x,y,yaw_deg\n" + "\n".join(rows) + "\n")
    for camera in rig.cameras:
        write_boards(folder / "BOARDS", camera, 14, 0.8, 0.9)
    write_points(folder / "points.csv", rig.cameras, noise_px=0.5)
    return folder


@pytest.fixture(scope="module")
def walked(webcams: Path) -> Path:
    """The same folder after the commands of the page."""
    for heading in ("2. Calibrate", "3. Convert", "4. Predict, track, ground"):
        for line in commands(heading):
            ended, said = run_line(line, webcams)
            assert ended == 0, (line, said)
    return webcams


class PacedCapture:
    """A webcam: the pictures of a folder, one every `seconds`."""

    def __init__(self, folder: Path, seconds: float) -> None:
        self._images: Iterator[ByteArray] = (read_image(path)[..., ::-1] for path in sorted(folder.iterdir()))
        self._seconds = seconds

    def isOpened(self) -> bool:  # noqa: N802 - OpenCV's name
        return True

    def read(self) -> tuple[bool, ByteArray | None]:
        threading.Event().wait(self._seconds)
        image = next(self._images, None)
        return image is not None, image

    def release(self) -> None:
        pass


def plug_in(folder: Path, seconds: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Devices 0 to 4 are the simulated webcams, in the order of the rig."""
    names = read_source_rig(folder / "true.yaml").names
    monkeypatch.setattr(cv2, "VideoCapture", lambda device: PacedCapture(folder / "DRIVE" / names[device], seconds))


def test_the_page_has_the_commands_in_order() -> None:
    assert [line.split()[1] for line in commands("2. Calibrate")] == ["rig"]
    assert [line.split()[1] for line in commands("3. Convert")] == ["convert", "doctor", "check-rig"]
    assert [line.split()[1] for line in commands("4. Predict, track, ground")] == ["infer", "track", "ground"]


def test_the_readme_has_commands_of_the_page() -> None:
    on_page = [
        line for heading in ("2. Calibrate", "3. Convert", "4. Predict, track, ground") for line in commands(heading)
    ]
    lines = blocks("## With your own cameras")[1].splitlines()
    assert [line.split()[1] for line in lines] == ["rig", "convert", "infer", "track"]
    assert set(lines) <= set(on_page)


def test_the_commands_make_a_tracked_recording(walked: Path) -> None:
    dataset = Dataset(walked / "OUT")
    samples = dataset.samples(dataset.scene("DRIVE"))
    assert len(samples) == FRAMES
    assert len(list((walked / "OUT" / "bev" / "predicted").glob("*.npz"))) == FRAMES
    assert (walked / "OUT" / "tracks" / "predicted" / "DRIVE" / "tracking.json").is_file()
    for name in ("rig.png", "ground.png"):
        assert (walked / name).read_bytes().startswith(b"\x89PNG")


def test_the_fitted_rig_is_near_the_true_one(walked: Path) -> None:
    true, fitted = (read_source_rig(walked / name) for name in ("true.yaml", "rig.yaml"))
    assert set(fitted.names) == set(true.names)
    for camera in true.cameras:
        found = next(each for each in fitted.cameras if each.name == camera.name)
        np.testing.assert_allclose(found.ego_from_cam, camera.ego_from_cam, atol=0.05)


def test_the_recorder_writes_the_pictures_of_all_cameras(
    webcams: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plug_in(webcams, 0.01, monkeypatch)
    monkeypatch.chdir(tmp_path)
    exec(compile(code("1. Record", "python")[0], str(PAGE), "exec"), {})
    assert sorted(path.name for path in (tmp_path / "DRIVE").iterdir()) == sorted(
        path.name for path in (webcams / "DRIVE").iterdir()
    )


def test_the_live_example_tracks_frames_as_they_come(
    walked: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    plug_in(walked, 0.6, monkeypatch)
    monkeypatch.chdir(walked)
    names: dict[str, object] = {}
    exec(compile(code("Live", "python")[0], str(PAGE), "exec"), names)
    frame = names["frame"]
    assert isinstance(frame, Frame)
    assert frame.images.keys() <= {
        "CAM_FRONT",
        "CAM_FRONT_LEFT",
        "CAM_FRONT_RIGHT",
        "CAM_BACK_LEFT",
        "CAM_BACK_RIGHT",
    }
    assert "skipped: {" in capsys.readouterr().out


@pytest.mark.slow
def test_the_training_commands_run_in_order(walked: Path) -> None:
    for line in commands("Weights for your rig"):
        ended, said = run_line(line, walked)
        assert ended == 0, (line, said)
