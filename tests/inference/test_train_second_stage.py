"""Training of the second stage: examples from rendered frames, augmentation, and a loss that falls."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch

from appocc.geometry import wrap_angle
from appocc.inference.second_stage.network import CropNetwork
from appocc.training.batches.packed_objects import KIND, RGB, XY, YAW
from benchmarks.second_stage.augment import augmented
from benchmarks.second_stage.examples import Examples, Source, read_examples
from benchmarks.second_stage.training import loss_of, train, truth_of
from benchmarks.train_second_stage import main


@pytest.fixture(scope="module")
def examples(simulated_root: Path) -> Examples:
    return read_examples(Source(simulated_root, 2, 0), workers=1)


def test_examples_are_of_vehicles_and_of_false_ones(examples: Examples) -> None:
    number = len(examples.score)
    found = np.isfinite(examples.truth[:, KIND])
    assert number > 40
    assert 0.2 < found.mean() < 0.98
    near = np.hypot(*(examples.truth[:, XY] - examples.centre_m[:, :2])[found].T)
    assert np.median(near) < 1.0
    bearing = np.arctan2(examples.centre_m[:, 1], examples.centre_m[:, 0])
    assert (np.cos(examples.yaw_rad - bearing) > -1e-9).all()
    truth = truth_of(examples)
    assert truth.found.numpy().tolist() == found.tolist()
    fronts = np.abs(truth.turn_rad.numpy()[found])
    assert (np.minimum(fronts, np.pi - fronts) < 0.3).mean() > 0.5  # along the axis, either way


def test_the_same_seed_gives_the_same_examples_with_any_number_of_workers(
    examples: Examples, simulated_root: Path
) -> None:
    again = read_examples(Source(simulated_root, 2, 0), workers=2)
    for one, other in zip(examples, again, strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_mirror_changes_all_that_it_should(examples: Examples, monkeypatch: pytest.MonkeyPatch) -> None:
    for share in ("_TONED", "_RECOLOURED", "_MOVED", "_ERASED", "_UNTOLD"):
        monkeypatch.setattr(f"benchmarks.second_stage.augment.{share}", 0.0)
    monkeypatch.setattr("benchmarks.second_stage.augment._MIRRORED", 1.0)
    mirrored = augmented(examples, np.random.default_rng(0))
    before, after = truth_of(examples), truth_of(mirrored)
    found = before.found
    np.testing.assert_allclose(
        wrap_angle(after.turn_rad[found].double().numpy() + before.turn_rad[found].double().numpy()), 0, atol=1e-5
    )
    np.testing.assert_array_equal(mirrored.place[..., 1], -examples.place[:, :, ::-1, 1])
    np.testing.assert_array_equal(mirrored.place[..., 0], examples.place[:, :, ::-1, 0])
    inputs, other = examples.inputs(), mirrored.inputs()
    np.testing.assert_allclose(other.pixels[:, :3].numpy(), inputs.pixels[:, :3].flip(-1).numpy())
    signs = np.ones(inputs.numbers.shape[1])
    signs[5] = -1  # the sine of the angle to the line of sight
    np.testing.assert_allclose(other.numbers.numpy(), inputs.numbers.numpy() * signs, atol=1e-5)
    np.testing.assert_allclose(other.body_lab.numpy(), inputs.body_lab.numpy(), atol=1e-3)


def test_a_tone_changes_image_and_paint_alike(examples: Examples, monkeypatch: pytest.MonkeyPatch) -> None:
    for share in ("_MIRRORED", "_RECOLOURED", "_MOVED", "_ERASED", "_UNTOLD"):
        monkeypatch.setattr(f"benchmarks.second_stage.augment.{share}", 0.0)
    monkeypatch.setattr("benchmarks.second_stage.augment._TONED", 1.0)
    toned = augmented(examples, np.random.default_rng(0))
    known = np.flatnonzero(np.isfinite(examples.truth[:, RGB]).all(axis=1))
    before, after = (one.inputs().body_lab.numpy()[known, 0] for one in (examples, toned))
    paint_before, paint_after = (truth_of(one).lab.numpy()[known, 0] for one in (examples, toned))
    assert np.corrcoef(after - before, paint_after - paint_before)[0, 1] > 0.6
    np.testing.assert_array_equal(toned.truth[:, YAW], examples.truth[:, YAW])


def test_training_lowers_the_loss_and_repeats(examples: Examples) -> None:
    torch.manual_seed(0)
    examples = examples.select(np.arange(192))
    first, second = train(examples, 10, seed=1), train(examples, 10, seed=1)
    for one, other in zip(first.state_dict().values(), second.state_dict().values(), strict=True):
        torch.testing.assert_close(one, other, rtol=0, atol=0)
    real = examples.select(np.arange(20))
    further = train(examples, 0.5, 1, real, first)
    assert not torch.equal(further.answer.weight, first.answer.weight)
    assert torch.allclose(further.answer.weight, first.answer.weight, atol=0.1)
    untrained = CropNetwork().eval()
    with torch.inference_mode():
        losses = [float(loss_of(network(examples.inputs()), truth_of(examples))) for network in (untrained, first)]
    assert losses[1] < 0.9 * losses[0]


def test_the_command_writes_weights_that_can_be_loaded(simulated_root: Path, tmp_path: Path) -> None:
    out = tmp_path / "w.safetensors"
    main([str(simulated_root), "--out", str(out), "--epochs", "0.5", "--versions", "1", "--workers", "1"])
    from safetensors.torch import load_file

    CropNetwork().load_state_dict(load_file(out))
    assert 200_000 < out.stat().st_size < 1_000_000
