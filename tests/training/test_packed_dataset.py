"""Packs hold what the dataset does, are made once, and made anew when what they were made of changes."""

from __future__ import annotations

import json
import os
import re
import resource
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_packed import GRID, SETTING, TOKENS, made_map, with_maps
from tiny_dataset import START_US, STEP_US, TinyDataset, token
from tolerances import assert_rounded

from appocc.bevmap import VEHICLE, bev_path
from appocc.errors import DataError
from appocc.grid import BEVGrid
from appocc.models.input_images import fit_image
from appocc.models.model_spec import ModelSpec
from appocc.nuscenes import Dataset
from appocc.nuscenes.view_targets import ViewTargets, save_view_targets, view_targets_path
from appocc.objects import KINDS
from appocc.temporary import locked
from appocc.training.batches.packed_dataset import PackedDataset, pack_dataset
from appocc.training.batches.packed_objects import RGB
from appocc.training.batches.reading import crop


@pytest.fixture
def root(tiny: TinyDataset) -> Path:
    return with_maps(tiny)


def packed(root: Path, out: Path, setting: ModelSpec = SETTING) -> PackedDataset:
    return pack_dataset(root, "exact", setting, out)


def test_a_packed_dataset_has_images_cameras_and_truth(root: Path, tmp_path: Path) -> None:
    found = packed(root, tmp_path / "pack")
    assert (len(found), found.tokens, set(found.scenes), set(found.towns)) == (3, TOKENS, {"scene-tiny"}, {"nowhere"})
    dataset = Dataset(root)
    for number, name in enumerate(TOKENS):
        sample, frame, bev = found.sample(number), dataset.frame(dataset.sample(name)), made_map(number)
        assert sample.channels == ("CAM_BACK", "CAM_FRONT")  # it has no CAM_LEFT
        assert sample.alive.tolist() == [True, True]
        for n, channel in enumerate(sample.channels):
            image, camera = fit_image(frame.images[channel], frame.rig[channel], SETTING)
            np.testing.assert_array_equal(sample.images[n], image)
            np.testing.assert_array_equal(sample.intrinsic[n], camera.intrinsic)
            np.testing.assert_array_equal(sample.ego_from_cam[n], camera.ego_from_cam)
        for k in range(3):
            np.testing.assert_array_equal(sample.occupancy >> k & 1, bev.occupancy[k])
            np.testing.assert_array_equal(sample.known >> k & 1, bev.occupancy_valid[k])
        np.testing.assert_array_equal(sample.known >> 3, bev.appearance_valid)
        np.testing.assert_array_equal(sample.appearance, bev.appearance)
    assert all(isinstance(array, np.memmap) and not array.flags.writeable for array in found.arrays.values())


def test_a_packed_sample_has_its_pose_its_time_and_its_objects(root: Path, tmp_path: Path) -> None:
    found = packed(root, tmp_path / "pack")
    dataset = Dataset(root)
    for number, name in enumerate(TOKENS):
        sample, frame, bev = found.sample(number), dataset.frame(dataset.sample(name)), made_map(number)
        np.testing.assert_array_equal(sample.world_from_ego, frame.world_from_ego)
        assert sample.time_us == START_US + number * STEP_US
        # The ego comes nearer to a parked car, and passes a pedestrian; the map reaches 8 m.
        car, walker = [KINDS.index("car"), 10 - 2.5 * number, 0], [KINDS.index("pedestrian"), 5 - 2.0 * number, 5]
        expected = [[walker], [walker, car], [car]][number]
        assert_rounded(sample.objects[: len(expected), :3], expected, 8)
        assert np.isnan(sample.objects[len(expected) :]).all()
        cars = [i for i, each in enumerate(expected) if each is car]
        assert set(np.unique(sample.owner)) == {0, *(i + 1 for i in cars)}
        for i in cars:
            own = sample.owner == i + 1
            near = GRID.centre_of(np.argwhere(own)) - sample.objects[i, 1:3]
            assert (np.abs(near) <= [2.3, 0.95]).all()
            assert (bev.occupancy[VEHICLE] * bev.occupancy_valid[VEHICLE])[own].all()
            known = bev.appearance[:, own & bev.appearance_valid]
            assert_rounded(sample.objects[i, RGB], np.median(known, axis=1))


def test_a_scene_without_annotations_has_no_objects(tiny: TinyDataset, tmp_path: Path) -> None:
    tiny.tables["sample_annotation"], tiny.tables["instance"] = [], []
    tiny.write()
    sample = packed(with_maps(tiny), tmp_path / "pack").sample(1)
    assert np.isnan(sample.objects).all()
    assert not sample.owner.any()
    assert sample.time_us == START_US + STEP_US


