"""The row of batches follows from the seed, can be entered at any step, and is the same however it is made."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from dataclasses import replace
from itertools import islice
from typing import Any

import numpy as np
import pytest
import torch
from made_packed import SETTING, made_map, with_maps
from numpy.typing import NDArray
from tiny_dataset import TinyDataset, token
from tolerances import assert_rounded

from appocc.camera import CameraRig
from appocc.errors import DataError
from appocc.nuscenes.view_targets import ViewTargets, save_view_targets, view_targets_path
from appocc.training.batches.augment import Augmentation
from appocc.training.batches.batch import Batch
from appocc.training.batches.batch_loader import BatchLoader
from appocc.training.batches.packed_dataset import PackedDataset, pack_dataset

STRONG = Augmentation(
    yaw_rad=np.pi,
    shift_m=2.0,
    mirror=0.5,
    brightness=0.2,
    contrast=0.2,
    saturation=0.2,
    cameras_dropped=1,
    extrinsic_rad=0.02,
    extrinsic_m=0.05,
)


@pytest.fixture(scope="module")
def packed(tmp_path_factory: pytest.TempPathFactory) -> PackedDataset:
    """Three samples; the front camera of the second is dead; depth and kind of the first are known."""
    folder = tmp_path_factory.mktemp("packs")
    tiny = TinyDataset(folder / "tiny")
    lost = token("CAM_FRONT", 490_000)
    tiny.tables["sample_data"] = [row for row in tiny.tables["sample_data"] if row["token"] != lost]
    tiny.write()
    depth, kind = np.full((3, 4), 20, np.float16), np.full((3, 4), 5, np.uint8)
    depth[:2], kind[:2] = np.inf, 0  # the upper block of the cut picture is the second of the whole
    save_view_targets(view_targets_path(tiny.root, token("sample", 0)), {"CAM_FRONT": ViewTargets(depth, kind)})
    return pack_dataset(with_maps(tiny), "exact", SETTING, folder / "pack")


def same_rigs(one: CameraRig, other: CameraRig) -> bool:
    return one.channels == other.channels and all(
        np.array_equal(a.intrinsic, b.intrinsic) and np.array_equal(a.ego_from_cam, b.ego_from_cam)
        for a, b in zip(one, other, strict=True)
    )


def same(one: Batch, other: Batch) -> bool:
    tensors = zip((one.images, *one.truth), (other.images, *other.truth), strict=True)
    rigs = zip(one.rigs, other.rigs, strict=True)
    return (
        one.number == other.number
        and all(a.dtype == b.dtype and np.array_equal(a, b, equal_nan=a.is_floating_point()) for a, b in tensors)
        and all(same_rigs(a, b) for a, b in rigs)
    )


def test_content_of_a_batch(packed: PackedDataset) -> None:
    batch = next(BatchLoader([packed], 3, 0).in_order())
    assert batch.number == (0, 1, 2)
    assert [rig.channels for rig in batch.rigs] == [
        ("CAM_BACK", "CAM_FRONT"),
        ("CAM_BACK",),
        ("CAM_BACK", "CAM_FRONT"),
    ]
    assert batch.images.shape == (3, 2, 3, 16, 32)
    assert batch.images.dtype == torch.uint8
    sample = packed.sample(0)
    expected = torch.from_numpy(sample.images[1].copy()).permute(2, 0, 1)
    assert torch.equal(batch.images[0, 1], expected)
    np.testing.assert_array_equal(batch.rigs[0]["CAM_FRONT"].intrinsic, sample.intrinsic[1])
    assert (batch.rigs[0]["CAM_FRONT"].width_px, batch.rigs[0]["CAM_FRONT"].height_px) == (32, 16)
    assert not batch.images[1, 1:].any()
    for i in range(3):
        bev = made_map(i)
        np.testing.assert_array_equal(batch.truth.occupancy[i], bev.occupancy)
        np.testing.assert_array_equal(batch.truth.occupancy_valid[i], bev.occupancy_valid)
        np.testing.assert_array_equal(batch.truth.appearance_valid[i], bev.appearance_valid)
        assert_rounded(batch.truth.appearance[i], bev.appearance / 255)
    assert batch.truth.depth_m[0, 1].tolist() == [[float("inf")] * 4, [20.0] * 4]
    assert batch.truth.kind[0, 1].tolist() == [[0] * 4, [5] * 4]
    assert (batch.truth.kind[0, 0] == -1).all()
    assert not batch.truth.depth_m[0, 0].any()
    assert batch.truth.kind.dtype == torch.int64


def with_a_dead_first_camera(packed: PackedDataset) -> PackedDataset:
    """The pack with a third camera before the others, which is dead."""
    views = ("images", "intrinsic", "ego_from_cam", "alive", "depth_m", "kind")
    arrays = {name: np.concatenate([packed.arrays[name][:, :1], packed.arrays[name]], axis=1) for name in views}
    arrays["alive"][:, 0] = False
    return replace(packed, channels=("CAM_LEFT", *packed.channels), arrays={**packed.arrays, **arrays})


def test_a_dead_camera_moves_the_others_up(packed: PackedDataset) -> None:
    batch, plain = (next(BatchLoader([p], 3, 0).in_order()) for p in (with_a_dead_first_camera(packed), packed))
    assert batch.images.shape[1] == 3
    assert not batch.images[:, 2].any()
    assert all(map(same_rigs, batch.rigs, plain.rigs))
    for found, expected in ((batch.images, plain.images), (batch.truth.kind, plain.truth.kind)):
        assert torch.equal(found[:, :2], expected)


def test_datasets_of_rigs_with_fewer_cameras_combine(packed: PackedDataset) -> None:
    batches = list(BatchLoader([packed, with_a_dead_first_camera(packed)], 3, 0).in_order())
    assert batches[0].images.shape == batches[1].images.shape == (3, 3, 3, 16, 32)
    assert torch.equal(batches[0].images, batches[1].images)


def test_any_step_follows_from_the_seed_alone(packed: PackedDataset) -> None:
    loader = BatchLoader([packed], 2, 7, STRONG)
    row = list(islice(loader.batches(workers=0), 8))
    assert same(BatchLoader([packed], 2, 7, STRONG).batch(5), row[5])
    assert all(map(same, row[3:], BatchLoader([packed], 2, 7, STRONG).batches(3)))
    assert not same(BatchLoader([packed], 2, 8, STRONG).batch(5), row[5])
    assert not any(same(one, other) for i, one in enumerate(row) for other in row[:i])


@pytest.mark.parametrize(("workers", "processes"), [(1, False), (3, False), (2, True)])
def test_workers_change_nothing(packed: PackedDataset, workers: int, processes: bool) -> None:
    loader = BatchLoader([packed], 2, 1, STRONG)
    for made, plain in zip(islice(loader.batches(2, workers, processes), 10), loader.batches(2, 0), strict=False):
        assert same(made, plain)


@pytest.mark.parametrize("size", [1, 2, 3, 4])
def test_every_pass_has_every_sample_once(packed: PackedDataset, size: int) -> None:
    numbers = [n for batch in islice(BatchLoader([packed], size, 3).batches(), 12) for n in batch.number]
    passes = [tuple(numbers[i : i + 3]) for i in range(0, len(numbers) - 2, 3)]
    assert all(sorted(one) == [0, 1, 2] for one in passes)
    assert len(passes) < 4 or len(set(passes)) > 1


def test_processes_share_the_row(packed: PackedDataset) -> None:
    alone = BatchLoader([packed], 4, 5, STRONG)
    ranks = [BatchLoader([packed], 2, 5, STRONG, rank, 2) for rank in range(2)]
    for step in range(4):
        parts, whole = [loader.batch(step) for loader in ranks], alone.batch(step)
        assert parts[0].number + parts[1].number == whole.number
        assert torch.equal(torch.cat([part.images for part in parts]), whole.images)
        assert torch.equal(torch.cat([part.truth.occupancy for part in parts]), whole.truth.occupancy)


def test_several_datasets_are_numbered_consecutively(packed: PackedDataset) -> None:
    loader = BatchLoader([packed, packed], 2, 0)
    assert len(loader) == 6
    batches = list(loader.in_order())
    assert [batch.number for batch in batches] == [(0, 1), (2, 3), (4, 5)]
    assert torch.equal(batches[0].images[0], batches[1].images[1])
    assert torch.equal(batches[1].images[0], batches[2].images[1])
    assert {n for batch in islice(loader.batches(), 3) for n in batch.number} == set(range(6))


def test_in_order_respects_the_limit_and_is_shared_by_processes(packed: PackedDataset) -> None:
    loader = BatchLoader([packed], 2, 0, STRONG)
    assert [batch.number for batch in loader.in_order()] == [(0, 1), (2,)]
    assert [batch.number for batch in loader.in_order(1, threads=0)] == [(0,)]
    assert [batch.number for batch in loader.in_order(9, threads=4)] == [(0, 1), (2,)]
    shares = [
        [b.number for b in BatchLoader([packed], 2, 0, rank=rank, world_size=2).in_order()] for rank in range(2)
    ]
    assert shares == [[(0, 2)], [(1,)]]


def test_threads_end_with_the_row(packed: PackedDataset) -> None:
    before = threading.active_count()
    row = BatchLoader([packed], 1, 0).batches(workers=2)
    next(row)
    assert threading.active_count() > before
    row.close()  # type: ignore[attr-defined]
    assert threading.active_count() == before


def test_an_error_in_a_thread_reaches_the_loop(packed: PackedDataset) -> None:
    short = replace(packed, arrays={**packed.arrays, "known": packed.arrays["known"][:1]})
    with pytest.raises(IndexError):
        list(BatchLoader([short], 1, 0).in_order())


def test_invalid_loaders(packed: PackedDataset) -> None:
    with pytest.raises(DataError, match="expected packed datasets with samples"):
        BatchLoader([], 1, 0)
    other = replace(packed, setting=replace(packed.setting, name="other"))
    with pytest.raises(DataError, match="expected the setting of"):
        BatchLoader([packed, other], 1, 0)
    with pytest.raises(DataError, match="got 2, 2, 2"):
        BatchLoader([packed], 2, 0, rank=2, world_size=2)
    with pytest.raises(DataError, match="got 0, 0, 1"):
        BatchLoader([packed], 0, 0)


class RowsRead(dict[str, Any]):
    """Arrays of a packed dataset that record the rows that are read."""

    def __init__(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        super().__init__({name: RowsRead.Array(array) for name, array in arrays.items()})

    @property
    def rows(self) -> set[int]:
        return set().union(*(array.rows for array in self.values()))

    class Array:
        def __init__(self, array: NDArray[Any]) -> None:
            assert isinstance(array, np.memmap)  # pages are read on access
            self.array, self.rows = array, set[int]()

        def __getitem__(self, row: int) -> Any:
            self.rows.add(row)
            return self.array[row]


def test_a_process_reads_only_its_own_samples(packed: PackedDataset) -> None:
    for epoch in range(4):
        read = [RowsRead(packed.arrays) for _ in range(3)]
        for rank, arrays in enumerate(read):
            BatchLoader([replace(packed, arrays=arrays)], 1, 7, rank=rank, world_size=3).batch(epoch)
        assert sorted(map(sorted, (arrays.rows for arrays in read))) == [[0], [1], [2]]
    read = [RowsRead(packed.arrays) for _ in range(2)]
    for rank, arrays in enumerate(read):
        list(BatchLoader([replace(packed, arrays=arrays)], 2, 7, rank=rank, world_size=2).in_order(threads=0))
    assert [arrays.rows for arrays in read] == [{0, 2}, {1}]
