"""Robustness to camera failures: IoU with all cameras, and with ever fewer, down to a single one.

    OMP_NUM_THREADS=2 python -m benchmarks.missing_cameras ROOT [--weights F] [--frames 32] [--against exact] [--json]

A failed camera is left out of the rig, as in `appocc infer`, without a substitute. All subsets of cameras are
evaluated on the same frames, spread evenly over ROOT: all six subsets of five cameras and of one, and six random ones
of four, three and two, the same in every run. IoU is at the thresholds of each map, over all cells of the grid and
over those that a working camera sees by the geometry of the rig; a row is the mean over its subsets, with the worst
in brackets. The last row is the camera that looks ahead, alone.

A network must not be sure of what it cannot see: "unseen road" is the share of the unseen cells that the network
calls road, as it predicts them, and in the map, where unseen cells are not valid.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from appocc.bevmap import CLASSES, ROAD
from appocc.errors import AppoccError, DataError
from appocc.evaluation.cells import GROUPS, CellCounts, ious, ratio
from appocc.inference.inputs import InferenceInput, dataset_inputs
from appocc.inference.loading import load_predictor
from appocc.inference.predictor import Predictor, select_cameras
from appocc.nuscenes.dataset import Dataset
from benchmarks.predicted_maps import compare, evenly, parse_options, truth_source

MOST_CHOICES, SEED = 6, 0
OVER = ("all", "seen")


class Score(NamedTuple):
    """Scores of one subset of working cameras.

    Attributes:
        alive: channels of the working cameras.
        iou: of each class, over each of `OVER`.
        seen: share of the cells that a working camera sees.
        unseen_road: share of the other cells that are road, as predicted, and in the map; NaN if there are none.
    """

    alive: tuple[str, ...]
    iou: dict[str, dict[str, float]]
    seen: float
    unseen_road: tuple[float, float]


def choices(channels: Sequence[str], alive: int) -> list[tuple[str, ...]]:
    """Return the subsets of working cameras: all, or a fixed random selection."""
    every = list(combinations(channels, alive))
    if len(every) <= MOST_CHOICES:
        return every
    drawn = np.random.default_rng([SEED, alive]).choice(len(every), MOST_CHOICES, replace=False)
    return [every[number] for number in sorted(drawn.tolist())]


def score(
    predictor: Predictor, root: Path, against: str, inputs: Sequence[InferenceInput], alive: tuple[str, ...]
) -> Score:
    """Return the IoU over inputs with only these cameras.

    Raises:
        DataError: if a camera has no image, or a true map is missing or on another grid.
    """
    counts, seen, unseen, road = CellCounts.zeros(1), 0.0, 0, np.zeros(2)
    for each in inputs:
        frame = each.read().frame
        missing = [channel for channel in alive if channel not in frame.images]
        if missing:
            raise DataError(f"{each.title}: expected pictures of all cameras, got none of {', '.join(missing)}")
        images = {channel: frame.images[channel] for channel in alive}
        (bev, sight), found = compare(predictor, replace(frame, images=images), root, against)
        counts, seen, unseen = counts.plus(found), seen + float(sight.mean()), unseen + int((~sight).sum())
        road += [(layer.on[ROAD] & ~sight).sum() for layer in (bev.with_guesses(), bev)]
    iou = {name: ious(counts.overlap[0, GROUPS.index(name)]) for name in OVER}
    guessed, kept = (ratio(number, unseen) for number in road)
    return Score(alive, iou, seen / len(inputs), (guessed, kept))


def measure(predictor: Predictor, root: Path, against: str, inputs: Sequence[InferenceInput]) -> list[list[Score]]:
    """Return the scores of all subsets, a list for each number of working cameras, the full rig first, one at last.

    After these comes the score of the camera that looks ahead, alone.

    Raises:
        DataError: if the rig has no camera that the weights use, or as in `score`.
    """
    cameras = select_cameras(predictor.model.spec, inputs[0].read().frame.rig)
    channels = [camera.channel for camera in cameras]
    if not channels:
        raise DataError(f"{root}: expected cameras {', '.join(predictor.model.spec.channels)}, got none of them")
    ahead = max(cameras, key=lambda camera: float(camera.ego_from_cam[0, 2])).channel
    asked = [choices(channels, number) for number in range(len(channels), 0, -1)] + [[(ahead,)]]
    with Progress(console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("choices", total=sum(map(len, asked)))

        def measured(alive: tuple[str, ...]) -> Score:
            found = score(predictor, root, against, inputs, alive)
            progress.advance(task)
            return found

        return [[measured(alive) for alive in row] for row in asked]


def as_json(scores: Sequence[Sequence[Score]]) -> list[dict[str, Any]]:
    """Return a row for each list of subsets: mean and worst."""
    return [
        {
            "alive": len(row[0].alive),
            "choices": len(row),
            "seen_share": float(np.mean([each.seen for each in row])),
            "unseen_road": {
                name: _spread([each.unseen_road[i] for each in row], max)
                for i, name in enumerate(("guessed", "kept"))
            },
            "iou": {
                over: {name: _spread([each.iou[over][name] for each in row]) for name in CLASSES} for over in OVER
            },
            "of": [{"alive": each.alive, "iou": {o: _plain(each.iou[o]) for o in OVER}} for each in row],
        }
        for row in scores
    ]


def _spread(values: Sequence[float], worst: Callable[[Sequence[float]], float] = min) -> dict[str, float | None]:
    there = [value for value in values if np.isfinite(value)]
    return {"mean": float(np.mean(there)) if there else None, "worst": worst(there) if there else None}


def _plain(values: dict[str, float]) -> dict[str, float | None]:
    return {name: value if np.isfinite(value) else None for name, value in values.items()}


def table(rows: Sequence[dict[str, Any]]) -> Table:
    """Return the rows as a table in percent."""
    heads = [f"{name}, {over} cells" for over in OVER for name in CLASSES]
    made = Table("alive", "choices", "cells seen %", *heads, "unseen road %", "in the map %")
    for row in rows:
        figures = [row["iou"][over][name] for over in OVER for name in CLASSES] + list(row["unseen_road"].values())
        cells = ["-" if f["mean"] is None else f"{100 * f['mean']:.1f} ({100 * f['worst']:.1f})" for f in figures]
        alone = row["alive"] == row["choices"] == 1
        made.add_row(
            row["of"][0]["alive"][0] if alone else str(row["alive"]),
            str(row["choices"]),
            f"{100 * row['seen_share']:.1f}",
            *cells,
        )
    return made


def main(arguments: Sequence[str] | None = None) -> None:
    """Parse arguments, measure, print a table or JSON."""
    parser, options = parse_options(__doc__, arguments, frames=32)
    try:
        dataset, predictor = Dataset(options.root), load_predictor(options.weights)
        inputs = evenly(dataset_inputs(dataset, dataset.scenes), options.frames)
        rows = as_json(measure(predictor, options.root, truth_source(options.root, options.against), inputs))
    except AppoccError as error:
        parser.exit(error.exit_code, f"error: {error}\n")
    if options.json:
        about = {"root": str(options.root), "frames": len(inputs), "weights": predictor.weights.as_meta()}
        print(json.dumps({**about, "rows": rows}, indent=2))
    else:
        Console(width=170).print(table(rows))


if __name__ == "__main__":
    main()
