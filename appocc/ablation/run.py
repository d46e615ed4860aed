"""A study put together from a configuration and a test set."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch

from appocc.ablation.judging import ColouringMaker, JudgingSet, Maker
from appocc.ablation.page import page
from appocc.ablation.rows import Row, study_rows
from appocc.ablation.study import Outcome, Study
from appocc.ablation.tables import study_json
from appocc.errors import DataError
from appocc.files import write_bytes, write_json
from appocc.inference.loading import load_predictor
from appocc.models.model_spec import MODEL_SPECS
from appocc.models.registry import COLOURINGS
from appocc.nuscenes.dataset import Dataset
from appocc.nuscenes.records import Scene
from appocc.training.config import Config
from appocc.training.session import run_training

JSON, PAGE = "ablation.json", "ablation.md"


def study_of(config: Config, test: Dataset, scenes: int | None, seeds: int, out: Path) -> Study:
    """The study of a configuration, judged on so many scenes of a test set (None: all).

    Raises:
        DataError: if data are not there, the test set has no truth, or `out` holds another study.
    """
    if config.init is not None:
        raise DataError(f"ablate: expected init null, got {config.init!r}; all rows begin with nothing learnt")
    for root in (config.data.train, config.data.val):
        if root is not None and not Path(root).is_dir():
            raise DataError(f"{root}: no such folder")
    if config.train.threads is not None:
        torch.set_num_threads(config.train.threads)  # for rows that are only judged

    def maker_of(row: Row, weights: Path | None) -> Maker:
        if weights is None:
            return ColouringMaker(COLOURINGS[row.network], MODEL_SPECS[row.setting])
        return load_predictor(weights, torch.device("cpu") if config.train.device == "cpu" else None)

    judged = JudgingSet(test, drawn_scenes(test.scenes, scenes), config.data.source)
    rows = study_rows(config.train.seed, seeds)
    study = Study(config, rows, judged, out, run_training, maker_of, write)
    study.check()
    return study


def drawn_scenes(scenes: Sequence[Scene], most: int | None) -> tuple[Scene, ...]:
    """So many scenes in their order, always the same ones; drawn, since towns and weathers may come in turn."""
    if most is None or most >= len(scenes):
        return tuple(scenes)
    return tuple(scenes[i] for i in sorted(np.random.default_rng(0).permutation(len(scenes))[:most].tolist()))


def write(study: Study, outcomes: Sequence[Outcome]) -> None:
    """Write the tables, for machines and for people.

    Raises:
        DataError: if they cannot be written.
    """
    write_json(study.out / JSON, study_values(study, outcomes))
    text = page(study.base, study.test.as_json(), outcomes)
    write_bytes(study.out / PAGE, text.encode())


def study_values(study: Study, outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """What `ablation.json` says."""
    return study_json(study.base, study.test.as_json(), outcomes)
