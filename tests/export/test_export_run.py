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
from made_export import ALL_PARTS, RIG, SIZES_PX, THRESHOLDS, weights_file
from tiny_dataset import TinyDataset, token
from typer.testing import CliRunner, Result

from appocc.camera import CameraRig
from appocc.errors import AppoccError, DataError
from appocc.export import run as export_run
from appocc.export.clips import synthetic_clips
from appocc.export.convert import to_openvino, write_openvino
from appocc.export.parity import Parity, ParityError, parity_limit
from appocc.export.run import ExportSource, export, source_from_inputs
from appocc.files import write_image
from appocc.frame import Frame
from appocc.inference.inputs import dataset_inputs
from appocc.inference.loading import load_predictor
from appocc.models.model_spec import MODEL_SPECS, Parts
from appocc.models.registry import NETWORKS
from appocc.models.weights import load_model
from appocc.nuscenes import Dataset
from appocc.objects import KINDS
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


@pytest.fixture(scope="module")
def with_parts(tmp_path_factory: pytest.TempPathFactory) -> Made:
    """The default network with all parts for a dataset's rig, as ONNX."""
    folder = tmp_path_factory.mktemp("with_parts")
    root = TinyDataset(folder / "tiny").root
    weights = weights_file(folder / "w.safetensors", "appocc", parts=ALL_PARTS)
    words = (root, "--weights", weights, "--out", folder / "model.onnx", "--runs", 1, "--json")
    return Made(folder, run(*words))


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


def test_memory_and_objects_are_inputs_and_outputs(with_parts: Made) -> None:
    assert with_parts.result.exit_code == 0, with_parts.result.stderr
    session = onnxruntime.InferenceSession(with_parts.folder / "model.onnx", providers=["CPUExecutionProvider"])
    card = with_parts.report["card"]
    inputs = {each.name: each.shape for each in session.get_inputs()}
    assert inputs == {
        "images": [1, 2, 3, 64, 96],
        "memory": [1, 33, 16, 16],
        "past_from_now": [1, 2, 3],
        "elapsed_s": [1],
    }
    described = {"images": card["input"], **card["memory_inputs"]}
    assert {name: each["shape"] for name, each in described.items()} == inputs
    outputs = {each.name: each.shape for each in session.get_outputs()}
    assert {name: each["shape"] for name, each in card["outputs"].items()} == outputs
    assert outputs["object_centre"] == [1, len(KINDS), 16, 16]
    assert outputs["object_box"] == [1, len(card["outputs"]["object_box"]["channels"]), 16, 16]
    # Every input matters.
    start = synthetic_clips({name: tuple(shape) for name, shape in inputs.items()})["noise"][0]
    expected = session.run(["occupancy"], start)[0]
    for name, values in start.items():
        other = session.run(["occupancy"], {**start, name: values * np.float32(0.5)})[0]
        assert np.abs(other - expected).max() > 1e-4, name


def assert_parts_agree(parity: dict[str, Any]) -> None:
    names = ["occupancy", "appearance", "object_centre", "object_box", "next_memory", "seen"]
    assert list(parity["largest_difference"]) == names
    assert all(value <= parity["limit"] < 5e-4 for value in parity["largest_difference"].values())


def test_a_network_with_memory_is_compared_over_consecutive_frames(with_parts: Made) -> None:
    parity = with_parts.report["parity"]
    assert parity["frames"] == 3
    assert parity["inputs"] == ["noise", "patches", "grey", f"frames from {token('sample', 0)}"]
    assert_parts_agree(parity)


@pytest.mark.openvino
def test_openvino_agrees_on_memory_and_objects(with_parts: Made, tmp_path: Path) -> None:
    out = tmp_path / "model.xml"
    result = run("--weights", with_parts.folder / "w.safetensors", "--out", out, "--runs", 1, "--json")
    assert result.exit_code == 0, result.stderr
    assert_parts_agree(json.loads(result.stdout)["parity"])


def test_a_file_says_nothing_of_the_machine_that_made_it(by_rig: Made) -> None:
    data = (by_rig.folder / "model.onnx").read_bytes()
    for path in (str(Path(__file__).parents[2]), str(Path(torch.__file__).parent), str(by_rig.folder)):
        assert path.encode() not in data
    model = onnx.load_from_string(data)
    assert not any(node.doc_string or node.metadata_props for node in model.graph.node)


@pytest.mark.openvino
def test_the_check_is_told(by_rig: Made, by_dataset: Made) -> None:
    for made, outputs in ((by_rig, 3), (by_dataset, 2)):
        parity = made.report["parity"]
        assert len(parity["largest_difference"]) == outputs
        assert all(value <= parity["limit"] < 3e-4 for value in parity["largest_difference"].values())
        assert (parity["runs"], parity["threads"]) == (1, [1, 2, 4])
        assert "largest difference: occupancy" in made.result.stderr
    assert by_rig.report["parity"]["inputs"] == ["noise", "patches", "grey"]
    assert len(by_dataset.report["parity"]["inputs"]) == 6  # and three frames of the dataset


