"""The examples of docs/rigs.md are rigs, and its Python code runs."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from test_calibration_files import CHAIN, ROS

from appocc.files import write_image
from appocc.rigs import SourceRig, read_source_rig

TEXT = (Path(__file__).parents[2] / "docs" / "rigs.md").read_text()


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", TEXT, flags=re.DOTALL)


@pytest.fixture
def rigs(tmp_path: Path) -> list[SourceRig]:
    (tmp_path / "front.yaml").write_text(ROS)
    (tmp_path / "camchain.yaml").write_text(CHAIN)
    found = []
    for text in blocks("yaml"):
        (tmp_path / "rig.yaml").write_text(text)
        found.append(read_source_rig(tmp_path / "rig.yaml"))
    return found


def test_every_example_is_a_rig(rigs: list[SourceRig]) -> None:
    assert [rig.names for rig in rigs] == [
        ("front", "reverse_cam"),
        ("kannala_brandt", "polynomial", "mirror"),
        ("left", "right", "back"),
        ("front", "left"),
    ]


def test_the_cameras_of_the_examples_look_where_their_names_say(rigs: list[SourceRig]) -> None:
    yaws = [
        round(float(np.degrees(np.arctan2(*camera.ego_from_cam[1::-1, 2]))))
        for rig in (rigs[0], rigs[2], rigs[3])
        for camera in rig.cameras
    ]
    assert [abs(yaw) if abs(yaw) == 180 else yaw for yaw in yaws] == [0, 180, 55, -55, 180, 0, 0]
    for rig in rigs:
        assert all(abs(float(camera.ego_from_cam[2, 1])) > 0.8 for camera in rig.cameras), (
            "no picture lies on its side"
        )


def test_the_python_code_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    write_image(tmp_path / "front.jpg", np.full((960, 1280, 3), 90, np.uint8))
    names: dict[str, object] = {}
    (code,) = blocks("python")
    exec(compile(code, "rigs.md", "exec"), names)
    images = names["images"]
    assert isinstance(images, dict)
    assert set(images) == {"CAM_FRONT_1", "CAM_FRONT_2"}
