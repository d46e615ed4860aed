"""Predictions of single frames compared with their true maps, as several benchmarks need them."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from appocc.bevmap import bev_folder, load_map
from appocc.errors import DataError
from appocc.evaluation.cells import CellCounts, cell_group_masks, count_cells, threshold_rows
from appocc.frame import Frame
from appocc.inference.inputs import InferenceInput
from appocc.inference.predictor import Prediction, Predictor


class ComparedPrediction(NamedTuple):
    """A prediction and its cell counts at the thresholds of the map, (1, G, 3, 2)."""

    prediction: Prediction
    counts: CellCounts


def parse_options(
    doc: str | None, arguments: Sequence[str] | None, frames: int
) -> tuple[argparse.ArgumentParser, argparse.Namespace]:
    """Return parser and options of a benchmark of predicted maps, with its default number of frames."""
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("root", type=Path)
    parser.add_argument("--weights", type=Path, help="weights file; default: the shipped weights")
    parser.add_argument(
        "--frames", type=int, default=frames, help=f"number of frames, spread evenly over ROOT ({frames})"
    )
    parser.add_argument("--against", help="source of the truth; default: exact if ROOT has it, else groundtruth")
    parser.add_argument("--json", action="store_true", help="print JSON; shares are 0..1")
    options = parser.parse_args(arguments)
    if options.frames < 1:
        parser.error(f"--frames: expected 1 or more, got {options.frames}")
    return parser, options


def evenly(inputs: Sequence[InferenceInput], most: int) -> list[InferenceInput]:
    """Return at most this many inputs, spread evenly over a recording."""
    places = np.linspace(0, len(inputs) - 1, min(most, len(inputs))).round().astype(int)
    return [inputs[place] for place in places.tolist()]


def truth_source(root: Path, against: str | None) -> str:
    """Return the source of the truth: `against`, or else `exact` if the dataset has it, or else `groundtruth`."""
    return against or ("exact" if bev_folder(root, "exact").is_dir() else "groundtruth")


def compare(predictor: Predictor, frame: Frame, root: Path, against: str) -> ComparedPrediction:
    """Predict a frame and compare it with its true map.

    Raises:
        DataError: if the true map is missing or on another grid.
    """
    grid, truth = predictor.model.spec.grid, load_map(root, against, frame.token)
    if truth.grid != grid:
        raise DataError(
            f"{root}: expected truth on the grid of the weights, {grid.as_array().tolist()}, "
            f"got {truth.grid.as_array().tolist()}"
        )
    predictor.reset()
    found = predictor(frame)
    masks = cell_group_masks(grid, np.ones(grid.shape, np.bool_), found.seen)
    return ComparedPrediction(found, count_cells(found.bev, truth, masks, threshold_rows(found.bev.thresholds)[-1:]))
