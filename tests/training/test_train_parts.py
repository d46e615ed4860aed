"""A network with all parts trains on clips, resumes to the same numbers, and predicts with what it learnt."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch
from made_packed import SETTING, with_maps
from made_training import made_config
from safetensors import safe_open
from tiny_dataset import TinyDataset

from appocc.inference.loading import load_predictor
from appocc.models.model_spec import Parts
from appocc.models.registry import build
from appocc.models.weights import save_weights
from appocc.nuscenes import Dataset
from appocc.nuscenes.view_targets import ViewClass
from appocc.training.batches.augment import Augmentation
from appocc.training.batches.batch_loader import BatchLoader
from appocc.training.batches.packed_dataset import PackedDataset, pack_dataset
from appocc.training.batches.prefetcher import unit_colours
from appocc.training.checkpoint import list_checkpoints
from appocc.training.config import Config
from appocc.training.loop import train
from appocc.training.process_group import join_process_group
from appocc.training.run import StoppedError, TrainingMonitor, TrainingSetup
from appocc.training.run_folder import RunFolder

PARTS = ("depth", "memory", "objects")
ALL = Parts.of(PARTS)
CHANGES = Augmentation(yaw_rad=0.3, shift_m=1.0, mirror=0.5, brightness=0.2)
TIMES = ("seconds", "wait_share", "plan_share", "samples_per_s", "evaluation_s")


@pytest.fixture(autouse=True, scope="module")
def no_pictures() -> Iterator[None]:
    """Curves take longer than these trainings, and are drawn elsewhere."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("appocc.training.loop.plot_curves", lambda lines, path: None)
        yield


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> PackedDataset:
    folder: Path = tmp_path_factory.mktemp("parts")
    return pack_dataset(with_maps(TinyDataset(folder / "tiny")), "exact", SETTING, folder / "pack")


def config(clip: int = 2) -> Config:
    """Four steps with all parts; memory is trained in clips alone."""
    return made_config(
        data={"train": "none", "val": "none", "clip": clip},
        train__steps=4,
        train__batch=2 * clip,
        train__lr=2e-3,
        evaluate__every_steps=3,
        evaluate__norm_batches=1,
        save__every_steps=2,
        parts=[name for name in PARTS if clip > 1 or name != "memory"],
    )


def run(
    drive: PackedDataset, folder: Path, settings: Config, monitor: TrainingMonitor | None = None, resume: bool = False
) -> None:
    torch.manual_seed(settings.train.seed)
    model = build("appocc", drive.setting, num_classes=len(ViewClass), parts=Parts.of(settings.parts))
    batch, clip = settings.train.batch, settings.data.clip
    both = replace(drive.subset([0, 1, 2, 0, 1]), scenes=("a", "a", "a", "b", "b"))
    loaders = BatchLoader([both], batch, 0, CHANGES, clip=clip), BatchLoader([drive], batch, 0, clip=clip)
    setup = TrainingSetup(model, *loaders, save_weights)
    with join_process_group("cpu") as processes:
        train(setup, settings, RunFolder(folder), processes, monitor or TrainingMonitor(), resume)


def result(folder: Path) -> dict[str, str]:
    """Digests of all tensors of the latest state, and of the file of the best weights."""
    found = {"best": hashlib.sha256((folder / "best.safetensors").read_bytes()).hexdigest()}
    with safe_open(list_checkpoints(folder)[0], framework="pt") as file:
        for name in file.keys():  # noqa: SIM118
            found[name] = hashlib.sha256(file.get_tensor(name).numpy().tobytes()).hexdigest()
    return found


def numbers(folder: Path) -> list[dict[str, Any]]:
    """Lines of metrics without what a clock says."""
    return [{k: v for k, v in line.items() if k not in TIMES} for line in RunFolder(folder).read_metrics()]


def stop_after(step: int) -> TrainingMonitor:
    monitor = TrainingMonitor()

    def on_step(share: float, text: str) -> None:
        monitor.stop_requested = monitor.stop_requested or text.startswith(f"step {step},")

    monitor.on_step = on_step
    return monitor


@pytest.fixture(scope="module", params=[1, 3], ids=["samples", "clips"])
def uninterrupted(
    request: pytest.FixtureRequest, drive: PackedDataset, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Config, Path]:
    settings, folder = config(request.param), tmp_path_factory.mktemp("whole") / "run"
    run(drive, folder, settings)
    return settings, folder


def test_interrupted_is_as_uninterrupted(
    drive: PackedDataset, tmp_path: Path, uninterrupted: tuple[Config, Path]
) -> None:
    settings, whole = uninterrupted
    with pytest.raises(StoppedError):
        run(drive, tmp_path / "run", settings, stop_after(3))
    run(drive, tmp_path / "run", settings, resume=True)
    assert numbers(tmp_path / "run") == numbers(whole)
    assert result(tmp_path / "run") == result(whole)
    assert {"depth", "centre", "box", "paint"} < numbers(whole)[1]["losses"].keys()


def test_what_was_trained_predicts_a_drive(drive: PackedDataset, uninterrupted: tuple[Config, Path]) -> None:
    settings, folder = uninterrupted
    answer = load_predictor(folder / "best.safetensors", torch.device("cpu"))
    assert answer.model.parts == Parts.of(settings.parts)
    dataset = Dataset(drive.folder.parent / "tiny")
    for sample in dataset.samples(dataset.scenes[0]):
        bev, _ = answer(dataset.frame(sample))
        assert bev.grid == SETTING.grid
        assert bev.objects is not None


def test_memory_learns_from_clips_alone(drive: PackedDataset) -> None:
    """Weights of the memory's channels have a gradient in clips, and none in single samples."""
    model = build("appocc", drive.setting, parts=ALL).train()
    with torch.no_grad():
        model.get_parameter("trunk.recall.fused.weight").normal_(std=0.1)
    for clip, learns in ((1, False), (3, True)):
        batch = BatchLoader([drive], 3, 0, clip=clip).batch(0)
        model.zero_grad()
        output = model(unit_colours(batch.images), model.plan(batch.rigs), batch.past)
        torch.autograd.backward(output.occupancy.square().sum())
        weight = model.get_parameter("trunk.recall.mixed.0.weight")
        assert weight.grad is not None
        assert bool(weight.grad[:, :33].any()) == learns
