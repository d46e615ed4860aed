from __future__ import annotations

import hashlib
import os
from pathlib import Path

import numpy as np
import pytest
from made_street import (
    BLUE,
    BROWN,
    GREEN,
    GREY,
    KERB_M,
    RED,
    STRIPE_M,
    WHITE,
    Plan,
    Solid,
    car,
    make,
    street_from_ego,
)
from tiny_dataset import TinyDataset

from appocc.bevmap import LANE, ROAD, VEHICLE, BEVMap, bev_path
from appocc.errors import DataError
from appocc.files import read_image
from appocc.geometry import apply
from appocc.grid import BEVGrid
from appocc.groundtruth.compose import GroundTruthSettings
from appocc.groundtruth.pipeline import GenerationSummary, generate
from appocc.nuscenes import Dataset
from appocc.workers import worker_pool

SETTINGS = GroundTruthSettings(BEVGrid(-16.0, 16.0, -16.0, 16.0, 0.4), "robust")


def street(t: float) -> list[Solid]:
    """A parked car, one that drives, a wall, and leaves over the road."""
    leaves = Solid((4.0, -4.0, 3.0), (8.0, 0.0, 3.2), GREEN)
    return [
        car(9, -2.8, RED, "red"),
        car(2 + 8 * t, 2.4, BLUE, "blue"),
        Solid((4, 7, 0), (12, 7.3, 2), GREEN),
        leaves,
    ]


PLAN = Plan(street, samples=3, with_lidar=(0, 2), sweeps_s=(0.25, 0.7))


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    """Three samples, the second without LIDAR_TOP, and two sweeps."""
    return make(tmp_path_factory.mktemp("street"), PLAN)


def run(dataset: Dataset, out: Path, workers: int = 1, settings: GroundTruthSettings = SETTINGS) -> GenerationSummary:
    with worker_pool(workers) as pool:
        return generate(dataset, dataset.scenes, out, settings, pool, lambda _: None)


