"""Pixel classes without depth, of some pictures only, as imported from Waymo: they are packed and teach."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from made_packed import GRID, made_map
from made_training import made_config
from waymo_street import LABELLED
from waymo_twin import Records

from appocc.bevmap import bev_path
from appocc.importers import import_logs
from appocc.importers.waymo import find_logs
from appocc.models.model_spec import ModelSpec
from appocc.models.registry import build
from appocc.models.weights import save_weights
from appocc.nuscenes import Dataset
from appocc.nuscenes.view_targets import UNKNOWN_KIND, ViewClass
from appocc.training.batches.augment import Augmentation
from appocc.training.batches.batch_loader import BatchLoader
from appocc.training.batches.packed_dataset import PackedDataset, pack_dataset
from appocc.training.batches.prefetcher import unit_colours
from appocc.training.loop import train
from appocc.training.losses import compute_losses
from appocc.training.process_group import join_process_group
from appocc.training.run import TrainingMonitor, TrainingSetup
from appocc.training.run_folder import RunFolder
from appocc.training.session import tell_missing_classes

CHANNELS = {1: "CAM_FRONT", 4: "CAM_SIDE_LEFT", 5: "CAM_SIDE_RIGHT"}
FRAMES = 3


@pytest.fixture(scope="module")
def packed(tmp_path_factory: pytest.TempPathFactory) -> PackedDataset:
    """Three key frames of Waymo: all pictures of the first are labelled, one of the second, none of the third."""
    folder: Path = tmp_path_factory.mktemp("classes")
    Records().write(folder / "src", FRAMES)
    import_logs(find_logs(folder / "src", 10.0), folder / "waymo", "waymo", {})
    dataset = Dataset(folder / "waymo")
    for number, sample in enumerate(dataset.samples(dataset.scenes[0])):
        made_map(number).save(bev_path(dataset.root, "exact", sample.token))
    setting = ModelSpec("tiny", tuple(CHANNELS.values()), GRID, 64, 32)
    return pack_dataset(dataset.root, "exact", setting, folder / "pack")


def test_packs_hold_the_classes_and_the_depth_of_the_lidar(packed: PackedDataset) -> None:
    for frame in range(FRAMES):
        sample = packed.sample(frame)
        for camera, channel in CHANNELS.items():
            kind, depth = (array[sample.channels.index(channel)] for array in (sample.kind, sample.depth_m))
            assert (kind != UNKNOWN_KIND).any() == ((frame, camera) in LABELLED)
            assert depth.any()
            assert np.isfinite(depth).all()
    front = packed.sample(0).kind[packed.channels.index("CAM_FRONT")]
    assert (front[0] == ViewClass.SKY).all()
    assert (front[1:] == ViewClass.ROAD).all()


def test_classes_alone_teach_and_frames_without_them_do_not(packed: PackedDataset) -> None:
    torch.manual_seed(0)
    model, losses = build("appocc", packed.setting, num_classes=len(ViewClass)), made_config().losses
    grads = []
    for batch in BatchLoader([packed], 1, 0).in_order(threads=0):
        model.zero_grad()
        truth = batch.truth._replace(depth_m=torch.zeros_like(batch.truth.depth_m))
        terms = compute_losses(model(unit_colours(batch.images), model.plan(batch.rigs)), truth, losses, GRID)
        assert terms.kind is not None
        torch.autograd.backward(terms.total(losses))
        grad = model.get_parameter("views.kind.weight").grad
        assert grad is not None
        grads.append((float(terms.kind.detach()), bool(grad.any())))
    assert [(loss > 0, moved) for loss, moved in grads] == [(True, True), (True, True), (False, False)]


def test_a_training_uses_them(packed: PackedDataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("appocc.training.loop.plot_curves", lambda lines, path: None)
    torch.manual_seed(0)
    model = build("appocc", packed.setting, num_classes=len(ViewClass))
    before = model.get_parameter("views.kind.bias").detach().clone()
    changes = Augmentation(yaw_rad=0.3, mirror=0.5)
    setup = TrainingSetup(
        model, BatchLoader([packed], FRAMES, 0, changes), BatchLoader([packed], FRAMES, 0), save_weights
    )
    config = made_config(train__steps=1, train__batch=FRAMES, evaluate__norm_batches=1)
    with join_process_group("cpu") as processes:
        train(setup, config, RunFolder(tmp_path / "run"), processes, TrainingMonitor(), resume=False)
    (line,) = (line for line in RunFolder(tmp_path / "run").read_metrics() if line["kind"] == "train")
    assert line["step"] == 1
    assert not torch.equal(model.get_parameter("views.kind.bias").detach(), before)


def test_a_training_that_finds_no_classes_says_so(packed: PackedDataset) -> None:
    said: list[str] = []
    config, none = made_config(), made_config(losses__kind=0.0)
    tell_missing_classes([packed.subset([2]), packed.subset([1, 2])], config, said.append)
    tell_missing_classes([packed.subset([2])], none, said.append)
    assert said == []
    tell_missing_classes([packed.subset([2])], config, said.append)
    assert said == ["losses.kind: no training image of none has pixel classes (views/): it teaches nothing"]
