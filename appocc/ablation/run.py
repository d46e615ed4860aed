"""Build an ablation study from a configuration and a test set; write its results."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch

from appocc.ablation.report import render_report
from appocc.ablation.row_evaluation import ColouringPredictor, EvaluationSet, MapPredictor
from appocc.ablation.rows import StudyRow, study_rows
from appocc.ablation.study import RowOutcome, Study
from appocc.ablation.tables import study_json
from appocc.errors import DataError
from appocc.files import write_bytes, write_json
from appocc.inference.loading import load_predictor
from appocc.models.model_spec import MODEL_SPECS
from appocc.models.registry import COLOURINGS
from appocc.nuscenes.dataset import Dataset
from appocc.nuscenes.records import Scene
from appocc.training.config import Config
from appocc.training.session import check_roots, run_training

RESULTS_FILE, REPORT_FILE = "ablation.json", "ablation.md"


def build_study(config: Config, test: Dataset, scenes: int | None, seeds: int, out: Path) -> Study:
    """Build the study of a configuration, evaluated on a number of scenes of a test set (None: all).

    Raises:
        DataError: if data are missing, the test set has no true maps, or `out` has another study.
    """
    if config.init is not None:
        raise DataError(f"ablate: expected init null, got {config.init!r}; all rows are trained from scratch")
    check_roots(config)
    if config.train.threads is not None:
        torch.set_num_threads(config.train.threads)  # for rows without training

    def predictor_of(row: StudyRow, weights: Path | None) -> MapPredictor:
        if weights is None:
            return ColouringPredictor(COLOURINGS[row.network], MODEL_SPECS[row.setting])
        return load_predictor(weights, torch.device("cpu") if config.train.device == "cpu" else None)

    evaluation_set = EvaluationSet(test, draw_scenes(test.scenes, scenes), config.data.source)
    rows = study_rows(config.train.seed, seeds)
    study = Study(
        base=config,
        rows=rows,
        test=evaluation_set,
        out=out,
        train=run_training,
        predictor_of=predictor_of,
        write=write_results,
    )
    study.check()
    return study


def draw_scenes(scenes: Sequence[Scene], count: int | None) -> tuple[Scene, ...]:
    """Select scenes at random with a fixed seed, in their order: towns and weathers may alternate."""
    if count is None or count >= len(scenes):
        return tuple(scenes)
    return tuple(scenes[i] for i in sorted(np.random.default_rng(0).permutation(len(scenes))[:count].tolist()))


def write_results(study: Study, outcomes: Sequence[RowOutcome]) -> None:
    """Write the tables as JSON and as Markdown.

    Raises:
        DataError: if they cannot be written.
    """
    write_json(study.out / RESULTS_FILE, study_results(study, outcomes))
    text = render_report(study.base, study.test.as_json(), outcomes)
    write_bytes(study.out / REPORT_FILE, text.encode())


def study_results(study: Study, outcomes: Sequence[RowOutcome]) -> dict[str, Any]:
    """Return the content of `ablation.json`."""
    return study_json(study.base, study.test.as_json(), outcomes)