@pytest.mark.openvino
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
        write_openvino(to_openvino(model), "{}", tmp_path / f"{name}.xml", tmp_path / f"{name}.bin")
    for ending in ("xml", "bin"):
        assert (tmp_path / f"a.{ending}").read_bytes() == (tmp_path / f"b.{ending}").read_bytes()


def guide(*blocks: int, **given: Any) -> dict[str, Any]:
    """Run some of the guide's blocks of code with names that are given; all names after it."""
    code = re.findall(r"```python\n(.*?)```", GUIDE.read_text(), flags=re.DOTALL)
    assert len(code) == 4
    for block in blocks:
        assert "appocc" not in code[block]
        assert "torch" not in code[block]
        exec(compile(code[block], GUIDE.name, "exec"), given)
    return given


def test_the_guides_lines_follow_a_drive_and_find_its_objects(
    with_parts: Made, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(with_parts.folder)
    frames = source_from_inputs(dataset_inputs(data := Dataset("tiny"), data.scenes), "tiny").frames(True)
    for frame in frames:
        for name, image in frame.images.items():
            write_image(Path(frame.token) / f"{name}.png", image)
    # The file has the peaks' probabilities and all velocities, without the cells in the boxes and the second stage.
    monkeypatch.setattr("appocc.inference.predictor.rescore_objects", lambda objects, *_: objects)
    monkeypatch.setattr("appocc.inference.predictor.fuse_vehicles", lambda objects, grid, occupancy: occupancy)
    monkeypatch.setattr("appocc.inference.predictor._without_low_speeds", lambda objects: objects)
    weights, cpu = with_parts.folder / "w.safetensors", torch.device("cpu")
    predictor = load_predictor(weights, cpu, second_stage=lambda objects, *_: objects)
    limit = parity_limit(predictor.model, 3)
    for count in (1, 3):  # without and with a past
        predictor.reset()
        for frame in frames[:count]:
            bev, _ = predictor(frame)
        drive = [(frame.token, frame.world_from_ego, frame.timestamp_us / 1e6) for frame in frames[:count]]
        names = guide(0, 2, 3, drive=drive)
        assert np.abs(names["named"]["occupancy"][0] - bev.occupancy).max() <= limit
        found, objects = names["objects"], bev.objects
        assert objects is not None
        assert len(objects) > 5
        xy = np.stack([found["x_m"], found["y_m"]], axis=1)
        for i, kind in enumerate(objects.kind):
            same = np.array([kind == other for other in found["kind"]])
            off = np.hypot(*(xy - objects.centre_m[i, :2]).T) + 100 * ~same
            nearest = int(off.argmin())
            assert off[nearest] < 1e-3
            assert found["score"][nearest] == pytest.approx(objects.score[i], abs=limit)
            assert found["z_m"][nearest] == pytest.approx(objects.centre_m[i, 2], abs=1e-3)
            np.testing.assert_allclose(found["size_wlh_m"][nearest], objects.size_wlh_m[i], rtol=1e-3)
            turn = found["yaw_rad"][nearest] - objects.yaw_rad[i]
            assert np.abs(np.angle(np.exp(1j * turn))) < 1e-2
            if count > 1:
                np.testing.assert_allclose(found["velocity_mps"][nearest], objects.velocity_mps[i], atol=0.01)


def test_the_guides_lines_answer_as_the_network(by_rig: Made, monkeypatch: pytest.MonkeyPatch) -> None:
    draw = np.random.default_rng(3)
    images = {
        name: np.asarray(draw.integers(0, 255, (high, wide, 3)), np.uint8) for name, (wide, high) in SIZES_PX.items()
    }
    for name, image in images.items():
        write_image(by_rig.folder / "FRAME" / f"{name}.png", image)
    monkeypatch.chdir(by_rig.folder)
    names = guide(0, 1)
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


@pytest.mark.openvino
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
        assert str(result.exception).startswith(f"exporting needs {name}: pip install '.[export]'")
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
        (
            ("--weights", weights, *onnx_out, "--rig", tmp_path / "side.yaml"),
            "expected either position_m, ego_from_cam or cam_from_ego",
        ),
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
@pytest.mark.parametrize(
    ("name", "spec", "parts"),
    [
        ("appocc", "360", Parts()),
        ("appocc", "360", ALL_PARTS),
        ("appocc", "180", ALL_PARTS),
        *((name, "180", Parts()) for name in NETWORKS),
    ],
)
def test_every_network_in_both_forms_at_full_size(name: str, spec: str, parts: Parts, tmp_path: Path) -> None:
    weights = weights_file(tmp_path / "w.safetensors", name, MODEL_SPECS[spec], parts)
    rig = ExportSource(CameraRig(tuple(read_rig("paper"))), "paper")
    for out in ("a.onnx", "a.xml"):
        done = export(weights, rig, tmp_path / out, 1)
        assert done.check.holds
        assert isinstance(done.check, Parity)
        assert done.check.between_runs <= done.check.limit
