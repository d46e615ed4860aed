"""Exported files: they stand alone, answer as the network does, or are not there."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import torch
from made_export import RIG, SIZES_PX, THRESHOLDS, weights_file
from tiny_dataset import TinyDataset
from typer.testing import CliRunner, Result

from appocc.camera import CameraRig
from appocc.errors import AppoccError, DataError
from appocc.export import run as export_run
from appocc.export.convert import write_openvino
from appocc.export.parity import ParityError, parity_limit
from appocc.export.run import ExportSource, export
from appocc.files import write_image
from appocc.frame import Frame
from appocc.inference.loading import load_predictor
from appocc.models.model_spec import MODEL_SPECS
from appocc.models.registry import NETWORKS
from appocc.models.weights import load_model
from appocc.rigs import read_rig
from cli.main import app

onnx = pytest.importorskip("onnx")
onnxruntime = pytest.importorskip("onnxruntime")
openvino = pytest.importorskip("openvino")
GUIDE = Path(__file__).parents[2] / "docs" / "export.md"


class Made(NamedTuple):
    """An exported network."""

    folder: Path
    result: Result

    @property
    def report(self) -> Any:
        return json.loads(self.result.stdout)


def run(*words: object) -> Result:
    return CliRunner().invoke(app, ["export", *map(str, words)])


@pytest.fixture(scope="module")
def by_rig(tmp_path_factory: pytest.TempPathFactory) -> Made:
    """The default network for a rig's file, as ONNX."""
    folder = tmp_path_factory.mktemp("by_rig")
    (folder / "rig.yaml").write_text(RIG)
    weights = weights_file(folder / "w.safetensors", "appocc")
    words = ("--weights", weights, "--rig", folder / "rig.yaml", "--out", folder / "model.onnx", "--runs", 1)
    return Made(folder, run(*words, "--json"))


@pytest.fixture(scope="module")
def by_dataset(tmp_path_factory: pytest.TempPathFactory) -> Made:
    """Another network for a dataset's rig, as OpenVINO's files."""
    folder = tmp_path_factory.mktemp("by_dataset")
    root = TinyDataset(folder / "tiny").root
    weights = weights_file(folder / "w.safetensors", "lss")
    words = (root, "--scene", "scene-tiny", "--weights", weights, "--out", folder / "deep" / "model.xml")
    return Made(folder, run(*words, "--runs", 1, "--format", "openvino", "--json"))


def test_an_onnx_file_stands_alone(by_rig: Made) -> None:
    assert by_rig.result.exit_code == 0, by_rig.result.stderr
    session = onnxruntime.InferenceSession(by_rig.folder / "model.onnx", providers=["CPUExecutionProvider"])
    (pictures,) = session.get_inputs()
    assert (pictures.name, pictures.shape, pictures.type) == ("images", [1, 3, 3, 64, 96], "tensor(float)")
    shapes = {output.name: (output.shape, output.type) for output in session.get_outputs()}
    cells = [1, 3, 32, 32]
    assert shapes == {
        "occupancy": (cells, "tensor(float)"),
        "appearance": (cells, "tensor(float)"),
        "seen": ([32, 32], "tensor(bool)"),
    }
    card = json.loads(session.get_modelmeta().custom_metadata_map["card"])
    assert card == by_rig.report["card"]
    assert (card["network"], card["setting"], card["classes"]) == ("appocc", "small", ["road", "vehicle", "lane"])
    assert list(card["thresholds"].values()) == json.loads(THRESHOLDS)
    assert [camera["channel"] for camera in card["cameras"]] == ["CAM_FRONT", "CAM_BACK", "CAM_SIDE"]
    assert card["weights"]["sha256"] == load_predictor(by_rig.folder / "w.safetensors").weights.digest
    assert card["input"]["shape"] == pictures.shape
    assert {name: output["shape"] for name, output in card["outputs"].items()} == {
        name: shape for name, (shape, _) in shapes.items()
    }


def test_a_file_says_nothing_of_the_machine_that_made_it(by_rig: Made) -> None:
    data = (by_rig.folder / "model.onnx").read_bytes()
    for path in (str(Path(__file__).parents[2]), str(Path(torch.__file__).parent), str(by_rig.folder)):
        assert path.encode() not in data
    model = onnx.load_from_string(data)
    assert not any(node.doc_string or node.metadata_props for node in model.graph.node)


