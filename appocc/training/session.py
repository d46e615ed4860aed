"""From a configuration to a training: packs, networks and loaders put together, in one place."""

from __future__ import annotations

import hashlib
import math
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import torch
from torch import distributed

from appocc.bevmap import CLASSES
from appocc.environment import memory
from appocc.errors import DataError
from appocc.models import registry
from appocc.models.model_spec import SETTINGS, Setting
from appocc.models.weights import PACKAGED, begin_with, save_weights
from appocc.nuscenes.view_targets import ViewClass
from appocc.training.augment import Augmentation
from appocc.training.config import AugmentConfig, Config
from appocc.training.loop import train
from appocc.training.packed_dataset import Pack, pack
from appocc.training.process_group import World, joined
from appocc.training.run import Parts, Watcher
from appocc.training.run_folder import RunFolder
from appocc.training.samples import Loader
from appocc.training.summary_writer import summary_writer


def run_training(config: Config, folder: RunFolder, resume: bool, watcher: Watcher) -> dict[str, Any]:
    """Train as a configuration says, in a run's folder; what came of it, as JSON values.

    Raises:
        AppoccError: as `train`; if data are missing or damaged, or nothing could be learnt from them.
    """
    folder.check(config, resume)
    if config.save.tensorboard:
        summary_writer()  # tells before hours of work that it is not installed
    with joined(config.train.device) as world, folder.held() if world.first else nullcontext():
        progress = train(prepared(config, world, watcher), config, folder, world, watcher, resume)
    return folder.summary(progress)


def prepared(config: Config, world: World, watcher: Watcher) -> Parts:
    """The parts of a training.

    Raises:
        AppoccError: if data are missing or damaged, lack a class, or the network is unknown.
    """
    setting = SETTINGS[config.setting]
    _check_memory(config.train.batch, setting)
    # Its first weights are the same in each process and for each seed, whatever was drawn before.
    torch.manual_seed(config.train.seed)
    kinds = len(ViewClass) if config.losses.kind or config.losses.depth else 0
    model = registry.build(config.network, setting, appearance=config.appearance, kinds=kinds)
    if config.init is not None:
        begin_with(model, PACKAGED if config.init == "packaged" else Path(config.init))
    train_pack = _packed(config.data.train, config, world, watcher)
    if config.data.val is None:
        train_pack, val_pack = train_pack.split(config.data.held_out)
        if not len(train_pack):
            raise DataError(f"{config.data.train}: data.held_out leaves nothing to train on, no scene is that long")
    else:
        val_pack = _packed(config.data.val, config, world, watcher)
    check_labels(train_pack, config)
    batch, seed = config.train.batch, config.train.seed
    changed = Loader([train_pack], batch, seed, _augmentation(config.augment), world.rank, world.size)
    return Parts(model, changed, Loader([val_pack], batch, seed, rank=world.rank, world=world.size), save_weights)


def _check_memory(batch: int, setting: Setting) -> None:
    """Check that the pictures of a batch alone fit into the machine's memory, before hours of packing.

    Raises:
        DataError: if they do not.
    """
    total, _ = memory()
    pictures = len(setting.channels) * setting.height_px * setting.width_px * 3 * 4  # bytes of a sample
    if total is not None and batch * pictures > total:
        needed = (
            f"{batch * pictures / 2**30:,.0f} GiB for the pictures of a batch, the machine has {total / 2**30:,.0f}"
        )
        raise DataError(f"train.batch={batch}: expected at most {total // pictures:,} samples ({needed})")


def check_labels(packed: Pack, config: Config) -> None:
    """Check that every class that counts is somewhere in the training set.

    Raises:
        DataError: if one has not a single cell.
    """
    missing = [number for number, weight in enumerate(config.losses.classes) if weight]
    for number in range(len(packed)):
        sample = packed.sample(number)
        there = sample.occupancy & sample.known
        missing = [k for k in missing if not (there >> k & 1).any()]
        if not missing:
            return
    names = ", ".join(CLASSES[k] for k in missing)
    raise DataError(
        f"{config.data.train}: expected cells of every class in bev/{config.data.source}, got none of {names} in "
        f"{len(packed)} samples; a weight of 0 in losses.classes leaves a class out"
    )


def _packed(root: str, config: Config, world: World, watcher: Watcher) -> Pack:
    """The pack of a dataset, made by the first process if it is not there."""
    told = f"{Path(root).resolve()} {config.data.source}".encode()
    name = f"{Path(root).resolve().name}-{config.setting}-{hashlib.sha256(told).hexdigest()[:8]}"
    out = Path(config.data.packs) / name
    if not world.first:
        distributed.barrier()
        return Pack.open(out)
    packed = 0.0

    def advance(done: float) -> None:
        nonlocal packed
        packed += done
        watcher.step(0.0, f"packing {root}: {packed:.0f} samples")

    workers = max(1, config.data.workers)
    try:
        return pack(root, config.data.source, SETTINGS[config.setting], out, advance, watcher.say, workers)
    finally:
        if world.size > 1:
            distributed.barrier()


def _augmentation(config: AugmentConfig) -> Augmentation:
    """Degrees are for people."""
    return Augmentation(
        yaw_rad=math.radians(config.yaw_deg),
        shift_m=config.shift_m,
        mirror=config.mirror,
        brightness=config.brightness,
        contrast=config.contrast,
        saturation=config.saturation,
        cameras_dropped=config.cameras_dropped,
        extrinsic_rad=math.radians(config.extrinsic_deg),
        extrinsic_m=config.extrinsic_m,
    )