def test_an_existing_packed_dataset_is_reused(root: Path, tmp_path: Path) -> None:
    out, done, messages = tmp_path / "pack", list[tuple[int, int]](), list[str]()
    first = pack_dataset(root, "exact", SETTING, out, lambda *share: done.append(share), messages.append)
    before = (out / "images.npy").stat()
    again = pack_dataset(root, "exact", SETTING, out, lambda *share: done.append(share), messages.append)
    assert (out / "images.npy").stat().st_mtime_ns == before.st_mtime_ns
    assert (out / "images.npy").stat().st_ino == before.st_ino
    assert done == [(1, 3), (2, 3), (3, 3), (3, 3)]
    assert messages == []
    assert (again.tokens, again.setting, again.grid) == (first.tokens, SETTING, GRID)


def test_an_outdated_packed_dataset_is_replaced_with_a_message(root: Path, tmp_path: Path) -> None:
    out, messages = tmp_path / "pack", list[str]()
    packed(root, out)
    made_map(9).save(bev_path(root, "exact", TOKENS[1]))
    found = pack_dataset(root, "exact", SETTING, out, on_message=messages.append)
    np.testing.assert_array_equal(found.sample(1).appearance, made_map(9).appearance)
    small = replace(SETTING, width_px=16, height_px=8)
    assert pack_dataset(root, "exact", small, out, on_message=messages.append).sample(0).images.shape == (2, 8, 16, 3)
    (out / "known.npy").write_bytes(b"x")
    pack_dataset(root, "exact", small, out, on_message=messages.append)
    assert [line.split(",")[0] for line in messages] == [f"{out}: packing again"] * 3
    assert "its maps changed" in messages[0]
    assert "setting changed" in messages[1]
    assert "damaged" in messages[2]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["pack", "tiny"]


def test_changed_images_or_calibration_are_packed_again(tiny: TinyDataset, root: Path, tmp_path: Path) -> None:
    out, messages = tmp_path / "pack", list[str]()
    packed(root, out)
    os.utime(next((root / "samples" / "CAM_BACK").iterdir()), ns=(1, 1))
    pack_dataset(root, "exact", SETTING, out, on_message=messages.append)
    tiny.tables["calibrated_sensor"][0]["translation"][2] += 0.1
    tiny.write()
    pack_dataset(root, "exact", SETTING, out, on_message=messages.append)
    assert [line.split(", ", 1)[1] for line in messages] == ["its sensor files changed", "its calibration changed"]


def test_other_folders_are_not_overwritten(root: Path, tmp_path: Path) -> None:
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / "cat.jpg").write_bytes(b"")
    with pytest.raises(DataError, match="photos: expected a packed dataset or a new folder"):
        packed(root, tmp_path / "photos")
    assert (tmp_path / "photos" / "cat.jpg").exists()


@pytest.mark.parametrize("workers", [1, 2])
def test_a_damaged_image_leaves_no_files(root: Path, tmp_path: Path, workers: int) -> None:
    picture = root / f"samples/CAM_FRONT/{START_US + 490_000}.jpg"
    picture.write_bytes(picture.read_bytes()[:-200])
    with pytest.raises(DataError, match=f"{re.escape(str(picture))}: the image is truncated"):
        pack_dataset(root, "exact", SETTING, tmp_path / "pack", workers=workers)
    assert [path.name for path in tmp_path.iterdir()] == ["tiny"]


def test_a_missing_map_is_named_before_anything_is_made(root: Path, tmp_path: Path) -> None:
    bev_path(root, "exact", TOKENS[2]).unlink()
    with pytest.raises(DataError, match=r"sample-20+\.npz: no BEV map; exact maps come with simulated drives only"):
        packed(root, tmp_path / "pack")
    assert not (tmp_path / "pack").exists()


@pytest.mark.parametrize("reserved", [True, False], ids=["noticed at once", "noticed in writing"])
def test_a_full_disk_is_an_error_and_leaves_nothing(
    root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, reserved: bool
) -> None:
    if not reserved:
        monkeypatch.delattr(os, "posix_fallocate", raising=False)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (12_000, before[1]))  # fails as a disk does that has no more room
    try:
        with pytest.raises(DataError, match=r"pack: cannot be written \(File too large\)"):
            packed(root, tmp_path / "pack")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert [path.name for path in tmp_path.iterdir()] == [root.name]


