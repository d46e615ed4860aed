from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from made_model import AHEAD, AROUND, CHANNELS, LOW, MadeModel, predictor
from tiny_dataset import TinyDataset

from appocc.bevmap import VEHICLE
from appocc.camera import Camera, CameraRig
from appocc.ego_vehicle import EgoVehicle
from appocc.errors import DataError
from appocc.frame import Frame
from appocc.inference import loading
from appocc.inference.decision_thresholds import decision_thresholds
from appocc.inference.exposure import DARK
from appocc.inference.loading import load_predictor
from appocc.inference.predictor import select_cameras
from appocc.levelling import ground_pose
from appocc.models.model_spec import MODEL_SPECS
from appocc.models.registry import build
from appocc.models.rounding import rounding
from appocc.models.weights import save_weights
from appocc.nuscenes import Dataset


def frame_of(tiny: TinyDataset, number: int = 0) -> Frame:
    dataset = Dataset(tiny.root)
    return dataset.frame(dataset.samples(dataset.scenes[0])[number])


def rig(*channels: str) -> CameraRig:
    return CameraRig(tuple(Camera(name, 8, 8, np.eye(3), np.eye(4)) for name in channels))


def test_a_map_says_what_the_network_said(tiny: TinyDataset) -> None:
    frame = frame_of(tiny)
    bev, seen = predictor()(frame)
    assert bev.grid == AROUND.grid
    assert bev.occupancy[VEHICLE, 65, 40] == pytest.approx(LOW, rel=rounding(1, torch.float16))
    assert bev.occupancy_valid.all()  # one camera looks ahead, one back
    assert bev.appearance_valid.all()
    assert np.abs(bev.appearance[:, 0, 0].astype(int) - [160, 80, 40]).max() <= 2  # RGB of the tiny dataset's images
    assert seen.all()
    assert bev.meta["weights"] == {"name": "made", "sha256": "d1"}
    validated = {"road": 0.5, "vehicle": 0.4, "lane": 0.5}
    assert bev.meta["thresholds"] == decision_thresholds(bev.occupancy, seen, bev.grid, validated)
    assert (bev.meta["token"], bev.meta["timestamp_us"]) == (frame.token, frame.timestamp_us)
    assert bev.meta["cameras"] == ["CAM_FRONT", "CAM_BACK"]