@pytest.fixture(scope="module")
def made(dataset: Dataset, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Its maps."""
    out = tmp_path_factory.mktemp("maps")
    assert run(dataset, out) == GenerationSummary(3, 0, out / "bev" / "groundtruth", {})
    return out


def digests(folder: Path) -> dict[str, str]:
    """Every file below a folder, hidden ones included."""
    files = [path for path in sorted(folder.rglob("*")) if path.is_file()]
    return {str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def maps(dataset: Dataset, out: Path) -> list[BEVMap]:
    return [BEVMap.load(bev_path(out, "groundtruth", s.token)) for s in dataset.samples(dataset.scenes[0])]


def picture_of(dataset: Dataset, path: Path) -> Path:
    return path.parent / "pictures" / f"{dataset.titles(dataset.scenes[0])[path.stem]}.jpg"


# What is in the maps ------------------------------------------------------------------------------------------------


def test_a_map_and_a_preview_per_sample(dataset: Dataset, made: Path) -> None:
    (scene,) = dataset.scenes
    files = {f"bev/groundtruth/{sample.token}.npz" for sample in dataset.samples(scene)}
    pictures = [f"bev/groundtruth/pictures/{scene.name}-000{number}.jpg" for number in range(3)]
    assert set(digests(made)) == {*files, *pictures, "bev/groundtruth/inputs.jsonl"}
    for sample, bev in zip(dataset.samples(dataset.scenes[0]), maps(dataset, made), strict=True):
        assert bev.grid == SETTINGS.grid
        assert bev.meta["token"] == sample.token
        assert bev.meta["timestamp_us"] == sample.timestamp_us
        assert bev.meta["sources"]["road"] == "semantic_lidar (lidarseg)"
        assert bev.meta["sources"]["lane"] == "none"
    picture = read_image(made / pictures[0])
    assert picture.shape == (80 * 4, 2 * 80 * 4, 3)


def test_the_ground_has_its_true_colours(dataset: Dataset, made: Path) -> None:
    for k, bev in enumerate(maps(dataset, made)):
        centres = np.pad(bev.grid.centres(), ((0, 0), (0, 0), (0, 1)))
        y = apply(street_from_ego(0.5 * k), centres)[..., 1]
        for rgb, where in (
            (GREY, (np.abs(y) < KERB_M - 0.4) & (np.abs(y) > STRIPE_M / 2 + 0.4)),
            (BROWN, (np.abs(y) > KERB_M + 0.4) & (y < 5)),
        ):
            wanted = where & bev.appearance_valid & (bev.occupancy[VEHICLE] == 0)
            assert wanted.sum() > 300
            assert (np.abs(bev.appearance[:, wanted].T.astype(int) - rgb).max(axis=1) <= 2).mean() > 0.98
        stripe = (np.abs(y) < 0.2) & bev.appearance_valid & (bev.occupancy[VEHICLE] == 0)
        assert np.median(bev.appearance[0, stripe]) > (GREY[0] + WHITE[0]) / 2


def test_unknown_cells_are_black_and_not_valid(dataset: Dataset, made: Path) -> None:
    for bev in maps(dataset, made):
        assert 0.3 < bev.appearance_valid.mean() < 0.95
        assert not bev.appearance[:, ~bev.appearance_valid].any()
        assert (bev.appearance[:, bev.appearance_valid].max(axis=0) > 20).all()


def test_roads_and_vehicles_are_where_they_are(dataset: Dataset, made: Path) -> None:
    for k, bev in enumerate(maps(dataset, made)):
        time_s = 0.5 * k
        centres = np.pad(bev.grid.centres(), ((0, 0), (0, 0), (0, 1)))
        place = apply(street_from_ego(time_s), centres)
        true_road = np.abs(place[..., 1]) < KERB_M
        known = bev.occupancy_valid[ROAD] & (np.abs(np.abs(place[..., 1]) - KERB_M) > 0.3)
        assert known.sum() > 500
        assert ((bev.occupancy[ROAD] == 1) == true_road)[known].mean() > 0.99
        assert not bev.occupancy_valid[LANE].any()
        on = np.zeros(bev.grid.shape, np.bool_)
        for solid in street(time_s)[:2]:
            on |= ((place >= solid.low) & (place <= solid.high))[..., :2].all(axis=2)
        assert np.array_equal(bev.occupancy[VEHICLE] == 1, on)
        red = on & (place[..., 1] < 0)
        assert (np.abs(bev.appearance[:, red].T.astype(int) - RED) <= 5).all()
        assert (np.abs(bev.appearance[:, on & ~red].T.astype(int) - BLUE) <= 5).all()


# The same on every run ----------------------------------------------------------------------------------------------


def test_the_same_bytes_again_and_with_more_workers(dataset: Dataset, made: Path, tmp_path: Path) -> None:
    expected = digests(made)
    run(dataset, tmp_path / "again")
    assert digests(tmp_path / "again") == expected
    run(dataset, tmp_path / "two", workers=2)
    assert digests(tmp_path / "two") == expected


def test_a_run_resumes(dataset: Dataset, made: Path, tmp_path: Path) -> None:
    run(dataset, tmp_path)
    expected = digests(tmp_path)
    first, second, third = (bev_path(tmp_path, "groundtruth", s.token) for s in dataset.samples(dataset.scenes[0]))
    assert run(dataset, tmp_path)[:2] == (0, 3)
    first.unlink()
    picture_of(dataset, second).unlink()
    assert run(dataset, tmp_path)[:2] == (2, 1)
    third.write_bytes(third.read_bytes()[:100])
    assert run(dataset, tmp_path)[:2] == (1, 2)
    assert digests(tmp_path) == expected == digests(made)


def test_maps_are_replaced_when_their_inputs_changed(tiny: TinyDataset, tmp_path: Path) -> None:
    def anew() -> tuple[int, dict[str, int]]:
        summary = run(Dataset(tiny.root), tmp_path)
        return summary.made, summary.stale

    assert anew() == (3, {})
    tiny.tables["sample_annotation"][0]["size"][0] += 0.5
    tiny.write()
    assert anew() == (3, {"boxes changed": 3})
    tiny.tables["calibrated_sensor"][0]["translation"][2] += 0.1
    tiny.write()
    assert anew() == (3, {"calibration changed": 3})
    os.utime(next((tiny.root / "samples" / "LIDAR_TOP").iterdir()), ns=(1, 1))
    os.utime(tiny.root / "maps" / "drivable.png", ns=(1, 1))
    assert anew() == (3, {"maps and sweeps changed": 3})
    (tmp_path / "bev" / "groundtruth" / "inputs.jsonl").unlink()
    assert anew() == (3, {"what they were made from is not recorded": 3})
    assert anew() == (0, {})


def test_other_settings_are_another_run(dataset: Dataset, tmp_path: Path) -> None:
    run(dataset, tmp_path)
    before = digests(tmp_path)
    other = GroundTruthSettings(SETTINGS.grid, "mode")
    assert run(dataset, tmp_path, settings=other)[:2] == (3, 0)
    assert digests(tmp_path) != before
    assert maps(dataset, tmp_path)[0].meta["settings"]["paint"] == "mode"


def test_progress_counts_samples_whether_made_or_kept(dataset: Dataset, tmp_path: Path) -> None:
    steps: list[float] = []
    for _ in range(2):
        generate(dataset, dataset.scenes, tmp_path, SETTINGS, None, steps.append)
        assert sum(steps) == pytest.approx(3)
        steps.clear()
        bev_path(tmp_path, "groundtruth", dataset.samples(dataset.scenes[0])[1].token).unlink()


# When something goes wrong ------------------------------------------------------------------------------------------


def whole(out: Path) -> int:
    """How many maps lie there; every file is a whole map or its picture."""
    names = set(digests(out)) if out.is_dir() else set()
    found = {name for name in names if name.endswith(".npz")}
    for name in found:
        assert not Path(name).name.startswith(".")
        BEVMap.load(out / name)
    assert len([name for name in names if name.endswith(".jpg")]) >= len(found)
    assert all(not Path(name).name.startswith(".") for name in names)
    return len(found)


def test_a_truncated_image_ends_the_run_with_its_name(tmp_path: Path) -> None:
    dataset = make(tmp_path / "data", Plan(street, samples=3, with_lidar=(0,)))
    image = dataset.path(dataset.data(dataset.samples(dataset.scenes[0])[2])["CAM_LEFT"])
    image.write_bytes(image.read_bytes()[:200])
    with pytest.raises(DataError, match=rf"CAM_LEFT/{image.name}: "):
        run(dataset, tmp_path / "out")
    assert whole(tmp_path / "out") == 0  # all images are read before the first map is written


@pytest.mark.parametrize("workers", [1, 2])
def test_a_failure_in_the_middle_leaves_whole_files_only(
    dataset: Dataset, made: Path, tmp_path: Path, workers: int
) -> None:
    out = tmp_path / "out"
    # A folder lies where the last map should go: the worker that makes it fails.
    blocked = bev_path(out, "groundtruth", dataset.samples(dataset.scenes[0])[2].token)
    blocked.mkdir(parents=True)
    with pytest.raises(DataError, match=rf"{blocked.name}: cannot be written \(not a plain file\)"):
        run(dataset, out, workers)
    blocked.rmdir()
    picture_of(dataset, blocked).unlink()  # the picture comes first, so that a map is never without one
    assert whole(out) == 2
    assert run(dataset, out)[:2] == (1, 2)
    assert digests(out) == digests(made)


def test_an_interrupted_run_leaves_whole_files_only(
    dataset: Dataset, made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real, calls = BEVMap.save, []

    def interrupted(self: BEVMap, path: Path) -> None:
        calls.append(path)
        if len(calls) == 2:
            raise KeyboardInterrupt
        real(self, path)

    with monkeypatch.context() as patch:
        patch.setattr(BEVMap, "save", interrupted)
        with pytest.raises(KeyboardInterrupt):
            run(dataset, tmp_path)
    assert whole(tmp_path) == 1
    assert run(dataset, tmp_path)[:2] == (2, 1)
    assert digests(tmp_path) == digests(made)


def test_a_write_that_fails_leaves_no_temporary_file(
    dataset: Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(handle: object, **parts: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np, "savez_compressed", full)
    with pytest.raises(DataError, match=r"\.npz: cannot be written \(No space left on device\)"):
        run(dataset, tmp_path)
    assert whole(tmp_path) == 0


def test_a_truncated_sweep_ends_the_run_with_its_name(tmp_path: Path) -> None:
    dataset = make(tmp_path, Plan(street, samples=1))
    sweep = dataset.path(dataset.data(dataset.samples(dataset.scenes[0])[0])["LIDAR_TOP"])
    sweep.write_bytes(sweep.read_bytes()[:-7])
    with pytest.raises(DataError, match=rf"{sweep.name}: expected rows of 5 float32"):
        run(dataset, tmp_path / "out")


# What may be missing ------------------------------------------------------------------------------------------------


def test_without_lidar_there_are_vehicles_still(tmp_path: Path) -> None:
    dataset = make(tmp_path, Plan(street, samples=1, with_lidar=()))
    run(dataset, tmp_path)
    bev = maps(dataset, tmp_path)[0]
    assert bev.meta["sources"]["appearance_static"] == "none"
    assert not bev.occupancy_valid[[ROAD, LANE]].any()
    assert np.array_equal(bev.appearance_valid, bev.occupancy[VEHICLE] == 1)


def test_without_cameras_there_is_occupancy_still(tmp_path: Path) -> None:
    dataset = make(tmp_path, Plan(street, samples=1, cameras=()))
    run(dataset, tmp_path)
    bev = maps(dataset, tmp_path)[0]
    assert not bev.appearance_valid.any()
    assert bev.occupancy[VEHICLE].any()
    assert bev.occupancy_valid[ROAD].any()


def test_a_test_set_without_annotations(tmp_path: Path) -> None:
    dataset = make(tmp_path, Plan(street, samples=1, annotated=False))
    run(dataset, tmp_path)
    bev = maps(dataset, tmp_path)[0]
    assert not bev.occupancy_valid[VEHICLE].any()
    assert bev.appearance_valid.any()


def test_labels_of_key_frames_alone_are_enough(tmp_path: Path) -> None:
    """Ten sweeps without labels do not outvote the labelled one, as in nuScenes."""
    sweeps = tuple(0.01 * k for k in range(1, 11))
    dataset = make(tmp_path, Plan(street, samples=1, cameras=(), with_lidar=(0,), sweeps_s=sweeps))
    run(dataset, tmp_path)
    bev = maps(dataset, tmp_path)[0]
    assert bev.occupancy[ROAD].sum() > 300


def test_a_scene_without_samples(tiny: TinyDataset, tmp_path: Path) -> None:
    tiny.tables["scene"].append({**tiny.tables["scene"][0], "token": "empty", "name": "empty"})
    dataset = Dataset(tiny.write())
    assert run(dataset, tmp_path / "out")[:2] == (3, 0)  # beside one that has some
    with pytest.raises(DataError, match=r"no key frames \(scenes: empty\)"):
        generate(dataset, [dataset.scene("empty")], tmp_path / "none", SETTINGS, None, lambda _: None)
    with pytest.raises(DataError, match=r"no key frames \(scenes: none\)"):
        generate(dataset, [], tmp_path / "none", SETTINGS, None, lambda _: None)
    assert not (tmp_path / "none").exists()


def test_a_hand_made_dataset(tiny: TinyDataset, tmp_path: Path) -> None:
    """Two small cameras, three points a sweep, a mask that says road everywhere but lies far away."""
    dataset = Dataset(tiny.root)
    assert run(dataset, tmp_path).made == 3
    first = maps(dataset, tmp_path)[0]
    assert first.meta["sources"]["road"] == "none"
    car_cells = np.argwhere(first.occupancy[VEHICLE] == 1)
    middle = first.grid.centre_of(car_cells).mean(axis=0)
    np.testing.assert_allclose(middle, [10.0, 0.0], atol=0.05)