def test_the_check_is_told(by_rig: Made, by_dataset: Made) -> None:
    for made, outputs in ((by_rig, 3), (by_dataset, 2)):
        parity = made.report["parity"]
        assert len(parity["largest_difference"]) == outputs
        assert all(value <= parity["limit"] < 3e-4 for value in parity["largest_difference"].values())
        assert (parity["runs"], parity["threads"]) == (1, [1, 2, 4])
        assert "largest difference: occupancy" in made.result.stderr
    assert by_rig.report["parity"]["inputs"] == ["noise", "patches", "grey"]
    assert len(by_dataset.report["parity"]["inputs"]) == 6  # and three frames of the dataset


def test_openvinos_files_stand_together(by_dataset: Made) -> None:
    assert by_dataset.result.exit_code == 0, by_dataset.result.stderr
    folder = by_dataset.folder / "deep"
    files = [str(folder / f"model.{ending}") for ending in ("xml", "bin", "json")]
    assert by_dataset.report["files"] == files
    assert sorted(map(str, folder.iterdir())) == sorted(files)
    model = openvino.Core().read_model(files[0])
    card = json.loads(Path(files[2]).read_text())
    assert json.loads(model.get_rt_info("card").value) == card == by_dataset.report["card"]
    assert card["rig"] == "scene-tiny of tiny"
    compiled = openvino.compile_model(model, "CPU", {"INFERENCE_PRECISION_HINT": "f32"})
    found = compiled({"images": np.full(card["input"]["shape"], 0.5, np.float32)})
    assert {output.any_name for output in compiled.outputs} == {"occupancy", "seen"}
    assert 0 <= found["occupancy"].min() < found["occupancy"].max() <= 1


def test_openvinos_files_are_the_same_each_time(by_rig: Made, tmp_path: Path) -> None:
    model = onnx.load(by_rig.folder / "model.onnx")
    for name in ("a", "b"):
        write_openvino(model, "{}", tmp_path / f"{name}.xml", tmp_path / f"{name}.bin")
    for ending in ("xml", "bin"):
        assert (tmp_path / f"a.{ending}").read_bytes() == (tmp_path / f"b.{ending}").read_bytes()


def test_the_guides_lines_answer_as_the_network(by_rig: Made, monkeypatch: pytest.MonkeyPatch) -> None:
    draw = np.random.default_rng(3)
    images = {
        name: np.asarray(draw.integers(0, 255, (high, wide, 3)), np.uint8) for name, (wide, high) in SIZES_PX.items()
    }
    for name, image in images.items():
        write_image(by_rig.folder / "FRAME" / f"{name}.png", image)
    (code,) = re.findall(r"```python\n(.*?)```", GUIDE.read_text(), flags=re.DOTALL)
    assert "appocc" not in code
    assert "torch" not in code
    monkeypatch.chdir(by_rig.folder)
    names: dict[str, Any] = {}
    exec(compile(code, GUIDE.name, "exec"), names)
    frame = Frame("frame", 0, np.eye(4), read_rig("rig.yaml"), images)
    bev, seen = load_predictor(by_rig.folder / "w.safetensors", torch.device("cpu"))(frame)
    limit = parity_limit(load_model(by_rig.folder / "w.safetensors")[0])
    assert np.abs(names["occupancy"][0] - bev.occupancy).max() <= limit
    assert np.abs(names["appearance"][0] * 255 - bev.appearance).max() <= 0.51
    assert np.array_equal(names["seen"], seen)
    least = np.array(json.loads(THRESHOLDS))[:, None, None]
    clear = np.abs(bev.occupancy - least) > limit
    assert np.array_equal(names["on"][clear], (bev.occupancy >= least)[clear])
    assert bev.occupancy.std(axis=(1, 2)).min() > 0.02  # else anything would pass


