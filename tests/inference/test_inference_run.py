from __future__ import annotations

import hashlib
import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from made_model import AHEAD, MadeModel, predictor
from made_objects import made_object, together
from tiny_dataset import TinyDataset, token

from appocc.bevmap import LANE, VEHICLE, BEVMap, load_map
from appocc.checks import FloatArray
from appocc.errors import DataError
from appocc.files import read_image, write_image, zip_arrays
from appocc.frame import Frame
from appocc.inference.inputs import InferenceInput, dataset_inputs
from appocc.inference.predictor import Prediction, Predictor
from appocc.inference.run import InferenceRun, InferenceSummary
from appocc.nuscenes import Dataset
from appocc.nuscenes.detection_results import read_boxes
from appocc.visualization.predictions import prediction_figure
from appocc.visualization.vehicle_marks import VehicleMarks

ALL = [token("sample", i) for i in range(3)]


def vehicle_centres(bev: BEVMap) -> VehicleMarks:
    """One vehicle at the mean of all vehicle cells."""
    centre = bev.grid.centres()[bev.on[VEHICLE]].mean(axis=0, keepdims=True)
    size, paint = np.array([[4.0, 2.0]]), np.array([[250.0, 250.0, 20.0]])
    return VehicleMarks(centre, np.zeros(1), size, np.zeros(1, np.bool_), paint)


def inputs_of(tiny: TinyDataset) -> list[InferenceInput]:
    dataset = Dataset(tiny.root)
    return dataset_inputs(dataset, dataset.scenes)


def run(tiny: TinyDataset, out: Path, model: Predictor | None = None) -> InferenceSummary:
    run = InferenceRun(inputs_of(tiny), model or predictor(), out)
    for result in run:
        if result is not None:
            assert result.picture is not None
            write_image(result.picture, prediction_figure(result.frame, result.bev, vehicle_centres(result.bev)))
    return run.summary


def digests(folder: Path) -> dict[str, str]:
    return {path.name: hashlib.md5(path.read_bytes()).hexdigest() for path in folder.rglob("*") if path.is_file()}


def test_maps_are_a_source_and_say_what_is_seen(tiny: TinyDataset) -> None:
    out = tiny.root / "bev" / "mine"
    assert run(tiny, out)[:2] == (3, 0)
    assert [load_map(tiny.root, source, ALL[0]).meta["token"] for source in ("mine", f"{out}/")] == ALL[:1] * 2
    with zip_arrays((out / f"{ALL[1]}.npz").read_bytes()) as data:
        assert data["seen"].all()
        assert data["occupancy"].dtype == np.float16
    assert sorted(path.name for path in (out / "pictures").iterdir()) == [f"scene-tiny-000{i}.jpg" for i in range(3)]
    assert read_image(out / "pictures" / "scene-tiny-0002.jpg").std() > 10


def test_the_same_again_and_resumed_is_the_same_to_the_byte(tiny: TinyDataset, tmp_path: Path) -> None:
    run(tiny, tmp_path / "a")
    before = digests(tmp_path / "a")
    (tmp_path / "a" / f"{ALL[0]}.npz").write_bytes(b"half")
    (tmp_path / "a" / "pictures" / "scene-tiny-0001.jpg").unlink()
    assert run(tiny, tmp_path / "a")[:2] == (2, 1)
    assert digests(tmp_path / "a") == before
    run(tiny, tmp_path / "b")
    assert digests(tmp_path / "b") == before


@pytest.mark.parametrize("meta", ["[1]", '{"weights": 3}', '{"thresholds": {"road": 7}}'])
def test_a_map_that_says_what_cannot_be_is_made_anew(tiny: TinyDataset, tmp_path: Path, meta: str) -> None:
    run(tiny, tmp_path)
    before, path = digests(tmp_path), tmp_path / f"{ALL[0]}.npz"
    with np.load(path) as data:
        arrays = dict(data)
    np.savez(path, **{**arrays, "meta": np.array(meta)})
    assert run(tiny, tmp_path)[:2] == (1, 2)
    assert digests(tmp_path) == before


