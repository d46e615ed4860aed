"""Tracking on a dataset's maps with dropped frames: all frames, every second and every fourth.

    python -m benchmarks.dropped_frames ROOT [--bev SOURCE] [--scene S]

Evaluated as in `appocc track`: annotated vehicles within 40 m of the ego, gate 2 m, in the remaining frames. Figures
are means over the choice of the first frame.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from rich.console import Console
from rich.table import Table

from appocc.bevmap import load_map
from appocc.errors import AppoccError, DataError
from appocc.nuscenes import Dataset, Scene
from benchmarks.colour_ablation import without_colour
from tracking.evaluation.clear_id_hota import Metrics
from tracking.evaluation.scene import score_scene
from tracking.instances.instances import find_instances
from tracking.pipeline import SceneTracks, read_key_frames, track_samples
from tracking.presets import MAPS
from tracking.tracker import Tracker, TrackerConfig

EVERY, CONFIGS = (1, 2, 4), (MAPS, without_colour(MAPS))
SHARES, COUNTS = ("MOTA", "IDF1", "HOTA"), ("IDS", "FRAG", "FP", "FN")
HEAD = ("scene", "frames", *(f"{name} %" for name in SHARES), *COUNTS, "IDS without colour")


class Trial(NamedTuple):
    """Scores of a scene at one frame rate, by first frame, with and without colour."""

    every: int
    with_colour: list[Metrics]
    without: list[Metrics]

    def row(self) -> list[str]:
        """Return the figures in the order of HEAD: means of shares and counts."""
        shares = [f"{100 * np.mean([getattr(each, name) for each in self.with_colour]):.1f}" for name in SHARES]
        counts = [_mean(self.with_colour, name) for name in COUNTS]
        return [f"1 of {self.every}", *shares, *counts, _mean(self.without, "IDS")]


def _mean(scores: Sequence[Metrics], name: str) -> str:
    return f"{np.mean([getattr(each, name) for each in scores]):.2g}"


def measured(dataset: Dataset, scene: Scene, source: str) -> list[Trial]:
    """Return the scores of a scene for each frame rate of EVERY.

    Raises:
        DataError: if a map is missing or damaged, or the scene has no annotations.
    """
    samples, poses = read_key_frames(dataset, scene)
    maps = (load_map(dataset.root, source, sample.token) for sample in samples)
    found = [find_instances(each).as_detections() for each in maps]

    def scored(config: TrackerConfig, kept: slice) -> Metrics:
        tracks = track_samples(samples[kept], poses[kept], found[kept], Tracker(config))
        judged = score_scene(dataset, SceneTracks(scene.name, source, samples[kept], poses[kept], tracks))
        if judged is None:
            raise DataError(f"{dataset.root}: scene '{scene.name}' has no annotations")
        return judged["metrics"]

    return [
        Trial(every, *([scored(config, slice(first, None, every)) for first in range(every)] for config in CONFIGS))
        for every in EVERY
    ]


def main(words: Sequence[str] | None = None) -> None:
    """Run the benchmark and print its table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("root", type=Path)
    parser.add_argument("--bev", default="groundtruth")
    parser.add_argument("--scene")
    given = parser.parse_args(words)
    table = Table(*HEAD)
    try:
        dataset = Dataset(given.root)
        scenes = [dataset.scene(given.scene)] if given.scene else dataset.scenes
        for scene in scenes:
            for trial in measured(dataset, scene, given.bev):
                table.add_row(scene.name, *trial.row())
    except AppoccError as error:
        parser.exit(2, f"error: {error}\n")
    Console(width=100).print(table)


if __name__ == "__main__":
    main()
