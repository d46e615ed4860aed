"""Tracks of a dataset's scenes from their maps, from all frames and from every second and fourth one only.

    python -m benchmarks.dropped_frames ROOT [--bev SOURCE] [--scene S]

Judged as `appocc track` judges: annotated vehicles within 40 m of the ego, gate 2 m, in the frames that are left.
Means over which frame is the first one kept.
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
    """Scores of a scene from one frame of so many, by which is the first, with colour and without."""

    every: int
    with_colour: list[Metrics]
    without: list[Metrics]

    def row(self) -> list[str]:
        """The figures in the order of HEAD: means, and counts as they are on average."""
        shares = [f"{100 * np.mean([getattr(each, name) for each in self.with_colour]):.1f}" for name in SHARES]
        counts = [_mean(self.with_colour, name) for name in COUNTS]
        return [f"1 of {self.every}", *shares, *counts, _mean(self.without, "IDS")]


def _mean(scores: Sequence[Metrics], name: str) -> str:
    return f"{np.mean([getattr(each, name) for each in scores]):.2g}"


def measured(dataset: Dataset, scene: Scene, source: str) -> list[Trial]:
    """Scores of a scene, for each of EVERY.

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
    """Measure and tell."""
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
