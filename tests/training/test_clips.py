"""Clips: consecutive samples of a scene, changed alike, in the order of time, with links to the frames before."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
import torch
from made_packed import SETTING, with_maps
from tiny_dataset import SPEED_MPS, STEP_US, TinyDataset

from appocc.errors import DataError
from appocc.training.batches.augment import Augmentation, augment
from appocc.training.batches.batch import Batch
from appocc.training.batches.batch_loader import BatchLoader, collate
from appocc.training.batches.packed_dataset import PackedDataset, pack_dataset

TURNED = Augmentation(yaw_rad=np.pi, shift_m=2.0, mirror=0.5)
STRONG = replace(TURNED, brightness=0.2, saturation=0.3, cameras_dropped=1, extrinsic_rad=0.02, extrinsic_m=0.05)
STEP_S = STEP_US / 1e6


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> PackedDataset:
    """One scene of three samples: the ego drives straight ahead."""
    folder: Path = tmp_path_factory.mktemp("clips")
    return pack_dataset(with_maps(TinyDataset(folder / "tiny")), "exact", SETTING, folder / "pack")


def scenes(drive: PackedDataset, **lengths: int) -> PackedDataset:
    """Scenes of these lengths, each with the first samples of the drive."""
    numbers = [number for length in lengths.values() for number in range(length)]
    return replace(drive.subset(numbers), scenes=tuple(name for name, n in lengths.items() for _ in range(n)))


def clips_of(batch: Batch, clip: int) -> list[tuple[int, ...]]:
    """Numbers of the samples of each clip of a batch, which is time-major."""
    return [tuple(row) for row in np.reshape(batch.number, (clip, -1)).T.tolist()]


def one_pass(datasets: Sequence[PackedDataset], clip: int, windows: int) -> list[tuple[int, ...]]:
    """The clips of the first pass, sorted."""
    stream = islice(BatchLoader(datasets, clip, 0, clip=clip).batches(workers=0), windows)
    return sorted(window for batch in stream for window in clips_of(batch, clip))


# Windows ----------------------------------------------------------------------------------------------------------


def test_clips_are_all_runs_of_samples_of_a_scene_and_short_scenes_repeat_their_first(drive: PackedDataset) -> None:
    towns = scenes(drive, a=3, b=2, c=1)
    assert one_pass([towns], 2, 4) == [(0, 1), (1, 2), (3, 4), (5, 5)]
    assert one_pass([towns], 3, 3) == [(0, 1, 2), (3, 3, 4), (5, 5, 5)]
    assert one_pass([towns], 1, 6) == [(0,), (1,), (2,), (3,), (4,), (5,)]


def test_no_clip_holds_samples_of_two_datasets(drive: PackedDataset) -> None:
    assert one_pass([drive, drive], 2, 4) == [(0, 1), (1, 2), (3, 4), (4, 5)]


def test_a_subset_has_clips_of_the_samples_that_remain(drive: PackedDataset) -> None:
    held, last = scenes(drive, a=3, b=3).split(1)
    assert one_pass([held], 2, 2) == [(0, 1), (2, 3)]
    assert one_pass([last], 2, 2) == [(0, 0), (1, 1)]


@pytest.mark.parametrize(("batch", "clip"), [(3, 2), (2, 3), (2, 0), (2, -1)])
def test_batches_that_hold_no_whole_clips_are_refused(drive: PackedDataset, batch: int, clip: int) -> None:
    with pytest.raises(DataError, match=f"expected a batch size that is a multiple of the clip, got {batch} and"):
        BatchLoader([drive], batch, 0, clip=clip)


# Batches ----------------------------------------------------------------------------------------------------------


def test_batches_are_time_major(drive: PackedDataset) -> None:
    for batch in islice(BatchLoader([scenes(drive, a=3, b=3, c=2)], 4, 2, clip=2).batches(workers=0), 5):
        one, other, after_one, after_other = batch.number
        assert (after_one, after_other) == (one + 1, other + 1)
        assert batch.past is not None
        assert batch.past.linked.tolist() == [[0, 0], [1, 1]]


def test_all_samples_of_a_clip_are_changed_alike(drive: PackedDataset) -> None:
    # Scenes of one sample, which a clip repeats.
    batch = BatchLoader([scenes(drive, a=1, b=1)], 6, 4, STRONG, clip=3).batch(0)
    pictures, maps, objects = (
        each.reshape(3, 2, *each.shape[1:]) for each in (batch.images, batch.truth.appearance, batch.truth.objects)
    )
    for t in (1, 2):
        assert torch.equal(pictures[t], pictures[0])
        assert torch.equal(maps[t], maps[0])
        np.testing.assert_array_equal(objects[t], objects[0])
    assert not torch.equal(maps[0, 0], maps[0, 1])
    assert [rig.channels for rig in batch.rigs[:2]] == [rig.channels for rig in batch.rigs[4:]]


def test_single_samples_are_those_of_the_seed_alone(drive: PackedDataset) -> None:
    loader = BatchLoader([drive], 2, 7, STRONG)
    order = [int(n) for epoch in range(3) for n in np.random.default_rng([7, 0, epoch]).permutation(3)]
    for step in range(4):
        batch = loader.batch(step)
        numbers = order[2 * step : 2 * step + 2]
        samples = [
            augment(drive.sample(number), STRONG, SETTING.grid, np.random.default_rng([7, 1, 2 * step + i]))
            for i, number in enumerate(numbers)
        ]
        expected = collate(samples, numbers, 2)
        assert batch.past is None
        assert batch.number == tuple(numbers)
        for found, wanted in zip((batch.images, *batch.truth), (expected.images, *expected.truth), strict=True):
            np.testing.assert_array_equal(found, wanted)


def test_processes_share_the_clips(drive: PackedDataset) -> None:
    towns = scenes(drive, a=3, b=2, c=3)
    alone = BatchLoader([towns], 4, 5, STRONG, clip=2)
    ranks = [BatchLoader([towns], 2, 5, STRONG, rank, 2, clip=2) for rank in range(2)]
    for step in range(4):
        whole, parts = alone.batch(step), [loader.batch(step) for loader in ranks]
        assert [clip for part in parts for clip in clips_of(part, 2)] == clips_of(whole, 2)
        for rank, part in enumerate(parts):
            assert torch.equal(part.images, whole.images[rank::2])
            assert part.past is not None
            assert whole.past is not None
            assert torch.equal(part.past.past_from_now, whole.past.past_from_now[:, rank : rank + 1])


# In order ---------------------------------------------------------------------------------------------------------


def test_in_order_visits_every_sample_once_in_whole_clips(drive: PackedDataset) -> None:
    towns = scenes(drive, a=3, b=2, c=1, d=2)
    loader = BatchLoader([towns], 4, 0, STRONG, clip=2)
    batches = list(loader.in_order())
    assert [batch.number for batch in batches] == [(0, 1), (2,), (3, 4), (5,), (6, 7)]
    numbers = [n for batch in batches for n in batch.number]
    assert sorted(numbers) == list(range(len(loader)))
    long = BatchLoader([scenes(drive, a=3, b=3)], 6, 0, clip=3)
    assert [batch.number for batch in long.in_order()] == [(0, 3, 1, 4, 2, 5)]
    assert [batch.number for batch in long.in_order(5)] == [(0, 1, 2), (3, 4)]
    assert [batch.number for batch in long.in_order(2)] == [(0, 1)]


def test_in_order_is_not_changed_and_linked(drive: PackedDataset) -> None:
    (batch,) = BatchLoader([drive], 3, 0, STRONG, clip=3).in_order()
    plain = next(BatchLoader([drive], 3, 0).in_order())
    assert torch.equal(batch.images, plain.images)
    assert batch.past is not None
    assert batch.past.linked.tolist() == [[0], [1], [1]]


def test_processes_share_the_clips_in_order(drive: PackedDataset) -> None:
    towns = scenes(drive, a=3, b=2, c=3)
    shares = [
        [n for batch in BatchLoader([towns], 2, 0, rank=rank, world_size=2, clip=2).in_order() for n in batch.number]
        for rank in range(2)
    ]
    assert sorted(shares[0] + shares[1]) == list(range(8))
    assert shares[0] == [0, 1, 3, 4, 7]


# Links ------------------------------------------------------------------------------------------------------------


def test_links_have_the_motion_and_the_seconds_between(drive: PackedDataset) -> None:
    past = BatchLoader([drive], 3, 0, clip=3).batch(0).past
    assert past is not None
    assert past.state is None
    assert past.past_from_now.shape == (3, 1, 2, 3)
    assert past.linked.tolist() == [[0], [1], [1]]
    assert past.elapsed_s.tolist() == [[0], [STEP_S], [STEP_S]]
    ahead = np.array([[1, 0, SPEED_MPS * STEP_S], [0, 1, 0]])
    np.testing.assert_allclose(past.past_from_now[1:, 0], np.stack([ahead, ahead]), atol=1e-6)


def test_links_follow_the_changed_frames(drive: PackedDataset) -> None:
    moved = []
    for step in range(8):
        past = BatchLoader([drive], 3, 0, TURNED, clip=3).batch(step).past
        assert past is not None
        assert past.linked.tolist() == [[0], [1], [1]]
        np.testing.assert_allclose(past.past_from_now[1:, 0, :, :2], [np.eye(2)] * 2, atol=1e-5)
        np.testing.assert_allclose(past.past_from_now[1], past.past_from_now[2], atol=1e-5)
        moved.append(past.past_from_now[1, 0, :, 2].numpy())
    np.testing.assert_allclose(np.hypot(*np.array(moved).T), SPEED_MPS * STEP_S, rtol=1e-5)
    assert np.ptp(np.arctan2(*np.array(moved).T)) > 1  # each clip in a frame of its own


@pytest.mark.parametrize(
    ("times_s", "linked"),
    [
        ((0, 0.5, 1.0), [0, 1, 1]),
        ((0, 0.5, 9.0), [0, 1, 0]),  # a break of the recording
        ((0, 0.0, 0.5), [0, 0, 1]),
        ((5, 1.0, 1.5), [0, 0, 1]),  # out of order
        ((0, 0.01, 0.51), [0, 0, 1]),  # a jump: 2.5 m in 10 ms
    ],
)
def test_links_break_at_gaps_and_jumps(drive: PackedDataset, times_s: tuple[float, ...], linked: list[int]) -> None:
    times = {**drive.arrays, "time_us": np.array([round(1e6 * time_s) for time_s in times_s])}
    past = BatchLoader([replace(drive, arrays=times)], 3, 0, clip=3).batch(0).past
    assert past is not None
    assert past.linked[:, 0].tolist() == linked


def test_repeated_samples_are_not_linked(drive: PackedDataset) -> None:
    past = BatchLoader([scenes(drive, a=2)], 3, 0, clip=3).batch(0).past
    assert past is not None
    assert past.linked[:, 0].tolist() == [0, 0, 1]
    assert torch.isfinite(past.past_from_now).all()
