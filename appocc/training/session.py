"""Training session: build network, packed datasets and loaders from a configuration, and train."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from typing import Any

import torch
from torch import distributed

from appocc.bevmap import CLASSES
from appocc.environment import memory
from appocc.errors import DataError
from appocc.files import RemotePath, path_of
from appocc.models import registry
from appocc.models.base import BEVModel
from appocc.models.model_spec import MODEL_SPECS, ModelSpec, Parts
from appocc.models.shipped import PACKAGED, find_weights
from appocc.models.weights import load_weights_into, read_calibrations, save_weights
from appocc.nuscenes.view_targets import UNKNOWN_KIND, ViewClass
from appocc.training.batches.augment import Augmentation
from appocc.training.batches.batch_loader import BatchLoader
from appocc.training.batches.packed_dataset import PackedDataset, pack_dataset
from appocc.training.config import AugmentConfig, Config
from appocc.training.loop import train
from appocc.training.process_group import ProcessGroup, join_process_group
from appocc.training.run import TrainingMonitor, TrainingSetup
from appocc.training.run_folder import RunFolder
from appocc.training.summary_writer import load_summary_writer
from appocc.typing import PathLike


def run_training(config: Config, folder: RunFolder, resume: bool, monitor: TrainingMonitor) -> dict[str, Any]:
    """Train with a configuration in a run folder; return the summary of the run as JSON values.

    A run that this launch of torchrun has started resumes from its last checkpoint when torchrun restarts a process.

    Raises:
        AppoccError: as `train`; if data are missing or damaged, or a class has no cells.
    """
    resume = resume or folder.is_of_this_launch()
    folder.check(config, resume)
    if config.save.tensorboard:
        load_summary_writer()  # raises before hours of work if it is not installed
    with join_process_group(config.train.device) as processes, folder.lock() if processes.is_main else nullcontext():
        setup = prepare_training(config, processes, monitor)
        progress = train(setup, config, folder, processes, monitor, resume)
    return folder.summary(progress)


def prepare_training(config: Config, processes: ProcessGroup, monitor: TrainingMonitor) -> TrainingSetup:
    """Build network, training data and validation data of a training.

    Raises:
        AppoccError: if data are missing or damaged, a class has no cells, or the network is unknown.
    """
    setting = MODEL_SPECS[config.setting]
    _check_memory(config.train.batch, setting)
    # The initial weights depend on the seed only, in every process.
    torch.manual_seed(config.train.seed)
    kinds = len(ViewClass) if config.losses.kind or config.losses.depth else 0  # of the auxiliary heads
    model = registry.build(
        config.network, setting, appearance=config.appearance, num_classes=kinds, parts=Parts.of(config.parts)
    )
    check_roots(config)
    if config.init is not None:
        model = load_initial_weights(model, PACKAGED if config.init == "packaged" else find_weights(config.init))
    train_data = [_packed_dataset(root, config, processes, monitor) for root in config.data.train_roots]
    if config.data.val is None:
        parts = [each.split(config.data.held_out) for each in train_data]
        train_data, val_data = [first for first, _ in parts if len(first)], [last for _, last in parts]
        if not train_data:
            roots = ", ".join(config.data.train_roots)
            raise DataError(f"{roots}: data.held_out leaves nothing to train on: no scene is longer")
    else:
        val_data = [_packed_dataset(config.data.val, config, processes, monitor)]
    check_classes(train_data, config)
    if processes.is_main:
        tell_missing_classes(train_data, config, monitor.on_message)
    batch, seed, clip = config.train.batch, config.train.seed, config.data.clip
    rank, size = processes.rank, processes.size
    train_loader = BatchLoader(train_data, batch, seed, _augmentation(config.augment), rank, size, clip)
    val_loader = BatchLoader(val_data, batch, seed, rank=rank, world_size=size, clip=clip)
    return TrainingSetup(model, train_loader, val_loader, save_weights)


def load_initial_weights(model: BEVModel, path: PathLike) -> BEVModel:
    """Load weights to train on, and return the network without their calibration: losses are of raw logits.

    Raises:
        DataError: as `load_weights_into`, or if the calibration on the model card is invalid.
    """
    classes, objects = read_calibrations(load_weights_into(model, path))
    raw = model.calibrated([each.inverse for each in classes], None if objects is None else objects.inverse)
    return model if raw is None else raw


def check_roots(config: Config) -> None:
    """Check that the datasets of a configuration exist; those of the shipped ones are examples.

    Raises:
        DataError: if one does not; the message names its key.
    """
    for key, roots in (("data.train", config.data.train_roots), ("data.val", (config.data.val,))):
        for root in roots:
            if root is not None and not path_of(root).is_dir():
                without = "" if key == "data.train" else ", or none: data.val=null data.held_out=1"
                raise DataError(f"{key}: {root}: no such folder; name a dataset of yours: {key}=ROOT{without}")


def _check_memory(batch: int, setting: ModelSpec) -> None:
    """Check that the images of a batch fit into memory, before hours of packing.

    Raises:
        DataError: if they do not.
    """
    total, _ = memory()
    sample_bytes = len(setting.channels) * setting.height_px * setting.width_px * 3 * 4
    if total is not None and batch * sample_bytes > total:
        needed = (
            f"{batch * sample_bytes / 2**30:,.0f} GiB for the images of a batch, the machine has {total / 2**30:,.0f}"
        )
        raise DataError(f"train.batch={batch}: expected at most {total // sample_bytes:,} samples ({needed})")


def check_classes(packed: Sequence[PackedDataset], config: Config) -> None:
    """Check that every class with a loss weight occurs in the training data.

    Raises:
        DataError: if a class has no cells.
    """
    missing = [number for number, weight in enumerate(config.losses.classes) if weight]
    for sample in (each.sample(number) for each in packed for number in range(len(each))):
        occupied = sample.occupancy & sample.known
        missing = [k for k in missing if not (occupied >> k & 1).any()]
        if not missing:
            return
    names, roots = ", ".join(CLASSES[k] for k in missing), ", ".join(config.data.train_roots)
    raise DataError(
        f"{roots}: expected cells of every class in bev/{config.data.source}, got none of {names} in "
        f"{sum(map(len, packed))} samples; a weight of 0 in losses.classes ignores a class"
    )


def tell_missing_classes(packed: Sequence[PackedDataset], config: Config, on_message: Callable[[str], None]) -> None:
    """Tell in a message if `losses.kind` asks for pixel classes and no training image has any."""
    samples = (each.sample(number) for each in packed for number in range(len(each)))
    if config.losses.kind and not any((sample.kind[sample.alive] != UNKNOWN_KIND).any() for sample in samples):
        roots = ", ".join(config.data.train_roots)
        on_message(f"losses.kind: no training image of {roots} has pixel classes (views/): it teaches nothing")


def _packed_dataset(root: str, config: Config, processes: ProcessGroup, monitor: TrainingMonitor) -> PackedDataset:
    """Open the packed dataset of a root; the main process packs it first if needed."""
    place = path_of(root).resolve()
    key = f"{place} {config.data.source}".encode()
    name = f"{place.name}-{config.setting}-{hashlib.sha256(key).hexdigest()[:8]}"
    packs = path_of(config.data.packs)
    if isinstance(packs, RemotePath):
        raise DataError(f"data.packs: expected a folder on this machine, which is mapped into memory, got {packs}")
    out = packs / name
    if not processes.is_main:
        distributed.barrier()
        return PackedDataset.open(out)

    def advance(done: int, total: int) -> None:
        monitor.on_step(done / total, f"packing {root}: {done} of {total} samples")

    workers = max(1, config.data.workers)
    try:
        return pack_dataset(
            root=root,
            source=config.data.source,
            setting=MODEL_SPECS[config.setting],
            out=out,
            advance=advance,
            on_message=monitor.on_message,
            workers=workers,
        )
    finally:
        if processes.size > 1:
            distributed.barrier()


def _augmentation(config: AugmentConfig) -> Augmentation:
    """Convert the configured augmentation from degrees to radians."""
    return Augmentation(
        yaw_rad=math.radians(config.yaw_deg),
        shift_m=config.shift_m,
        mirror=config.mirror,
        brightness=config.brightness,
        contrast=config.contrast,
        saturation=config.saturation,
        camera_style=config.camera_style,
        cameras_dropped=config.cameras_dropped,
        extrinsic_rad=math.radians(config.extrinsic_deg),
        extrinsic_m=config.extrinsic_m,
    )