def test_dark_pictures_are_brightened_for_the_network_and_its_colours_stay_dark(tiny: TinyDataset) -> None:
    frame, model = frame_of(tiny), MadeModel()
    dark = replace(frame, images={name: image // 5 for name, image in frame.images.items()})
    seen: list[float] = []
    model.register_forward_pre_hook(lambda _, given: seen.append(float(given[0].mean())))
    bev, _ = predictor(model)(dark)
    assert seen == [pytest.approx(DARK, abs=0.03)]
    assert np.abs(bev.appearance[:, 0, 0].astype(int) - [32, 16, 8]).max() <= 2


def test_the_network_sees_the_cameras_in_the_level_frame(tiny: TinyDataset) -> None:
    frame, model = frame_of(tiny), MadeModel()
    pose = ground_pose(0.0, 0.035, 0.1)
    bev, _ = predictor(model)(replace(frame, ego_from_level=pose))
    for camera in model.rigs[0]:
        np.testing.assert_allclose(pose @ camera.ego_from_cam, frame.rig[camera.channel].ego_from_cam, atol=1e-9)
    np.testing.assert_allclose(bev.meta["ego_from_level"], pose, atol=1e-5)
    assert "ego_from_level" not in predictor()(frame).bev.meta


def test_a_missing_camera_is_not_part_of_the_rig(tiny: TinyDataset) -> None:
    whole = frame_of(tiny)
    alive = {"CAM_FRONT": whole.images["CAM_FRONT"]}
    model = MadeModel()
    bev, seen = predictor(model)(Frame(whole.token, 0, whole.world_from_ego, whole.rig, alive))
    assert model.rigs[0].channels == ("CAM_FRONT",)
    assert (model.rigs[0]["CAM_FRONT"].width_px, model.rigs[0]["CAM_FRONT"].height_px) == (16, 8)
    assert bev.meta["cameras"] == ["CAM_FRONT"]
    assert 0 < seen.sum() < seen.size
    assert (bev.occupancy_valid == seen).all()
    assert (bev.appearance_valid == seen).all()
    assert not (bev.on & ~seen).any()
    guessed = bev.with_guesses()
    assert guessed.occupancy_valid.all()
    assert guessed.appearance_valid.all()
    assert (guessed.on & ~seen).any()
    with pytest.raises(DataError, match="expected an image of CAM_FRONT_LEFT"):
        predictor()(Frame(whole.token, 0, whole.world_from_ego, whole.rig, {}))


def test_a_plan_is_made_once_for_a_rig(tiny: TinyDataset) -> None:
    model = MadeModel()
    answer = predictor(model)
    frame = frame_of(tiny)
    for _ in range(3):
        answer(frame)
    assert len(model.rigs) == 1
    fewer = {"CAM_BACK": frame.images["CAM_BACK"]}
    answer(Frame(frame.token, 0, frame.world_from_ego, frame.rig, fewer))
    assert [one.channels for one in model.rigs] == [("CAM_FRONT", "CAM_BACK"), ("CAM_BACK",)]
    bus = replace(frame.rig, ego_vehicle=EgoVehicle(length_m=12.0))
    answer(replace(frame, rig=bus))
    assert [one.ego_vehicle for one in model.rigs] == [EgoVehicle(), EgoVehicle(), bus.ego_vehicle]


def test_a_network_for_occupancy_alone_knows_no_colour(tiny: TinyDataset) -> None:
    bev, _ = predictor(MadeModel(colour=False))(frame_of(tiny))
    assert not bev.appearance_valid.any()
    assert not bev.with_guesses().appearance_valid.any()
    assert bev.occupancy_valid.all()


def test_an_answer_that_is_no_number_is_refused(tiny: TinyDataset, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch, "logit", lambda values, _: values * float("nan"))
    with pytest.raises(DataError, match="not finite"):
        predictor()(frame_of(tiny))


def test_cameras_of_other_names_are_used_where_all_is_seen() -> None:
    odd = rig("CAM_LEFT", "CAM_BACK", "CAM_FRONT")
    assert [camera.channel for camera in select_cameras(AROUND, odd)] == ["CAM_FRONT", "CAM_BACK", "CAM_LEFT"]
    assert [camera.channel for camera in select_cameras(AHEAD, odd)] == ["CAM_FRONT"]
    assert [camera.channel for camera in select_cameras(AROUND, rig(*CHANNELS[::-1]))] == list(CHANNELS)


def test_weights_from_a_file(tiny: TinyDataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    torch.manual_seed(1)
    path, thresholds = tmp_path / "w.safetensors", "[0.4, 0.3, 0.2]"
    save_weights(path, build("appocc", MODEL_SPECS["180"]), {"network": "appocc", "thresholds": thresholds})
    loaded = load_predictor(path, torch.device("cpu"))
    assert loaded.weights.thresholds == {"road": 0.4, "vehicle": 0.3, "lane": 0.2}
    assert loaded.weights.name == "appocc (w.safetensors)"
    frame = frame_of(tiny)
    (bev, seen), (again, _) = loaded(frame), load_predictor(path, torch.device("cpu"))(frame)
    assert bev.grid == MODEL_SPECS["180"].grid
    assert seen.shape == (100, 200)
    assert 0 < seen.sum() < seen.size
    assert (bev.occupancy == again.occupancy).all()
    # Those of the package are found in the same way.
    monkeypatch.setattr(loading, "PACKAGED", path)
    assert load_predictor(None).weights.digest == loaded.weights.digest


def test_shipped_weights_are_found_by_name(tiny: TinyDataset) -> None:
    default, street = load_predictor(), load_predictor("street")
    assert load_predictor("appocc").weights == default.weights
    assert street.weights.digest != default.weights.digest
    assert street.weights.name == "appocc (street.safetensors)"
    frame = frame_of(tiny)
    assert not np.array_equal(street(frame).bev.occupancy, default(frame).bev.occupancy)


def test_weights_that_are_missing_are_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(DataError, match="no such file"):
        load_predictor(tmp_path / "none.safetensors")
    monkeypatch.setattr(loading, "PACKAGED", tmp_path / "none.safetensors")
    with pytest.raises(DataError, match="no weights come with this version"):
        load_predictor(None)
