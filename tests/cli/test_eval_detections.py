"""`appocc eval detections` on the tiny dataset: a parked car on three key frames, a pedestrian on two."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from made_scene import with_maps, with_objects
from tiny_dataset import TinyDataset, token
from typer.testing import CliRunner, Result

from appocc.bevmap import load_map
from appocc.errors import DataError
from appocc.nuscenes.detection_results import result_boxes, write_results
from cli.main import app


@pytest.fixture
def street(tiny: TinyDataset) -> TinyDataset:
    """The dataset with true maps, and with perfect objects in maps of a model and in a file of results."""
    dataset = with_maps(tiny)
    with_objects(dataset)
    results = {}
    for sample in dataset.samples(dataset.scenes[0]):
        objects = load_map(tiny.root, "model", sample.token).objects
        assert objects is not None
        results[sample.token] = result_boxes(objects, dataset.world_from_ego(sample))
    write_results(tiny.root / "results.json", results)
    return tiny


def run(root: Path, *more: str) -> Result:
    return CliRunner().invoke(app, ["eval", "detections", str(root), *more])


def answer(root: Path, *more: str) -> dict[str, Any]:
    result = run(root, "--json", *more)
    assert result.exit_code == 0, result.stderr
    value: dict[str, Any] = json.loads(result.stdout)
    return value


def test_perfect_detections(street: TinyDataset) -> None:
    value = answer(street.root, "--detections", str(street.root / "results.json"))
    assert list(value) == [
        *("source", "against", "range_m", "scenes", "samples"),
        *("mAP", "mATE", "mASE", "mAOE", "mAVE", "mAAE", "NDS", "by_class", "vehicles"),
    ]
    assert (value["against"], value["scenes"], value["samples"]) == ("groundtruth", 1, 3)
    assert value["mAP"] == pytest.approx(1)
    assert {kind: one["count"] for kind, one in value["by_class"].items()} == {"car": 3, "pedestrian": 2}
    assert list(value["by_class"]["car"]["AP_at_m"]) == ["0.5", "1", "2", "4"]
    # The tiny dataset's people have no attribute, which counts as an error of 1 in the devkit, too.
    assert (value["mATE"], value["mAAE"]) == (pytest.approx(0, abs=1e-9), 0.5)
    far = value["vehicles"]["within_40_m"]
    assert (far["vehicles"], far["found"], far["false"], far["F1"]) == (3, 3, 0, 1)
    assert (far["heading_within_20_deg"], far["colour_word_right"]) == (1, 1)
    assert far["ciede2000_median"] == pytest.approx(0, abs=1e-6)


def test_objects_of_maps_are_the_same_detections(street: TinyDataset) -> None:
    by_file, by_map = (
        answer(street.root, *source)
        for source in (("--detections", str(street.root / "results.json")), ("--bev", "model"))
    )
    assert by_map.pop("source") == "model"
    assert by_file.pop("source") == str(street.root / "results.json")
    assert by_map == by_file


def test_without_true_maps_paints_are_unknown(street: TinyDataset) -> None:
    (street.root / "bev" / "groundtruth").rename(street.root / "bev" / "other")
    value = answer(street.root, "--bev", "model")
    assert value["against"] is None
    far = value["vehicles"]["within_40_m"]
    assert (far["F1"], far["ciede2000_median"], far["colour_word_right"]) == (1, None, None)


def test_for_people_everything_goes_to_stderr(street: TinyDataset) -> None:
    result = run(street.root, "--bev", "model", "--range", "30")
    assert (result.exit_code, result.stdout) == (0, "")
    assert "model: 3 samples of 1 scenes, within 30 m" in result.stderr
    assert max(map(len, result.stderr.splitlines())) <= 80
    for words in ("pedestrian", "NDS", "CIEDE2000", "within 20 m"):
        assert words in result.stderr


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        ([], "expected either --detections or --bev, got neither"),
        (["--detections", "x.json", "--bev", "model"], "expected either --detections or --bev, got both"),
        (["--detections", "missing.json"], "missing.json: cannot be read"),
        (["--bev", "groundtruth"], "expected a map with objects, got one without"),
        (["--bev", "nothing"], "3 of 3 samples have no BEV map"),
    ],
)
def test_bad_input_has_one_clear_line(street: TinyDataset, words: list[str], reason: str) -> None:
    result = run(street.root, *words)
    assert isinstance(result.exception, DataError)
    assert reason in str(result.exception)


def test_the_file_is_checked_before_the_truth_is_read(street: TinyDataset) -> None:
    for path in (street.root / "bev" / "groundtruth").glob("*.npz"):
        path.write_bytes(b"damaged")
    result = run(street.root, "--detections", "missing.json")
    assert str(result.exception).startswith("missing.json: cannot be read")


def test_damaged_results(street: TinyDataset) -> None:
    path = street.root / "results.json"
    content = json.loads(path.read_text())
    first = content["results"][token("sample", 0)]

    def reason() -> str:
        path.write_text(json.dumps(content))
        result = run(street.root, "--detections", str(path))
        assert isinstance(result.exception, DataError), result.stderr
        return str(result.exception)

    rotation, first[0]["rotation"] = first[0]["rotation"], [0.0] * 4
    assert "quaternion wxyz: expected a length of 1" in reason()
    first[0]["rotation"] = rotation
    first[:] = first[:1] * 501
    assert "expected at most 500 boxes a sample, got 501" in reason()
    del content["results"][token("sample", 2)]
    assert "expected boxes, or an empty list, for sample" in reason()


def test_scenes_without_annotations(street: TinyDataset) -> None:
    street.tables["sample_annotation"] = []
    street.write()
    result = run(street.root, "--bev", "model")
    assert isinstance(result.exception, DataError)
    assert "no annotated key frames to compare with" in str(result.exception)
