"""Tracks of a dataset's scenes from their maps, from every frame and from every second and fourth one only.

    python -m benchmarks.dropped_frames ROOT [--bev SOURCE] [--scene S]

Judged as `appocc track` judges: annotated vehicles within 40 m of the ego, gate 2 m, in the frames that are left.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import track as progress
from rich.table import Table

from appocc.bevmap import load_map
from appocc.errors import AppoccError, DataError
from appocc.nuscenes import Dataset, Scene
from tracking.blobs import find_blobs
from tracking.metrics import Metrics
from tracking.run import SceneTracks, key_frames, score, track_samples
from tracking.tracker import MAPS, Tracker

EVERY = (1, 2, 4)
SHARES, COUNTS = ("MOTA", "IDF1", "HOTA"), ("IDS", "FRAG", "FP", "FN")


def measured(dataset: Dataset, scene: Scene, source: str) -> dict[int, Metrics]:
    """Scores of a scene, by which frame of how many is kept.

    Raises:
        DataError: if a map is missing or damaged, or the scene has no annotations.
    """
    samples, poses = key_frames(dataset, scene)
    console = Console(stderr=True)
    found = [
        find_blobs(load_map(dataset.root, source, sample.token)).as_detections()
        for sample in progress(samples, scene.name, console=console)
    ]
    scores = {}
    for every in EVERY:
        kept = np.arange(0, len(samples), every)
        some = tuple(samples[i] for i in kept)
        tracks = track_samples(some, poses[kept], [found[i] for i in kept], Tracker(MAPS))
        judged = score(dataset, SceneTracks(scene.name, source, some, poses[kept], tracks))
        if judged is None:
            raise DataError(f"{dataset.root}: scene '{scene.name}' has no annotations")
        scores[every] = judged["metrics"]
    return scores


def main(words: Sequence[str] | None = None) -> None:
    """Measure and tell."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("root", type=Path)
    parser.add_argument("--bev", default="groundtruth")
    parser.add_argument("--scene")
    given = parser.parse_args(words)
    table = Table("scene", "frames", *(f"{name} %" for name in SHARES), *COUNTS)
    try:
        dataset = Dataset(given.root)
        scenes = [dataset.scene(given.scene)] if given.scene else dataset.scenes
        for scene in scenes:
            for every, scores in measured(dataset, scene, given.bev).items():
                shares = [f"{100 * getattr(scores, name):.1f}" for name in SHARES]
                table.add_row(scene.name, f"1 of {every}", *shares, *(str(getattr(scores, name)) for name in COUNTS))
    except AppoccError as error:
        parser.exit(2, f"error: {error}\n")
    Console(width=100).print(table)


if __name__ == "__main__":
    main()