def test_other_weights_or_settings_make_new_maps(tiny: TinyDataset, tmp_path: Path) -> None:
    run(tiny, tmp_path)
    assert run(tiny, tmp_path, predictor(digest="d2"))[:2] == (3, 0)
    assert run(tiny, tmp_path, predictor(MadeModel(AHEAD), "d2"))[:2] == (3, 0)
    assert BEVMap.load(tmp_path / f"{ALL[0]}.npz").grid == AHEAD.grid


def test_a_frame_whose_images_are_all_damaged_names_them(tiny: TinyDataset, tmp_path: Path) -> None:
    dataset = Dataset(tiny.root)
    for channel in ("CAM_FRONT", "CAM_BACK"):
        broken = dataset.path(dataset.data(dataset.sample(ALL[0]))[channel])
        broken.write_bytes(broken.read_bytes()[:-3])
    with pytest.raises(DataError, match=r"no image can be used: .*truncated.*; .*truncated"):
        run(tiny, tmp_path)
    assert not list(tmp_path.glob("*.npz"))


def test_missing_cameras_are_counted_with_their_first_reason(tiny: TinyDataset, tmp_path: Path) -> None:
    dataset = Dataset(tiny.root)
    gone = [dataset.path(dataset.data(dataset.sample(name))["CAM_BACK"]) for name in ALL[1:]]
    for path in gone:
        path.unlink()
    missing = run(tiny, tmp_path).missing
    assert list(missing) == ["CAM_BACK"]
    times, why = missing["CAM_BACK"]
    assert times == 2
    assert str(gone[0]) in why
    assert [BEVMap.load(tmp_path / f"{name}.npz").meta["cameras"] for name in ALL] == [
        ["CAM_FRONT", "CAM_BACK"],
        ["CAM_FRONT"],
        ["CAM_FRONT"],
    ]


def test_nothing_half_made_is_left(tiny: TinyDataset, tmp_path: Path) -> None:
    for _ in InferenceRun(inputs_of(tiny), predictor(), tmp_path / "out"):
        break  # no picture could be written
    assert list(tmp_path.glob("out/**/*.*")) == []


def test_a_map_is_decided_by_its_thresholds(tiny: TinyDataset) -> None:
    bev, _ = predictor()(inputs_of(tiny)[0].read().frame)
    assert bev.on[VEHICLE].any()  # 0.45, less than half
    assert bev.thresholds is not None
    for layer, name in ((VEHICLE, "vehicle"), (LANE, "lane")):
        assert (bev.on[layer] == (bev.occupancy[layer] >= bev.thresholds[name])).all()
    plain = BEVMap(bev.grid, bev.occupancy, bev.occupancy_valid, bev.appearance, bev.appearance_valid)
    assert not plain.on[VEHICLE].any()


