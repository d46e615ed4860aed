"""Batch loader: augmented batches of samples or clips, reproducible from the seed, loaded in the background."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from functools import lru_cache
from itertools import count, groupby, pairwise
from typing import TypeVar

import numpy as np
import torch

from appocc.camera import Camera, CameraRig
from appocc.checks import IntArray
from appocc.errors import DataError
from appocc.models.memory import Past, ground_motion, is_linked
from appocc.models.model_spec import ModelSpec
from appocc.nuscenes.view_targets import UNKNOWN_KIND
from appocc.training.batches.augment import Augmentation, augment
from appocc.training.batches.batch import Batch, Truth
from appocc.training.batches.batch_processes import batches_by_processes
from appocc.training.batches.packed_dataset import PackedDataset
from appocc.training.batches.reading import APPEARANCE_BIT, PackedSample, crop

NO_AUGMENTATION = Augmentation()
_ORDER, _AUGMENT = 0, 1  # streams of random numbers

Item = TypeVar("Item")


class BatchLoader:
    """Batches of one or several packed datasets of the same setting.

    A clip is a number of consecutive samples of a scene, 1 for single samples. All clips are shuffled in every epoch;
    epochs are concatenated to one endless sequence, so that every batch is full. Clip k of this sequence and its
    augmentation, the same for all its samples, depend on the seed and k only: batch `step` of process `rank` holds
    the clips k = (step * world_size + rank) * clips + 0, 1, ... A step is one forward pass, also with gradient
    accumulation.
    """

    def __init__(
        self,
        datasets: Sequence[PackedDataset],
        batch_size: int,
        seed: int,
        augmentation: Augmentation = NO_AUGMENTATION,
        rank: int = 0,
        world_size: int = 1,
        clip: int = 1,
    ) -> None:
        """Load batches of packed datasets; the batch size is a number of samples, a multiple of those of a clip.

        Raises:
            DataError: if there are no samples, the settings of the datasets differ, or a batch does not hold whole
                clips.
        """
        self._datasets = tuple(datasets)
        self._ends = np.cumsum([len(dataset) for dataset in datasets])
        if not len(self._ends) or not self._ends[-1]:
            raise DataError("expected packed datasets with samples, got none")
        self.setting: ModelSpec = datasets[0].setting
        for dataset in datasets:
            if dataset.setting != self.setting:
                raise DataError(f"{dataset.folder}: expected the setting of {datasets[0].folder}, got another")
        if batch_size < 1 or not 0 <= rank < world_size:
            got = f"got {batch_size}, {rank}, {world_size}"
            raise DataError(f"expected a batch size of 1 or more and rank < world size, {got}")
        if clip < 1 or batch_size % clip:
            raise DataError(f"expected a batch size that is a multiple of the clip, got {batch_size} and {clip}")
        self._clips, self._clip = batch_size // clip, clip
        self._windows = [
            window for dataset, first in self._starts() for window in _windows(dataset.scenes, first, clip)
        ]
        self._size, self._seed, self._augmentation = batch_size, seed, augmentation
        self._rank, self._world_size = rank, world_size
        self._cameras = max(len(dataset.channels) for dataset in datasets)

    def __len__(self) -> int:
        """Number of samples of all datasets."""
        return int(self._ends[-1])

    def batch(self, step: int) -> Batch:
        """Return the batch of a step."""
        first = (step * self._world_size + self._rank) * self._clips
        return self._collate([self._augmented(k) for k in range(first, first + self._clips)])

    def batches(self, start: int = 0, workers: int = 1, processes: bool = False) -> Iterator[Batch]:
        """Yield batches from a step on, without end.

        Args:
            start: first step.
            workers: number of threads that load ahead; 0 loads on request.
            processes: processes instead of threads. They do not share the interpreter with a training loop that only
                feeds a GPU; a loop that computes on the CPU needs few.
        """
        if processes and workers:
            return batches_by_processes(self.batch, start, workers)
        return _in_threads(self.batch, count(start), workers)

    def in_order(self, limit: int | None = None, threads: int = 1) -> Iterator[Batch]:
        """Yield each sample once, not augmented, in the order of the datasets; the last batch may be smaller.

        Args:
            limit: number of samples over all ranks, the first ones; None: all.
            threads: number of threads that load ahead; 0 loads on request.
        """
        total = len(self) if limit is None else min(limit, len(self))
        clips = [
            clip for dataset, first in self._starts() for clip in _clips(dataset.scenes, first, self._clip, total)
        ]
        own = clips[self._rank :: self._world_size]
        return _in_threads(self._not_augmented, _groups(own, self._clips), threads)

    def _not_augmented(self, clips: Sequence[Sequence[int]]) -> Batch:
        grid = self.setting.grid
        return self._collate([[(n, crop(self._packed_sample(n), grid)) for n in clip] for clip in clips])

    def _augmented(self, k: int) -> list[tuple[int, PackedSample]]:
        """Return index and augmented sample of each sample of clip k of the endless sequence."""
        epoch, position = divmod(k, len(self._windows))
        window = self._windows[int(_permutation(self._seed, epoch, len(self._windows))[position])]
        return [
            (
                number,
                augment(
                    self._packed_sample(number),
                    self._augmentation,
                    self.setting.grid,
                    np.random.default_rng([self._seed, _AUGMENT, k]),
                ),
            )
            for number in window
        ]

    def _collate(self, clips: Sequence[Sequence[tuple[int, PackedSample]]]) -> Batch:
        """Collate clips of the same length, time-major."""
        numbers, samples = zip(*(clip[t] for t in range(len(clips[0])) for clip in clips), strict=True)
        batch = collate(samples, numbers, self._cameras)
        return batch if self._clip == 1 else batch._replace(past=link_frames(clips))

    def _starts(self) -> Iterator[tuple[PackedDataset, int]]:
        """Yield each dataset and the index of its first sample."""
        return zip(self._datasets, [0, *self._ends[:-1].tolist()], strict=True)

    def _packed_sample(self, number: int) -> PackedSample:
        i = int(np.searchsorted(self._ends, number, "right"))
        return self._datasets[i].sample(number - int(self._ends[i]) + len(self._datasets[i]))


@lru_cache(maxsize=4)
def _permutation(seed: int, epoch: int, clips: int) -> IntArray:
    """Return the order of the clips in an epoch."""
    return np.random.default_rng([seed, _ORDER, epoch]).permutation(clips)


def _scene_ranges(scenes: Sequence[str], first: int) -> Iterator[range]:
    """Yield the indices of the samples of each scene, given the scene of each sample and the first index."""
    for _, group in groupby(range(len(scenes)), key=scenes.__getitem__):
        own = list(group)
        yield range(first + own[0], first + own[-1] + 1)


def _windows(scenes: Sequence[str], first: int, length: int) -> Iterator[tuple[int, ...]]:
    """Yield all windows of consecutive samples of a scene; a shorter scene repeats its first sample."""
    for own in _scene_ranges(scenes, first):
        for end in range(min(own.start + length, own.stop), own.stop + 1):
            yield tuple(max(number, own.start) for number in range(end - length, end))


def _clips(scenes: Sequence[str], first: int, length: int, total: int) -> Iterator[tuple[int, ...]]:
    """Yield the samples below index `total` once, in consecutive clips of at most `length` samples of a scene."""
    for own in _scene_ranges(scenes, first):
        for start in range(own.start, min(own.stop, total), length):
            yield tuple(range(start, min(start + length, own.stop, total)))


def _groups(clips: Sequence[tuple[int, ...]], most: int) -> Iterator[list[tuple[int, ...]]]:
    """Yield consecutive clips of the same length in groups of at most `most`."""
    for _, group in groupby(clips, key=len):
        alike = list(group)
        yield from (alike[i : i + most] for i in range(0, len(alike), most))


def link_frames(clips: Sequence[Sequence[tuple[int, PackedSample]]]) -> Past:
    """Return the links of the samples of clips of the same length to those before them."""
    samples = [[sample for _, sample in clip] for clip in clips]
    motion = np.zeros((len(samples[0]), len(samples), 2, 3), np.float32)
    elapsed_s, linked = (np.zeros(motion.shape[:2], np.float32) for _ in range(2))
    for b, clip in enumerate(samples):
        for t, (before, now) in enumerate(pairwise(clip), start=1):
            motion[t, b], elapsed_s[t, b] = (
                ground_motion(before.world_from_ego, now.world_from_ego),
                _seconds(before, now),
            )
            linked[t, b] = is_linked(motion[t, b], float(elapsed_s[t, b]))
    return Past(None, *(torch.from_numpy(each) for each in (motion, elapsed_s, linked)))


def _seconds(before: PackedSample, now: PackedSample) -> float:
    return float(now.time_us - before.time_us) / 1e6


def _in_threads(job: Callable[[Item], Batch], items: Iterable[Item], threads: int) -> Iterator[Batch]:
    """Yield the batches of the items in order; up to two more than there are threads are loaded ahead."""
    if threads < 1:
        yield from map(job, items)
        return
    pool = ThreadPoolExecutor(threads, "samples")
    waiting: deque[Future[Batch]] = deque()
    try:
        for item in items:
            waiting.append(pool.submit(job, item))
            if len(waiting) > threads + 1:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def collate(samples: Sequence[PackedSample], numbers: Sequence[int], cameras: int) -> Batch:
    """Collate samples on the grid of the setting to a batch; the images of present cameras come first.

    Images keep the memory layout of the packed dataset, channels last.

    Args:
        samples: samples of one image size and one grid.
        numbers: index of each sample in all packed datasets.
        cameras: N, largest number of cameras of a sample.
    """
    b, n, (high, wide) = len(samples), cameras, samples[0].images.shape[1:3]
    images = np.zeros((b, n, high, wide, 3), np.uint8)
    depth = np.zeros((b, n, *samples[0].depth_m.shape[1:]), np.float32)
    kind = np.full(depth.shape, -1, np.int64)
    for i, sample in enumerate(samples):
        for slot, camera in enumerate(np.flatnonzero(sample.alive)):
            images[i, slot] = sample.images[camera]
            depth[i, slot] = sample.depth_m[camera]
            kind[i, slot] = np.where(sample.kind[camera] == UNKNOWN_KIND, -1, sample.kind[camera].astype(np.int64))
    bits = np.arange(3, dtype=np.uint8)[:, None, None]
    occupancy = np.stack([sample.occupancy >> bits & 1 for sample in samples])
    known = np.stack([sample.known for sample in samples])
    appearance = np.stack([sample.appearance for sample in samples])
    objects = np.stack([sample.objects for sample in samples])
    most = max(1, int(np.isfinite(objects[..., 0]).sum(axis=1).max()))
    truth = Truth(
        torch.from_numpy(occupancy.astype(np.float32)),
        torch.from_numpy((known[:, None] >> bits & 1).astype(np.bool_)),
        torch.from_numpy(appearance.astype(np.float32) / np.float32(255)),
        torch.from_numpy((known >> APPEARANCE_BIT & 1).astype(np.bool_)),
        torch.from_numpy(depth),
        torch.from_numpy(kind),
        torch.from_numpy(objects[:, :most]),
        torch.from_numpy(np.stack([sample.owner for sample in samples]).astype(np.int64)),
    )
    rigs = tuple(_camera_rig(sample) for sample in samples)
    return Batch(torch.from_numpy(images).permute(0, 1, 4, 2, 3), rigs, truth, tuple(numbers))


def _camera_rig(sample: PackedSample) -> CameraRig:
    """Return the cameras of a sample that have images, in the order of the sample."""
    high, wide = sample.images.shape[1:3]
    k, poses = sample.intrinsic, sample.ego_from_cam
    present = np.flatnonzero(sample.alive)
    return CameraRig(tuple(Camera(sample.channels[n], wide, high, k[n].copy(), poses[n].copy()) for n in present))
