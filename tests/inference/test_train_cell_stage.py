"""Training of the second stage of cells: examples of rendered frames, augmentation, and a network that learns."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import load_file

from appocc.bevmap import LANE, ROAD, VEHICLE
from appocc.grid import BEVGrid
from appocc.inference.second_stage.cell_network import CELL_PARTS, PARTS, CellNetwork
from appocc.inference.second_stage.cell_refiner import cell_distances
from benchmarks.second_stage.cell_examples import CellExamples, read_cell_examples
from benchmarks.second_stage.cell_training import cell_loss, make_batch, train_cells
from benchmarks.second_stage.examples import Source
from benchmarks.train_cell_stage import main

TRAINING = "benchmarks.second_stage.cell_training"
GRID = BEVGrid(-6.4, 6.4, -6.4, 6.4, 0.4)
DISTANCE = cell_distances(GRID)


def made_examples(count: int = 32) -> CellExamples:
    """Maps that say nothing, of grey ground with bright lines through the middle part of cells or another."""
    rng, (x, y) = np.random.default_rng(0), GRID.shape
    rgb = rng.integers(70, 90, (count, 3, PARTS, PARTS, x, y), dtype=np.uint8)
    truth = np.zeros((count, 2, x, y), np.bool_)
    for one in range(count):
        for column in rng.choice(y, 6, replace=False):
            part = rng.integers(PARTS)
            rgb[one, :, :, part, :, column] = 200
            truth[one, 1, :, column] = part == PARTS // 2
    truth[:, 0] = True
    logits = np.full((count, 3, x, y), -2, np.float16)
    seen = np.full((count, x, y), CELL_PARTS, np.uint8)
    return CellExamples(logits, rgb.reshape(count, -1, x, y), seen, truth, np.ones_like(truth))


def change_none(monkeypatch: pytest.MonkeyPatch) -> None:
    """Turn examples only."""
    for share in ("_TONED", "_HIDDEN", "_WORN", "_DOUBTFUL"):
        monkeypatch.setattr(f"{TRAINING}.{share}", 0.0)


def test_turning_keeps_colours_and_truth_together(monkeypatch: pytest.MonkeyPatch) -> None:
    change_none(monkeypatch)
    examples, rng = made_examples(1), np.random.default_rng(1)
    batches = [make_batch(examples, np.array([0]), DISTANCE, rng) for _ in range(12)]
    for batch in batches:
        parts = batch.inputs.rgb[0].reshape(3, PARTS, PARTS, *GRID.shape)[0] * 255
        torch.testing.assert_close(parts[PARTS // 2, PARTS // 2] > 150, batch.truth[0, 1] > 0.5)
        bright = (parts > 150).float().mean((2, 3))  # share of cells that are bright in each part
        assert bright.var(0).sum() == 0 or bright.var(1).sum() == 0  # along a line all parts are bright alike
    assert any(not torch.equal(batch.truth, batches[0].truth) for batch in batches)


def test_a_hidden_sector_is_unseen_and_black(monkeypatch: pytest.MonkeyPatch) -> None:
    change_none(monkeypatch)
    monkeypatch.setattr(f"{TRAINING}._HIDDEN", 1.0)
    examples = made_examples(6)
    batch = make_batch(examples, np.arange(6), DISTANCE, np.random.default_rng(0))
    assert (examples.seen == CELL_PARTS).all()
    hidden = batch.inputs.seen[:, 0] == 0
    assert 0.1 < hidden.float().mean() < 0.9
    assert (batch.inputs.rgb.amax(1)[hidden] == 0).all()
    assert (batch.inputs.rgb.amax(1)[~hidden] > 0).all()


def test_worn_lines_are_fainter_and_those_that_cannot_be_seen_are_none(monkeypatch: pytest.MonkeyPatch) -> None:
    change_none(monkeypatch)
    monkeypatch.setattr(f"{TRAINING}._WORN", 1.0)
    count, column = 24, 16
    examples = made_examples(count)
    examples.truth[:, 1] = False
    examples.truth[:, 1, :, column] = True
    examples.rgb[:] = 80
    examples.rgb[..., column] = 200
    batch = make_batch(examples, np.arange(count), DISTANCE, np.random.default_rng(0))
    colour, lines = batch.inputs.rgb.mean(1) * 255, batch.truth[:, 1] > 0.5
    assert 0.3 < lines.sum() / (count * GRID.shape[0]) < 1
    assert 85 < colour[lines].min() < 100
    assert 100 < colour[lines].mean() < 199
    assert colour[~lines].max() < 90


def test_doubtful_logits_say_less_of_lanes_and_have_errors_of_the_road(monkeypatch: pytest.MonkeyPatch) -> None:
    change_none(monkeypatch)
    monkeypatch.setattr(f"{TRAINING}._DOUBTFUL", 1.0)
    examples = made_examples(6)
    examples.logits[:, LANE] = 2
    logits = make_batch(examples, np.arange(6), DISTANCE, np.random.default_rng(0)).inputs.logits
    assert (logits[:, LANE] <= 2).all()
    assert logits[:, LANE].mean() < 0
    assert logits[:, ROAD].std() > 0.2
    assert (logits[:, VEHICLE] == -2).all()


def test_unknown_cells_count_nothing() -> None:
    examples = made_examples(4)
    batch = make_batch(examples, np.arange(4), DISTANCE, np.random.default_rng(0))
    logits = torch.zeros_like(batch.truth)
    half = batch._replace(known=batch.known * 0)
    assert float(cell_loss(logits, half)) == 0
    assert float(cell_loss(logits, batch)) == pytest.approx(3 * np.log(2), rel=1e-4)


def test_a_network_learns_which_lines_pass_the_middle_and_repeats() -> None:
    examples = made_examples()
    first, second = (train_cells(examples, 8, DISTANCE, seed=1) for _ in range(2))
    for one, other in zip(first.state_dict().values(), second.state_dict().values(), strict=True):
        torch.testing.assert_close(one, other, rtol=0, atol=0)
    batch = make_batch(made_examples(8), np.arange(8), DISTANCE, np.random.default_rng(5))
    with torch.inference_mode():
        said = first(batch.inputs)[:, 1].sigmoid()
    assert said[batch.truth[:, 1] > 0.5].mean() > said[batch.truth[:, 1] < 0.5].mean() + 0.3


def test_examples_hold_what_the_network_says_and_the_truth(simulated_root: Path) -> None:
    source = Source(simulated_root, 2, 0, most=1)
    examples = read_cell_examples(source, workers=1)
    scenes = len(examples.seen) // 2
    assert scenes >= 1
    assert examples.rgb.shape[1] == 3 * CELL_PARTS
    road = examples.logits[:, 0] > 0
    assert (road == examples.truth[:, 0]).mean() > 0.8
    seen = examples.seen.astype(int)
    np.testing.assert_array_equal(seen[0], seen[1])  # a version in another style has the same cameras
    assert np.abs(examples.rgb[0].astype(int) - examples.rgb[1]).mean() > 1
    again = read_cell_examples(source, workers=2)
    for one, other in zip(examples, again, strict=True):
        np.testing.assert_array_equal(one, other)
    network = CellNetwork().eval()
    batch = make_batch(examples, np.array([0]), torch.zeros(1, 1, *seen.shape[1:]), np.random.default_rng(0))
    with torch.inference_mode():
        assert network(batch.inputs).shape == (1, 2, *seen.shape[1:])


def test_the_command_writes_weights_that_can_be_loaded(simulated_root: Path, tmp_path: Path) -> None:
    out = tmp_path / "w.safetensors"
    main([str(simulated_root), "--out", str(out), "--epochs", "0.1", "--versions", "1", "--workers", "1"])
    CellNetwork().load_state_dict(load_file(out))
    assert 200_000 < out.stat().st_size < 1_000_000
