"""A study of networks that train in a moment, evaluated on the tiny dataset; predictions depend on the weights."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from safetensors.numpy import load_file
from tiny_dataset import TinyDataset, token

from appocc.ablation.row_evaluation import EvaluationSet, MapPredictor
from appocc.ablation.rows import BOTH, COLOUR, OCCUPANCY, StudyRow
from appocc.ablation.run import write_results
from appocc.ablation.study import Study, Train
from appocc.bevmap import BEVMap, bev_path
from appocc.frame import Frame
from appocc.grid import BEVGrid
from appocc.inference.predictor import Prediction
from appocc.nuscenes.dataset import Dataset
from appocc.training.config import Config, read_config
from appocc.training.loop import train
from appocc.training.process_group import join_process_group
from appocc.training.run import TrainingMonitor
from appocc.training.run_folder import RunFolder

sys.path.append(str(Path(__file__).parents[1] / "training"))
from made_training import made_config as made_config
from made_training import made_setup

GRIDS = {"360": BEVGrid(-8.0, 8.0, -8.0, 8.0, 0.4), "180": BEVGrid(0.0, 8.0, -8.0, 8.0, 0.4)}
THRESHOLDS = {"road": 0.4, "vehicle": 0.6, "lane": 0.5}
ROWS = (
    StudyRow("appocc", "360", OCCUPANCY, 0),
    StudyRow("appocc", "360", BOTH, 0),
    StudyRow("ipm", "360", COLOUR, None),
    StudyRow("appocc", "180", BOTH, 0),
    StudyRow("appocc", "360", OCCUPANCY, 1),
)


def with_truth(tiny: TinyDataset, grid: BEVGrid = GRIDS["360"]) -> Path:
    """The tiny dataset with exact maps; its root."""
    for i in range(3):
        rng = np.random.default_rng(i)
        known = np.ones((3, *grid.shape), np.bool_)
        on = (rng.random((3, *grid.shape)) < 0.4).astype(np.float32)
        colours = rng.integers(0, 256, (3, *grid.shape)).astype(np.uint8)
        BEVMap(grid, on, known, colours, known[0].copy()).save(bev_path(tiny.root, "exact", token("sample", i)))
    return tiny.root


class MadePredictor:
    """Predicts random maps seeded by the weights."""

    def __init__(self, row: StudyRow, weights: Path | None) -> None:
        tensors = load_file(weights) if weights else {}
        total = sum(float(np.abs(each).sum()) for each in tensors.values())
        self.row, self.seed = row, int(total * 1e6)
        self.asked: list[str] = []

    def __call__(self, frame: Frame) -> Prediction:
        self.asked.append(frame.token)
        row, grid = self.row, GRIDS[self.row.setting]
        rng = np.random.default_rng([self.seed, frame.timestamp_us])
        occupancy = rng.random((3, *grid.shape)).astype(np.float32)
        colours = rng.integers(0, 256, (3, *grid.shape)).astype(np.uint8)
        known = np.full((3, *grid.shape), row.outputs != COLOUR)
        coloured = np.full(grid.shape, row.outputs != OCCUPANCY)
        meta = {"thresholds": THRESHOLDS} if row.learns else {}
        return Prediction(
            BEVMap(grid, occupancy * known, known, colours, coloured, meta), np.ones(grid.shape, np.bool_)
        )


def made_predictor(weights: Path, device: torch.device | None) -> MapPredictor:
    """Replaces `load_predictor`; the row follows from the run folder."""
    config = read_config(weights.parent / "config.yaml")
    row = StudyRow(config.network, config.setting, BOTH if config.appearance else OCCUPANCY, config.train.seed)
    return MadePredictor(row, weights)


def tiny_train(config: Config, folder: RunFolder, resume: bool, monitor: TrainingMonitor) -> Mapping[str, Any]:
    """Replaces `run_training`, with the tiny network and samples of the loop's tests."""
    with join_process_group("cpu") as processes:
        progress = train(made_setup(config, processes), config, folder, processes, monitor, resume)
    return folder.summary(progress)


def made_study(
    root: Path,
    out: Path,
    rows: Sequence[StudyRow] = ROWS,
    train_row: Train = tiny_train,
    predictor_of: Callable[[StudyRow, Path | None], MapPredictor] = MadePredictor,
    **config: Any,
) -> Study:
    dataset = Dataset(root)
    test = EvaluationSet(dataset, dataset.scenes, "exact")
    return Study(
        base=made_config(**{"train__steps": 5, **config}),
        rows=rows,
        test=test,
        out=out,
        train=train_row,
        predictor_of=predictor_of,
        write=write_results,
    )