def test_packing_waits_for_another_run(root: Path, tmp_path: Path) -> None:
    said: list[str] = []
    done: list[tuple[int, int]] = []
    out = tmp_path / "pack"

    def say(line: str) -> None:
        said.append(line)
        packed(root, tmp_path / "other")
        (tmp_path / "other").rename(out)
        release.close()

    with ExitStack() as release:
        release.enter_context(locked(tmp_path / ".pack.lock", out))
        pack_dataset(root, "exact", SETTING, out, lambda *share: done.append(share), say)
    assert said == [f"{out}: waiting for another run that uses it"]
    assert done == [(3, 3)]  # kept, at once
    assert not list(tmp_path.glob(".*"))


def test_samples_without_any_camera_of_the_setting(root: Path, tmp_path: Path) -> None:
    front = replace(SETTING, channels=("CAM_A", "CAM_B"), grid=BEVGrid(0, 8, -8, 8))
    with pytest.raises(DataError, match=r"tiny: expected one of CAM_A, CAM_B, got CAM_BACK, CAM_FRONT"):
        packed(root, tmp_path / "pack", front)
    tiny = TinyDataset(root)
    first, camera = token("sample", 0), "samples/CAM_"
    rows = tiny.tables["sample_data"]
    tiny.tables["sample_data"] = [r for r in rows if r["sample_token"] != first or camera not in r["filename"]]
    tiny.write()
    with pytest.raises(DataError, match=r"sample sample-00+: expected one of CAM_BACK, CAM_FRONT, got no camera"):
        packed(root, tmp_path / "pack")


def test_a_setting_that_looks_all_around_takes_cameras_of_other_names(root: Path, tmp_path: Path) -> None:
    around = replace(SETTING, channels=("CAM_FRONT", "CAM_FRONT_LEFT"))
    assert packed(root, tmp_path / "around", around).channels == ("CAM_FRONT", "CAM_BACK")
    ahead = replace(around, grid=BEVGrid(0, 8, -8, 8))
    assert packed(root, tmp_path / "ahead", ahead).channels == ("CAM_FRONT",)


def test_a_camera_that_failed_once_is_dead_in_that_sample(tiny: TinyDataset, tmp_path: Path) -> None:
    lost = token("CAM_FRONT", 490_000)
    tiny.tables["sample_data"] = [row for row in tiny.tables["sample_data"] if row["token"] != lost]
    tiny.write()
    found = packed(with_maps(tiny), tmp_path / "pack")
    assert [found.sample(i).alive.tolist() for i in range(3)] == [[True, True], [True, False], [True, True]]


def test_a_dataset_without_samples(tiny: TinyDataset, tmp_path: Path) -> None:
    tiny.tables["scene"] = []
    with pytest.raises(DataError, match="no key frames"):
        packed(tiny.write(), tmp_path / "pack")


def test_towns_and_weathers_of_simulated_scenes(tiny: TinyDataset, tmp_path: Path) -> None:
    tiny.tables["scene"][0]["description"] = "aldermoor, low sun, simulated; ego car_89 (suv)"
    tiny.write()
    assert set(packed(with_maps(tiny), tmp_path / "pack").weathers) == {"low_sun"}


def test_maps_may_reach_farther_than_the_setting(tiny: TinyDataset, tmp_path: Path) -> None:
    wide, front = BEVGrid(-16, 16, -16, 16, 0.4), BEVGrid(0, 8, -8, 8, 0.4)
    found = packed(with_maps(tiny, wide), tmp_path / "pack", replace(SETTING, grid=front))
    assert found.grid == found.sample(0).grid == wide
    sample, whole = crop(found.sample(0), front), made_map(0, wide)
    np.testing.assert_array_equal(sample.appearance, whole.appearance[:, 40:60, 20:60])
    np.testing.assert_array_equal(sample.known >> 3, whole.appearance_valid[40:60, 20:60])


@pytest.mark.parametrize(
    "grid", [BEVGrid(0, 8, -8, 8, 0.4), BEVGrid(-8, 8, -8, 8, 0.2), BEVGrid(-8.2, 8.2, -8.2, 8.2)]
)
def test_maps_that_do_not_fit_the_setting(tiny: TinyDataset, tmp_path: Path, grid: BEVGrid) -> None:
    with pytest.raises(
        DataError, match=r"sample-00+\.npz: expected a map that covers the grid \(-8, 8, -8, 8, 0.4\)"
    ):
        packed(with_maps(tiny, grid), tmp_path / "pack")