@pytest.mark.parametrize("spec", [None, AHEAD])
def test_the_figure_has_cameras_above_both_maps(tiny: TinyDataset, spec: object) -> None:
    frame = inputs_of(tiny)[0].read().frame
    bev = predictor(MadeModel(AHEAD) if spec else None)(frame).bev
    picture = prediction_figure(frame, bev, vehicle_centres(bev))
    bare = prediction_figure(frame, bev, vehicle_centres(bev).select(np.zeros(0, np.int64)))
    high, wide = (side * 4 for side in bev.grid.shape)
    cameras_px = picture.shape[0] - high - 26
    front = picture[cameras_px // 4, picture.shape[1] // 2]
    assert np.abs(front.astype(int) - [160, 80, 40]).max() <= 3
    # The box of the car, 10 m ahead, is in both maps and nowhere else.
    changed = np.argwhere((picture != bare).any(axis=-1))
    changed = changed[changed[:, 0] >= cameras_px + 26]  # below the caption, which tells what the numbers are
    rows = changed[:, 0] - cameras_px - 26
    assert rows.mean() == pytest.approx((16 - 10) * 10, abs=8)
    assert rows.min() > 0
    left, right = (changed[(changed[:, 1] < picture.shape[1] // 2) == side, 1] for side in (True, False))
    assert len(left) > 20
    assert right.min() - left.min() == pytest.approx(wide + 8, abs=2)


class ObjectPredictor(Predictor):
    """The made model with one car ahead, and one where no camera looks."""

    def __call__(self, frame: Frame) -> Prediction:
        bev, seen = super().__call__(frame)
        objects = together(made_object("car", 10.0, 0.0, velocity_mps=(2.0, 0.0)), made_object("bus", -10.0, 0.0))
        return Prediction(replace(bev, objects=objects), seen)


def test_objects_of_made_and_kept_maps_are_written_as_detections(tiny: TinyDataset, tmp_path: Path) -> None:
    made = predictor()
    seeing = ObjectPredictor(made.model, made.weights, torch.device("cpu"))
    dataset = Dataset(tiny.root)
    back = dataset.path(dataset.data(dataset.sample(ALL[2]))["CAM_BACK"])
    back.unlink()
    contents = []
    for expected in ((3, 0), (1, 2)):
        run = InferenceRun(inputs_of(tiny), seeing, tmp_path / "maps", tmp_path / "results.json")
        for result in run:
            if result is not None:
                assert result.picture is not None
                write_image(result.picture, np.zeros((4, 4, 3), np.uint8))
        assert run.summary[:2] == expected
        contents.append((tmp_path / "results.json").read_bytes())
        (tmp_path / "maps" / f"{ALL[1]}.npz").unlink()
    assert contents[0] == contents[1]
    boxes = read_boxes(tmp_path / "results.json", json.loads(contents[0]), ALL)
    # Nothing behind where the camera at the back is missing.
    assert [[box.detection_name for box in own] for own in boxes] == [["car", "bus"]] * 2 + [["car"]]
    # The ego drives along world +y.
    np.testing.assert_allclose(boxes[1][0].translation, [100, 212.5, 0.8], atol=1e-9)
    np.testing.assert_allclose(np.array(boxes[1][0].velocity, np.float64), [0, 2], atol=1e-9)
    assert [box.attribute_name for box in boxes[0]] == ["vehicle.moving", "vehicle.stopped"]


class CountingTracking:
    """Writes the number of maps of the drive so far as the velocity of every object."""

    def __init__(self) -> None:
        self.number = 0

    def reset(self) -> None:
        self.number = 0

    def __call__(self, bev: BEVMap, timestamp_us: int, world_from_ego: FloatArray) -> BEVMap:
        self.number += 1
        assert bev.objects is not None
        return replace(bev, objects=replace(bev.objects, velocity_mps=np.full((2, 2), float(self.number))))


def test_tracking_completes_the_objects_of_each_drive_also_after_an_interruption(
    tiny: TinyDataset, tmp_path: Path
) -> None:
    made = predictor()
    seeing = ObjectPredictor(made.model, made.weights, torch.device("cpu"))
    seeing.model.parts = replace(seeing.model.parts, objects=True)

    def speeds() -> list[float]:
        run = InferenceRun(inputs_of(tiny), seeing, tmp_path, pictures=False, tracking=CountingTracking())
        list(run)
        made_and_kept.append(run.summary[:2])
        objects = [BEVMap.load(tmp_path / f"{name}.npz").objects for name in ALL]
        return [float(each.velocity_mps[0, 0]) for each in objects if each is not None]

    made_and_kept: list[tuple[int, int]] = []
    first = speeds()
    (tmp_path / f"{ALL[1]}.npz").unlink()
    assert speeds() == first == [1, 2, 3]
    assert made_and_kept == [(3, 0), (1, 2)]
    # A map depends on the pictures of the frames before.
    dataset = Dataset(tiny.root)
    dataset.path(dataset.data(dataset.sample(ALL[0]))["CAM_BACK"]).unlink()
    assert speeds() == first
    assert made_and_kept[-1] == (3, 0)


def test_detections_need_objects_and_poses(tiny: TinyDataset, tmp_path: Path) -> None:
    results = tmp_path / "results.json"
    with pytest.raises(DataError, match=r"results\.json: the weights 'made' predict no objects"):
        list(InferenceRun(inputs_of(tiny), predictor(), tmp_path / "maps", results))
    assert list(tmp_path.glob("maps/**/*.*")) == []
    run(tiny, tmp_path / "maps")
    with pytest.raises(DataError, match=r"results\.json: the weights 'made' predict no objects"):
        list(InferenceRun(inputs_of(tiny), predictor(), tmp_path / "maps", results))
    without_poses = [each._replace(pose=None) for each in inputs_of(tiny)]
    with pytest.raises(DataError, match=r"results\.json: detections need ego poses: expected a dataset"):
        InferenceRun(without_poses, predictor(), tmp_path / "maps", results)
    assert not results.exists()


def _anew(tiny: TinyDataset, out: Path) -> tuple[int, int, dict[str, int]]:
    summary = run(tiny, out)
    return summary.made, summary.kept, summary.stale


def test_a_map_is_made_anew_when_its_pictures_or_cameras_changed(tiny: TinyDataset, tmp_path: Path) -> None:
    dataset = Dataset(tiny.root)
    path = dataset.path(dataset.data(dataset.sample(ALL[1]))["CAM_BACK"])
    picture = path.read_bytes()
    path.unlink()
    assert _anew(tiny, tmp_path) == (3, 0, {})
    path.write_bytes(picture)
    assert _anew(tiny, tmp_path) == (1, 2, {"pictures changed": 1})
    assert BEVMap.load(tmp_path / f"{ALL[1]}.npz").meta["cameras"] == ["CAM_FRONT", "CAM_BACK"]
    tiny.tables["calibrated_sensor"][0]["translation"][2] += 0.1
    tiny.write()
    os.utime(path, ns=(1, 1))
    assert _anew(tiny, tmp_path)[2] == {"calibration changed": 2, "calibration and pictures changed": 1}
    assert _anew(tiny, tmp_path) == (0, 3, {})


def test_maps_without_a_record_are_made_anew_once(tiny: TinyDataset, tmp_path: Path) -> None:
    run(tiny, tmp_path)
    before, record = digests(tmp_path), tmp_path / "inputs.jsonl"
    record.write_bytes(record.read_bytes().split(b"\n")[0] + b'\n["half')
    assert _anew(tiny, tmp_path) == (2, 1, {"what they were made from is not recorded": 2})
    assert digests(tmp_path) == before
    assert _anew(tiny, tmp_path) == (0, 3, {})


def test_maps_of_other_rules_are_made_anew(
    tiny: TinyDataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert _anew(tiny, tmp_path)[:2] == (3, 0)
    monkeypatch.setattr("appocc.inference.run.MAP_RULES", 0)
    assert _anew(tiny, tmp_path) == (3, 0, {"appocc's rules changed": 3})


def test_neither_maps_nor_the_record_depend_on_where_the_dataset_lies(tiny: TinyDataset, tmp_path: Path) -> None:
    run(tiny, tmp_path / "a")
    tiny.root = tiny.root.rename(tmp_path / "elsewhere")
    assert _anew(tiny, tmp_path / "a") == (0, 3, {})


def test_a_truth_is_not_replaced(tiny: TinyDataset, tmp_path: Path) -> None:
    run(tiny, tmp_path / "mine")
    for name in ("groundtruth", "exact"):
        (tmp_path / f"link-to-{name}").symlink_to(tmp_path / name)
        for out in (tmp_path / name, tmp_path / f"link-to-{name}"):
            with pytest.raises(DataError, match="a folder of this name is for true maps"):
                run(tiny, out)
    path = tmp_path / "mine" / f"{ALL[0]}.npz"
    bev = BEVMap.load(path)
    for meta in ({"source": "simulated"}, {"sources": {"road": "map"}}):
        replace(bev, meta=meta).save(path)
        before = digests(tmp_path)
        with pytest.raises(DataError, match=f"{ALL[0]}.npz: expected a predicted map or none, got a truth"):
            run(tiny, tmp_path / "mine")
        assert digests(tmp_path) == before
