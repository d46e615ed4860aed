"""INT8 export: convolutions are quantized, predictions stay, and what cannot be done is said in one line."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_export import ALL_PARTS, THRESHOLDS, weights_file
from tiny_dataset import TinyDataset
from typer.testing import CliRunner, Result

from appocc.bevmap import CLASSES
from appocc.errors import AppoccError, DataError
from appocc.export.graph import MEMORY, NEXT_MEMORY, OCCUPANCY
from appocc.export.quantize import Agreement, calibration_inputs, measure_agreement
from appocc.export.runtimes import Inputs, Outputs
from cli.main import app

openvino = pytest.importorskip("openvino")
pytest.importorskip("nncf")


def run(*words: object) -> Result:
    return CliRunner().invoke(app, ["export", *map(str, words)])


@pytest.mark.openvino
def test_convolutions_are_int8_and_predictions_stay(tmp_path: Path) -> None:
    root = TinyDataset(tmp_path / "tiny").root
    weights = weights_file(tmp_path / "w.safetensors", "appocc", parts=ALL_PARTS)
    out = tmp_path / "int8.xml"
    result = run(root, "--weights", weights, "--out", out, "--int8", "--json")
    assert result.exit_code == 0, result.output
    report = json.loads(result.stdout)
    assert sorted(Path(file).name for file in report["files"]) == ["int8.bin", "int8.json", "int8.xml"]
    assert list(report["agreement"]["iou"]) == list(CLASSES)
    assert min(report["agreement"]["iou"].values()) > 0.85
    model = openvino.Core().read_model(str(out))
    kinds = [layer.get_type_name() for layer in model.get_ordered_ops()]
    assert 2 * kinds.count("FakeQuantize") > kinds.count("Convolution") > 20
    assert json.loads(model.get_rt_info("card").value)["thresholds"] == dict(
        zip(CLASSES, json.loads(THRESHOLDS), strict=True)
    )


def test_frames_carry_the_memory_of_the_frame_before() -> None:
    def network(inputs: Inputs) -> Outputs:
        return {NEXT_MEMORY: inputs[MEMORY] + inputs["images"]}

    def one(value: float) -> np.ndarray:
        return np.full((1,), value, np.float32)

    clips = [
        [{"images": one(1), MEMORY: one(0)}, {"images": one(2)}, {"images": one(3)}],
        [{"images": one(5), MEMORY: one(0)}],
    ]
    found = calibration_inputs(network, clips)
    assert [float(each[MEMORY][0]) for each in found] == [0, 1, 3, 0]
    assert [float(each["images"][0]) for each in found] == [1, 2, 3, 5]


def test_agreement_is_the_overlap_of_the_cells() -> None:
    def answer(cells: list[list[float]]) -> Outputs:
        return {OCCUPANCY: np.array(cells, np.float32)[None, :, :, None]}

    network = answer([[0.9, 0.9], [0.9, 0.1], [0.1, 0.1]])
    exported = answer([[0.9, 0.1], [0.9, 0.1], [0.1, 0.1]])
    found = measure_agreement(lambda _: network, lambda _: exported, [[{}]], (0.5, 0.5, 0.5), 7)
    assert (found.frames, found.calibrated) == (1, 7)
    assert found.iou == dict(zip(CLASSES, (0.5, 1.0, 1.0), strict=True))  # no lane in either: they agree
    assert not found.holds
    assert isinstance(found, Agreement)
    assert replace(found, iou=dict.fromkeys(CLASSES, 0.9)).holds


def test_what_cannot_be_done_is_said_in_one_line(tmp_path: Path) -> None:
    weights = weights_file(tmp_path / "w.safetensors", "appocc")
    root = TinyDataset(tmp_path / "tiny").root
    for words, error in (
        ((root, "--out", tmp_path / "m.onnx"), "expected a name that ends in .xml for INT8"),
        (("--out", tmp_path / "m.xml"), "expected ROOT with --int8, whose images it is calibrated on, got none"),
    ):
        result = run(*words, "--weights", weights, "--int8")
        assert isinstance(result.exception, DataError)
        assert str(result.exception).endswith(error)
    assert not list(tmp_path.glob("m.*"))


def test_without_nncf_it_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "nncf", None)
    weights = weights_file(tmp_path / "w.safetensors", "appocc")
    result = run(TinyDataset(tmp_path / "tiny").root, "--weights", weights, "--int8", "--out", tmp_path / "m.xml")
    assert isinstance(result.exception, AppoccError)
    assert str(result.exception).startswith("exporting needs nncf: pip install '.[export]'")
