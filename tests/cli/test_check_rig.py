from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from tiny_dataset import TinyDataset
from typer.testing import CliRunner, Result

from appocc.errors import AppoccError
from appocc.files import read_image, write_image
from cli.main import app


def run(*words: object) -> Result:
    return CliRunner().invoke(app, ["check-rig", *map(str, words)])


def test_a_frame_of_a_scene(tiny: TinyDataset, tmp_path: Path) -> None:
    out = tmp_path / "rig.png"
    result = run(tiny.root, "--scene", "scene-tiny", "--frame", 2, "--out", out, "--json")
    assert result.exit_code == 0, result.stderr
    value = json.loads(result.stdout)
    assert value["picture"] == str(out)
    assert result.stderr.splitlines()[-1] == f"{out}: scene-tiny-0002"
    assert value["cameras"]["CAM_FRONT"]["yaw_deg"] == pytest.approx(0, abs=1e-6)
    assert abs(value["cameras"]["CAM_BACK"]["yaw_deg"]) == pytest.approx(180)
    assert value["cameras"]["CAM_BACK"]["height_m"] == pytest.approx(1.6)
    assert read_image(out).shape[0] == 640 + 26  # a row ahead, a row behind, the legend


def test_images_with_a_rig(tmp_path: Path) -> None:
    write_image(tmp_path / "CAM_FRONT.png", np.full((128, 352, 3), 90, np.uint8))
    result = run(tmp_path, "--rig", "paper", "--out", tmp_path / "rig.png")
    assert result.exit_code == 0, result.stderr
    assert "CAM_FRONT: yaw +0.0, pitch +0.0, roll +0.0 deg" in result.stderr
    assert "CAM_BACK: left out (no image)" in result.stderr
    assert read_image(tmp_path / "rig.png").shape == (320 + 26, 880, 3)


def test_a_wide_lens_with_pictures_of_another_size(tmp_path: Path) -> None:
    (tmp_path / "rig.yaml").write_text(
        "cameras:\n  nose: {size_px: [320, 240], fov_deg: 190, fisheye: [0, 0, 0, 0], position_m: [3.6, 0, 0.8],"
        " yaw_deg: 0}\n"
    )
    write_image(tmp_path / "nose.png", np.full((480, 640, 3), 90, np.uint8))
    result = run(tmp_path, "--rig", tmp_path / "rig.yaml", "--out", tmp_path / "rig.png")
    assert result.exit_code == 0, result.stderr
    lines = result.stderr.splitlines()
    assert lines[0] == "nose: expected 320x240 pixels, as size_px of its rig says, got 640x480; pictures are scaled"
    assert [line.partition(":")[0] for line in lines[1:3]] == ["CAM_NOSE_1", "CAM_NOSE_2"]
    assert read_image(tmp_path / "rig.png").shape[0] == 320 + 26


def test_missing_inputs(tiny: TinyDataset, tmp_path: Path) -> None:
    for words, reason in (((tiny.root, "--frame", 3), "frames 0..2, not 3"), ((tmp_path / "x",), "no such folder")):
        result = run(*words, "--out", tmp_path / "rig.png")
        assert isinstance(result.exception, AppoccError)
        assert reason in str(result.exception)
    assert not (tmp_path / "rig.png").exists()