def test_maps_of_several_grids(root: Path, tmp_path: Path) -> None:
    made_map(1, BEVGrid(-16, 16, -16, 16, 0.4)).save(bev_path(root, "exact", TOKENS[1]))
    with pytest.raises(DataError, match=r"sample-10+\.npz: expected the grid of the first map"):
        packed(root, tmp_path / "pack")


# Depth and kind ---------------------------------------------------------------------------------------------------


def test_view_targets_follow_the_crop_of_the_image(root: Path, tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    # The picture of 32x20 is enlarged and cut to 64x32; its own targets have 3 x 4 blocks.
    setting = replace(SETTING, width_px=64, height_px=32)
    depth = rng.uniform(1, 60, (3, 4)).astype(np.float16)
    depth[0] = np.inf
    kind = rng.integers(0, 12, (3, 4)).astype(np.uint8)
    save_view_targets(view_targets_path(root, TOKENS[0]), {"CAM_FRONT": ViewTargets(depth, kind)})
    sample = packed(root, tmp_path / "pack", setting).sample(0)
    front, back = 1, 0
    camera = Dataset(root).frame(Dataset(root).sample(TOKENS[0])).rig["CAM_FRONT"]
    _, own = fit_image(np.zeros((20, 32, 3), np.uint8), camera, setting)
    for row in range(4):
        for column in range(8):
            ray = np.linalg.inv(own.intrinsic) @ [8 * column + 3.5, 8 * row + 3.5, 1]
            u, v, _ = camera.intrinsic @ ray
            i, j = int((v + 0.5) // 8), int((u + 0.5) // 8)
            assert sample.kind[front, row, column] == kind[i, j]
            assert sample.depth_m[front, row, column] == depth[i, j]
    assert (sample.kind[back] == 255).all()
    assert not sample.depth_m[back].any()


def test_without_them_depth_is_the_nearest_return_of_the_lidar(tiny: TinyDataset, tmp_path: Path) -> None:
    # Sensor frame of the LiDAR: at (1, 0, 1.8) of the ego, turned as it is; the camera stands at (1.5, 0, 1.6).
    points = np.array([[10.5, 0.02, -0.2, 0, 0], [6.5, 0.02, -0.2, 0, 0], [-5, 0, 0, 0, 0]], np.float32)
    (tiny.root / f"samples/LIDAR_TOP/{START_US}.pcd.bin").write_bytes(points.tobytes())
    sample = packed(with_maps(tiny), tmp_path / "pack").sample(0)
    front = SETTING.channels.index("CAM_FRONT")
    # The camera fired 10 ms before, 5 cm farther back; both points are just left of the middle: the block
    # at row 9.5 - 4 of 16 and column 15.5 - 20 * 0.02 / 6 of 32.
    assert sample.depth_m[front, 0, 1] == pytest.approx(6.05, abs=0.01)
    assert np.count_nonzero(sample.depth_m[front]) == 1
    assert (sample.kind == 255).all()


# Opening ----------------------------------------------------------------------------------------------------------


def test_damaged_packed_datasets_do_not_open(root: Path, tmp_path: Path) -> None:
    out = tmp_path / "pack"
    packed(root, out)
    with pytest.raises(DataError, match=r"pack.json: cannot be read"):
        PackedDataset.open(tmp_path / "none")
    (out / "alive.npy").write_bytes((out / "alive.npy").read_bytes()[:-1])
    with pytest.raises(DataError, match="damaged packed dataset"):
        PackedDataset.open(out)
    np.save(out / "alive.npy", np.ones((3, 2)))
    with pytest.raises(DataError, match=r"alive.npy: expected \(3, 2\) bool, got \(3, 2\) float64"):
        PackedDataset.open(out)
    (out / "alive.npy").unlink()
    with pytest.raises(DataError, match=r"damaged packed dataset \(.*alive.npy: No such file"):
        PackedDataset.open(out)
    about = json.loads((out / "pack.json").read_text())
    del about["grid"]
    (out / "pack.json").write_text(json.dumps(about))
    with pytest.raises(DataError, match="damaged packed dataset"):
        PackedDataset.open(out)


def test_the_last_samples_of_each_scene_are_held_out(root: Path, tmp_path: Path) -> None:
    found = packed(root, tmp_path / "pack")
    kept, last = found.split(1)
    assert (kept.tokens, last.tokens) == (found.tokens[:2], found.tokens[2:])
    assert (len(last.scenes), len(last.towns), len(last.weathers)) == (1, 1, 1)
    np.testing.assert_array_equal(last.sample(0).images, found.sample(2).images)
    assert [len(part) for part in found.split(5)] == [0, 3]
