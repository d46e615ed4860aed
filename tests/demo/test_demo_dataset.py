from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from appocc.bevmap import LANE, ROAD, VEHICLE, load_map
from appocc.boxes import Boxes
from appocc.demo.dataset import SCENE, SOURCE, DemoSettings, record_demo
from appocc.demo.pictures import overview
from appocc.nuscenes import Dataset
from appocc.nuscenes.validate import validate
from appocc.visualization.vehicle_marks import VehicleMarks


def digests(root: Path) -> dict[str, str]:
    files = (path for path in root.rglob("*") if path.is_file())
    return {str(path.relative_to(root)): hashlib.md5(path.read_bytes()).hexdigest() for path in files}


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    """Two key frames."""
    root = tmp_path_factory.mktemp("demo") / "dataset"
    steps: list[float] = []
    record_demo(root, DemoSettings(samples=2), steps.append)
    assert steps == [1, 1]
    return Dataset(root)


def test_the_demo_is_the_same_every_time(dataset: Dataset, tmp_path: Path) -> None:
    record_demo(tmp_path, DemoSettings(samples=2), lambda _: None)
    assert digests(tmp_path) == digests(dataset.root)


def test_the_dataset_is_healthy(dataset: Dataset) -> None:
    assert validate(dataset, images=True) == ()
    scene = dataset.scene(SCENE)
    assert "simulated" in scene.description
    assert len(dataset.samples(scene)) == 2
    assert (dataset.world_from_ego(dataset.samples(scene)[0])[:2, 3] > 0).all()


def test_overview_shows_left_on_the_left_and_the_truth_beside_the_prediction(dataset: Dataset) -> None:
    sample = dataset.samples(dataset.scene(SCENE))[0]
    frame, bev = dataset.frame(sample), load_map(dataset.root, SOURCE, sample.token)
    predicted = replace(bev, appearance=np.zeros_like(bev.appearance), occupancy=np.zeros_like(bev.occupancy))
    picture = overview(frame, predicted, bev, VehicleMarks.of_boxes(Boxes.empty()))
    reference = cv2.resize(frame.images["CAM_FRONT_LEFT"], (110, 40), interpolation=cv2.INTER_AREA).astype(int)
    maps = 2 * (800 + 26)
    upper = picture[: picture.shape[0] - maps]
    third = cv2.resize(upper[: upper.shape[0] // 2, : upper.shape[1] // 3], (110, 40), interpolation=cv2.INTER_AREA)
    assert np.abs(third.astype(int) - reference).mean() < 8
    i, j = 150, 180  # ahead and to the left, where nothing is written
    colours = picture[picture.shape[0] - 826 - 800 : picture.shape[0] - 826]
    row, column = (199 - i) * 4 + 1, (199 - j) * 4 + 1
    assert colours[row, column].tolist() == [0, 0, 0]
    assert colours[row, 808 + column].tolist() == bev.appearance[:, i, j].tolist()
    classes = picture[-800:]
    road = np.argwhere(bev.on[ROAD] & ~bev.on[VEHICLE] & ~bev.on[LANE])
    shown = {tuple(classes[(199 - i) * 4 + 1, 808 + (199 - j) * 4 + 1].tolist()) for i, j in road if i > 160}
    assert (112, 112, 118) in shown
