"""Robustness to camera failures: IoU with 6, 5, 4 and 3 working cameras.

    OMP_NUM_THREADS=2 python -m benchmarks.missing_cameras ROOT --weights F [--frames 32] [--against exact] [--json]

A failed camera is left out of the rig, as in `appocc infer`, without a substitute. All subsets of cameras are
evaluated on the same frames, spread evenly over ROOT: all six subsets of five cameras, and six random ones of four
and of three, the same in every run. IoU is at the thresholds of the weights, over all cells of the grid and over
those that a working camera sees by the geometry of the rig; a row is the mean over its subsets, with the worst in
brackets.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from appocc.bevmap import CLASSES, load_map
from appocc.checks import FloatArray
from appocc.errors import AppoccError, DataError
from appocc.evaluation.cells import GROUPS, CellCounts, cell_group_masks, count_cells, ious
from appocc.inference.inputs import InferenceInput, dataset_inputs
from appocc.inference.loading import load_predictor
from appocc.inference.predictor import Predictor, select_cameras
from appocc.nuscenes.dataset import Dataset

MOST_CHOICES, MOST_DEAD, SEED = 6, 3, 0
OVER = ("all", "seen")


class Score(NamedTuple):
    """Scores of one subset of working cameras.

    Attributes:
        alive: channels of the working cameras.
        iou: of each class, over each of `OVER`.
        seen: share of the cells that a working camera sees.
    """

    alive: tuple[str, ...]
    iou: dict[str, dict[str, float]]
    seen: float


def choices(channels: Sequence[str], alive: int) -> list[tuple[str, ...]]:
    """Return the subsets of working cameras: all, or a fixed random selection."""
    every = list(combinations(channels, alive))
    if len(every) <= MOST_CHOICES:
        return every
    drawn = np.random.default_rng([SEED, alive]).choice(len(every), MOST_CHOICES, replace=False)
    return [every[number] for number in sorted(drawn.tolist())]


def evenly(inputs: Sequence[InferenceInput], most: int) -> list[InferenceInput]:
    """Return at most this many inputs, spread evenly over a recording."""
    places = np.linspace(0, len(inputs) - 1, min(most, len(inputs))).round().astype(int)
    return [inputs[place] for place in places.tolist()]


def score(
    predictor: Predictor, root: Path, against: str, inputs: Sequence[InferenceInput], alive: tuple[str, ...]
) -> Score:
    """Return the IoU over inputs with only these cameras.

    Raises:
        DataError: if a camera has no image, or a true map is missing or on another grid.
    """
    grid = predictor.model.spec.grid
    thresholds: FloatArray = np.array([[predictor.weights.thresholds[name] for name in CLASSES]])
    counts, seen = CellCounts.zeros(1), 0.0
    for each in inputs:
        frame, truth = each.read().frame, load_map(root, against, each.token)
        if truth.grid != grid:
            raise DataError(
                f"{root}: expected truth on the grid of the weights, {grid.as_array().tolist()}, "
                f"got {truth.grid.as_array().tolist()}"
            )
        missing = [channel for channel in alive if channel not in frame.images]
        if missing:
            raise DataError(f"{each.title}: expected pictures of all cameras, got none of {', '.join(missing)}")
        found = predictor(replace(frame, images={channel: frame.images[channel] for channel in alive}))
        masks = cell_group_masks(grid, np.ones(grid.shape, np.bool_), found.seen)
        counts, seen = counts.plus(count_cells(found.bev, truth, masks, thresholds)), seen + float(found.seen.mean())
    iou = {name: ious(counts.overlap[0, GROUPS.index(name)]) for name in OVER}
    return Score(alive, iou, seen / len(inputs))


def measure(predictor: Predictor, root: Path, against: str, inputs: Sequence[InferenceInput]) -> list[list[Score]]:
    """Return the scores of all subsets, a list for each number of working cameras, the full rig first.

    Raises:
        DataError: if the rig has no camera that the weights use, or as in `score`.
    """
    rig = inputs[0].read().frame.rig
    channels = [camera.channel for camera in select_cameras(predictor.model.spec, rig)]
    if not channels:
        raise DataError(f"{root}: expected cameras {', '.join(predictor.model.spec.channels)}, got none of them")
    numbers = range(len(channels), max(len(channels) - MOST_DEAD, 1) - 1, -1)
    asked = [(number, alive) for number in numbers for alive in choices(channels, number)]
    found: dict[int, list[Score]] = {}
    for number, alive in track(asked, "choices", console=Console(stderr=True), transient=True):
        found.setdefault(number, []).append(score(predictor, root, against, inputs, alive))
    return list(found.values())


def as_json(scores: Sequence[Sequence[Score]]) -> list[dict[str, Any]]:
    """Return a row for each number of working cameras: mean and worst over its subsets."""
    return [
        {
            "alive": len(row[0].alive),
            "choices": len(row),
            "seen_share": float(np.mean([each.seen for each in row])),
            "iou": {
                over: {name: _spread([each.iou[over][name] for each in row]) for name in CLASSES} for over in OVER
            },
            "of": [{"alive": each.alive, "iou": {o: _plain(each.iou[o]) for o in OVER}} for each in row],
        }
        for row in scores
    ]


def _spread(values: Sequence[float]) -> dict[str, float | None]:
    there = [value for value in values if np.isfinite(value)]
    return {"mean": float(np.mean(there)) if there else None, "worst": min(there) if there else None}


def _plain(values: dict[str, float]) -> dict[str, float | None]:
    return {name: value if np.isfinite(value) else None for name, value in values.items()}


def table(rows: Sequence[dict[str, Any]]) -> Table:
    """Return the rows as a table in percent."""
    heads = [f"{name}, {over} cells" for over in OVER for name in CLASSES]
    made = Table("alive", "choices", "cells seen %", *heads)
    for row in rows:
        figures = [row["iou"][over][name] for over in OVER for name in CLASSES]
        cells = ["-" if f["mean"] is None else f"{100 * f['mean']:.1f} ({100 * f['worst']:.1f})" for f in figures]
        made.add_row(str(row["alive"]), str(row["choices"]), f"{100 * row['seen_share']:.1f}", *cells)
    return made


def main(arguments: Sequence[str] | None = None) -> None:
    """Parse arguments, measure, print a table or JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("root", type=Path)
    parser.add_argument("--weights", type=Path, help="weights file; default: the shipped weights")
    parser.add_argument("--frames", type=int, default=32, help="number of frames, spread evenly over ROOT (32)")
    parser.add_argument("--against", default="exact", help="source of the truth (exact)")
    parser.add_argument("--json", action="store_true", help="print JSON; shares are 0..1")
    options = parser.parse_args(arguments)
    if options.frames < 1:
        parser.error(f"--frames: expected 1 or more, got {options.frames}")
    try:
        dataset, predictor = Dataset(options.root), load_predictor(options.weights)
        inputs = evenly(dataset_inputs(dataset, dataset.scenes), options.frames)
        rows = as_json(measure(predictor, options.root, options.against, inputs))
    except AppoccError as error:
        parser.exit(error.exit_code, f"error: {error}\n")
    if options.json:
        thresholds = dict(predictor.weights.thresholds)
        about = {"root": str(options.root), "frames": len(inputs), "weights": predictor.weights.as_meta()}
        print(json.dumps({**about, "thresholds": thresholds, "rows": rows}, indent=2))
    else:
        Console(width=140).print(table(rows))


if __name__ == "__main__":
    main()
