from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import torch
from tiny_dataset import TinyDataset, token
from torch import Tensor
from typer.testing import CliRunner, Result

from appocc.bevmap import BEVMap
from appocc.errors import AppoccError, DataError
from appocc.files import write_image
from appocc.inference import loading
from appocc.inference.predictor import Predictor, Weights
from appocc.models.base import BEVModel, ModelOutput
from appocc.models.memory import Past
from appocc.models.model_spec import MODEL_SPECS
from cli.main import app

RIG = """
cameras:
  CAM_FRONT: {size_px: [64, 36], fov_deg: 70, position_m: [1.7, 0, 1.5], yaw_deg: 0}
  CAM_BACK: {size_px: [64, 36], fov_deg: 70, position_m: [0, 0, 1.5], yaw_deg: 180}
"""


class _Plan:
    seen = torch.ones(1, 200, 200, dtype=torch.bool)

    def to(self, device: torch.device) -> _Plan:
        return self

    def for_export(self) -> _Plan:
        return self


class _Model(BEVModel):
    """A network that outputs only the mean colour."""

    spec = MODEL_SPECS["360"]

    def plan(self, rigs: object) -> _Plan:
        return _Plan()

    def forward(self, images: Tensor, plan: object, past: Past | None = None) -> ModelOutput:
        colour = images.mean(dim=(1, 3, 4))[:, :, None, None].expand(1, 3, 200, 200)
        return ModelOutput(torch.zeros(1, 3, 200, 200) - 1, colour, None)


@pytest.fixture(autouse=True)
def _made_weights(monkeypatch: pytest.MonkeyPatch) -> None:
    def load(weights: Path | None, device: torch.device | None = None) -> Predictor:
        if weights is None:
            raise DataError("no weights come with this version")
        kept = {"road": 0.5, "vehicle": 0.5, "lane": 0.5}
        return Predictor(_Model(), Weights("made", weights.name, kept), torch.device("cpu"))

    monkeypatch.setattr(loading, "load_predictor", load)


def run(*words: object) -> Result:
    return CliRunner().invoke(app, ["infer", *map(str, words)])


def test_a_scene(tiny: TinyDataset) -> None:
    out = tiny.root / "bev" / "mine"
    words = (tiny.root, "--scene", "scene-tiny", "--weights", "w", "--out", out, "--json")
    for made, kept in ((3, 0), (0, 3)):
        result = run(*words)
        assert result.exit_code == 0, result.stderr
        value = json.loads(result.stdout)
        assert (value["made"], value["kept"], value["left_out"]) == (made, kept, {})
        assert value["folder"] == str(out)
    assert {path.stem for path in out.glob("*.npz")} == {token("sample", i) for i in range(3)}


def test_a_folder_of_images_with_a_dead_camera(tmp_path: Path) -> None:
    (tmp_path / "rig.yaml").write_text(RIG)
    for name in ("a", "b"):
        write_image(tmp_path / "in" / name / "CAM_FRONT.png", np.full((36, 64, 3), 90, np.uint8))
    result = run(tmp_path / "in", "--rig", tmp_path / "rig.yaml", "--weights", "w", "--out", tmp_path / "out")
    assert result.exit_code == 0, result.stderr
    assert result.stdout == ""
    assert "left out: CAM_BACK in 2 frames (no image)\n" in result.stderr
    assert "2 maps made" in result.stderr
    bev = BEVMap.load(tmp_path / "out" / "b.npz")
    assert bev.meta["cameras"] == ["CAM_FRONT"]
    assert (bev.appearance == 90).all()
    assert (tmp_path / "out" / "pictures" / "a.jpg").is_file()


def test_maps_are_not_mixed_with_the_images(tiny: TinyDataset) -> None:
    before = sorted(tiny.root.rglob("*"))
    result = run(tiny.root, "--weights", "w", "--out", tiny.root)
    assert isinstance(result.exception, DataError)
    assert "expected another folder than that of the images" in str(result.exception)
    assert sorted(tiny.root.rglob("*")) == before


def test_detections_need_weights_with_objects_and_a_dataset(tiny: TinyDataset, tmp_path: Path) -> None:
    (tmp_path / "rig.yaml").write_text(RIG)
    write_image(tmp_path / "in" / "CAM_FRONT.png", np.full((36, 64, 3), 90, np.uint8))
    results = tmp_path / "r.json"
    cases = [
        ((tiny.root,), "r.json: the weights 'made' predict no objects to be written as detections"),
        ((tmp_path / "in", "--rig", tmp_path / "rig.yaml"), "expected a dataset, got a folder of images"),
    ]
    for words, reason in cases:
        result = run(*words, "--weights", "w", "--out", tmp_path / "out", "--detections", results)
        assert isinstance(result.exception, DataError), words
        assert reason in str(result.exception)
    assert not results.exists()


def test_bad_input_is_reported_in_one_line_of_infer(tiny: TinyDataset, tmp_path: Path) -> None:
    write_image(tmp_path / "DRIVE" / "0001" / "front.png", np.full((36, 64, 3), 90, np.uint8))
    cases = [
        ((tiny.root,), "no weights come with this version"),
        ((tmp_path, "--weights", "w"), "no nuScenes-schema dataset"),
        ((tmp_path / "DRIVE", "--weights", "w"), "images without the tables of a dataset; name their rig: --rig"),
        ((tmp_path / "DRIVE", "--weights", "w", "--device", "gpu"), "that torch can use, got 'gpu'"),
        ((tiny.root, "--weights", "w", "--scene", "x"), "no scene 'x'"),
        ((tiny.root, "--weights", "w", "--rig", "none.yaml"), "no rig of this name"),
        ((tiny.root, "--weights", "w", "--rig", "paper"), "expected images named by the cameras of the rig"),
        ((tiny.root, "--weights", "w", "--rig", "paper", "--scene", "x"), "expected either --scene"),
        ((tiny.root, "--weights", "w", "--rig", "paper", "--version", "v"), "expected either --version"),
    ]
    for words, reason in cases:
        result = run(*words, "--out", tmp_path / "out")
        assert isinstance(result.exception, AppoccError), words
        assert result.exception.exit_code == 2
        assert reason in str(result.exception)
        assert "\n" not in str(result.exception)
    assert not (tmp_path / "out").exists()


def test_without_pictures_only_maps_are_written(tiny: TinyDataset, tmp_path: Path) -> None:
    words = ["infer", str(tiny.root), "--weights", "w", "--out", str(tmp_path / "out"), "--no-pictures", "--json"]
    first = CliRunner().invoke(app, words)
    assert first.exit_code == 0, first.output
    assert json.loads(first.stdout)["pictures"] is None
    assert not (tmp_path / "out" / "pictures").exists()
    again = json.loads(CliRunner().invoke(app, words).stdout)
    assert (again["made"], again["kept"]) == (0, 3)


@pytest.mark.parametrize("device", ["toaster", "cuda:99"])
def test_an_unknown_device_is_refused(tiny: TinyDataset, tmp_path: Path, device: str) -> None:
    words = ["infer", str(tiny.root), "--weights", "w", "--out", str(tmp_path / "out"), "--device", device]
    done = CliRunner().invoke(app, words)
    assert isinstance(done.exception, DataError)
    assert f"got '{device}'" in str(done.exception)
