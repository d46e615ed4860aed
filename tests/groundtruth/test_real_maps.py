"""Maps of real recordings: a street of PandaSet, and two key frames of nuScenes."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from appocc.bevmap import LANE, ROAD, VEHICLE, BEVMap, bev_path
from appocc.checks import FloatArray
from appocc.frame import Frame
from appocc.grid import BEVGrid
from appocc.groundtruth.compose import GroundTruthSettings
from appocc.groundtruth.pipeline import generate
from appocc.nuscenes import Dataset
from appocc.nuscenes.writer import token_of

pytestmark = pytest.mark.realdata


def maps(dataset: Dataset, out: Path) -> list[BEVMap]:
    return [BEVMap.load(bev_path(out, "groundtruth", s.token)) for s in dataset.samples(dataset.scenes[0])]


def _beside_picture(frame: Frame, bev: BEVMap) -> tuple[FloatArray, FloatArray]:
    """Colours (N, 3) of road cells ahead, and those of the front picture where their centres project into it."""
    centres = bev.grid.centres()
    ahead = (np.abs(centres[..., 1]) < 4) & (centres[..., 0] > 6) & (centres[..., 0] < 20)
    wanted = ahead & bev.appearance_valid & (bev.occupancy[ROAD] == 1) & (bev.occupancy[VEHICLE] == 0)
    camera = frame.rig["CAM_FRONT"]
    uv, depth = camera.project_ego(np.pad(centres[wanted], ((0, 0), (0, 1))))
    seen = camera.sees(uv, depth)
    column, row = np.round(uv[seen]).astype(int).T
    picture = frame.images["CAM_FRONT"][row, column].astype(np.float64)
    return bev.appearance[:, wanted].T[seen].astype(np.float64), picture


def test_pandaset_has_a_map_of_every_sample(panda_root: Path) -> None:
    dataset = Dataset(panda_root)
    for sample, bev in zip(dataset.samples(dataset.scenes[0]), maps(dataset, panda_root), strict=True):
        assert bev.grid.shape == (200, 200)
        assert bev.meta["sources"]["road"].startswith("mask (derived")
        assert bev.meta["sources"]["lane"] == "semantic_lidar (pointlabels)"
        assert 0.25 < bev.appearance_valid.mean() < 0.95
        assert bev.occupancy_valid[VEHICLE].all()
        assert 0.05 < bev.occupancy[ROAD].mean() < 0.5
        assert 0 < bev.occupancy[LANE].mean() < 0.1
        cuboids = dataset.boxes_world(sample).vehicles()
        near = np.linalg.norm(cuboids.centre_m[:, :2] - dataset.world_from_ego(sample)[:2, 3], axis=1) < 36
        area = (cuboids.size_wlh_m[near, 0] * cuboids.size_wlh_m[near, 1]).sum()
        assert bev.occupancy[VEHICLE].sum() * 0.16 > 0.95 * area


def test_pandaset_vehicles_have_the_colours_that_people_read(panda_root: Path) -> None:
    fixture = Path(__file__).parents[1] / "fixtures" / "vehicle_colours_pandaset_002.json"
    entries = json.loads(fixture.read_text())["entries"]
    dataset = Dataset(panda_root)
    scene = dataset.scenes[0]
    samples, every = dataset.samples(scene), maps(dataset, panda_root)
    errors = []
    for entry in entries:
        bev = every[entry["frame"] // 2]
        sample = samples[entry["frame"] // 2]
        cuboids = dataset.boxes_world(sample)
        number = cuboids.instance.index(token_of("instance", scene.token, entry["track"]))
        world_from_ego = dataset.world_from_ego(sample)
        middle = np.linalg.inv(world_from_ego) @ [*cuboids.centre_m[number], 1.0]
        cell = bev.grid.cell_of(middle[:2])
        if bev.grid.contains(cell) and bev.appearance_valid[tuple(cell)]:
            assert bev.occupancy[VEHICLE][tuple(cell)] == 1
            errors.append(np.abs(bev.appearance[:, *cell].astype(float) - entry["rgb"]).mean())
    assert len(errors) >= 60
    assert np.mean(errors) < 15
    assert np.median(errors) < 9


def test_nuscenes_as_downloaded(data_root: Path, tmp_path: Path) -> None:
    dataset = Dataset(data_root / "nuscenes_real")
    before = sorted(path.name for path in dataset.root.rglob("*"))
    summary = generate(
        dataset, dataset.scenes, tmp_path, GroundTruthSettings(BEVGrid.surround(), "robust"), None, lambda _: None
    )
    assert summary.made == 2
    for scene in dataset.scenes:
        (sample,) = dataset.samples(scene)
        bev = BEVMap.load(bev_path(tmp_path, "groundtruth", sample.token))
        assert bev.meta["sources"]["road"] == "mask"
        assert bev.meta["sources"]["lane"] == "none"
        assert 0.1 < bev.occupancy[ROAD].mean() < 0.6
        assert bev.occupancy[ROAD, 97:103, 97:103].all()  # under the ego
        assert bev.occupancy[VEHICLE].any()
        assert not bev.appearance_valid[97:109, 97:103].any()  # its own body hides the road, and is none
        assert bev.appearance_valid.mean() > 0.08
        cells, picture = _beside_picture(dataset.frame(sample), bev)
        assert len(cells) > 50
        exposure = np.median(cells / picture, axis=0)  # evened out by a fifth at most
        assert (np.abs(np.log(exposure)) < np.log(1.23)).all()
        assert np.median(np.abs(cells - picture * exposure).mean(axis=1)) < 12
    assert sorted(path.name for path in dataset.root.rglob("*")) == before