def test_a_file_that_answers_differently_is_not_left(
    by_rig: Made, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = onnx.load(by_rig.folder / "model.onnx")
    last = next(each for each in other.graph.initializer if each.name.endswith("heads.answer.weight"))
    last.CopyFrom(onnx.numpy_helper.from_array(onnx.numpy_helper.to_array(last) * np.float32(1.02), last.name))
    monkeypatch.setattr(export_run, "to_onnx", lambda *_: other)
    rig = ExportSource(read_rig(str(by_rig.folder / "rig.yaml")), "rig")
    for ending in ("onnx", "xml"):
        with pytest.raises(
            ParityError, match=r"not written: .* by occupancy 0\.0\d+, appearance 0\.0\d+, seen 0,"
        ) as report:
            export(by_rig.folder / "w.safetensors", rig, tmp_path / "new" / f"model.{ending}", 1)
        assert report.value.exit_code == 1
    assert list(tmp_path.iterdir()) == []


def test_a_missing_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    weights = weights_file(tmp_path / "w.safetensors", "neat")
    for name, out in (("onnxscript", "m.onnx"), ("onnxruntime", "m.onnx"), ("openvino", "m.xml")):
        with monkeypatch.context() as patch:
            patch.setitem(sys.modules, name, None)
            result = run("--weights", weights, "--rig", "paper", "--out", tmp_path / out)
        assert isinstance(result.exception, AppoccError)
        assert result.exception.exit_code == 2
        assert str(result.exception).startswith(f"exporting needs {name}: pip install 'appocc[export]'")
    assert list(tmp_path.iterdir()) == [weights]


def test_a_dataset_without_scenes(tiny: TinyDataset, tmp_path: Path) -> None:
    for table in tiny.tables:
        tiny.tables[table] = []
    result = run(tiny.write(), "--out", tmp_path / "m.onnx")
    assert isinstance(result.exception, DataError)
    assert str(result.exception) == f"{tiny.root}: expected a scene, got none"


def test_what_cannot_be_done_is_told_in_one_line(tiny: TinyDataset, tmp_path: Path) -> None:
    weights = weights_file(tmp_path / "w.safetensors", "neat")
    onnx_out = ("--out", tmp_path / "m.onnx")
    (tmp_path / "side.yaml").write_text("cameras: {CAM_A: {size_px: [9, 9], fov_deg: 70}}")
    cases = [
        (("--weights", weights, "--out", tmp_path / "m.pt"), "expected a name that ends in .onnx or .xml"),
        (("--weights", weights, *onnx_out, "--format", "openvino"), "expected a name that ends in .xml"),
        (("--weights", "ipm", *onnx_out), "this network has no weights"),
        (("--weights", tmp_path / "no.safetensors", *onnx_out), "no such file of weights"),
        (("--weights", weights, *onnx_out, "--rig", tmp_path / "none.yaml"), "no rig of this name"),
        (("--weights", weights, *onnx_out, "--scene", "s"), "expected ROOT with --scene"),
        (("--weights", weights, *onnx_out, "--version", "v1.0-mini"), "expected ROOT with --version"),
        (("--weights", weights, *onnx_out, "--rig", ""), "no rig of this name"),
        (("--weights", weights, *onnx_out, tiny.root, "--rig", "paper"), "expected either ROOT or --rig"),
        (("--weights", weights, *onnx_out, tiny.root, "--scene", "x"), "no scene 'x'"),
        (("--weights", weights, *onnx_out, "--rig", tmp_path / "side.yaml"), "invalid camera rig"),
        (("--weights", weights, "--out", weights / "m.onnx"), "cannot be written"),
    ]
    before = sorted(tmp_path.rglob("*"))
    for words, reason in cases:
        result = run(*words)
        assert isinstance(result.exception, AppoccError), words
        assert result.exception.exit_code == 2
        assert reason in str(result.exception)
        assert "\n" not in str(result.exception)
        assert result.stdout == ""
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.parametrize(("name", "spec"), [("appocc", "360"), *((name, "180") for name in NETWORKS)])
def test_every_network_in_both_forms_at_full_size(name: str, spec: str, tmp_path: Path) -> None:
    weights = weights_file(tmp_path / "w.safetensors", name, MODEL_SPECS[spec])
    rig = ExportSource(CameraRig(tuple(read_rig("paper"))), "paper")
    for out in ("a.onnx", "a.xml"):
        done = export(weights, rig, tmp_path / out, 1)
        assert done.parity.holds
        assert done.parity.between_runs <= done.parity.limit
