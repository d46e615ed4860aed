"""Tracking on a dataset's maps with dropped frames, with colours as a user gets them, one sample at a time.

    python -m benchmarks.dropped_frames ROOT [--bev SOURCE] [--scene S]

All frames, every second and every fourth; figures are means over the choice of the first frame. Evaluated as in
`appocc track`: annotated vehicles within 40 m of the ego, gate 2 m, in the remaining frames.

Ground-truth maps paint each annotated vehicle in one colour for the whole scene: it gives the identity away.
Therefore the vehicles get the colour estimated from the images of the sample alone:

- robust: the robust colour of the sample; mode: the paper's histogram mode; none: the tracker without its colour
  term.
- scene: the colour of the whole scene, as the maps have it; an upper bound that no recording offers.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.spatial.distance import cdist

from appocc.bevmap import load_map
from appocc.boxes import Boxes
from appocc.checks import FloatArray
from appocc.colours import lab_from_rgb
from appocc.errors import AppoccError, DataError
from appocc.geometry import apply
from appocc.grid import BEVGrid
from appocc.groundtruth.compose import vehicles_near
from appocc.groundtruth.inputs import gather_inputs
from appocc.groundtruth.painting import BoxColours, bodywork_by_box, mode_colours, robust_colours
from appocc.nuscenes import Dataset, Scene
from benchmarks.colour_ablation import without_colour
from tracking.detections import Detections
from tracking.evaluation.clear_id_hota import Metrics
from tracking.evaluation.scene import score_scene
from tracking.pipeline import SceneTracks, read_key_frames, track_samples
from tracking.presets import MAPS
from tracking.tracker import Tracker

EVERY, GATE_M = (1, 2, 4), 1.5
SHARES, COUNTS = ("MOTA", "IDF1", "HOTA"), ("FRAG", "FP", "FN")
COLOURS = ("none", "robust", "mode", "scene")
HEAD = ("scene", "frames", *(f"{name} %" for name in SHARES), *COUNTS, *(f"IDS {name}" for name in COLOURS))


class Trial(NamedTuple):
    """Scores of a scene at one frame rate: for each source of colours, by first frame."""

    every: int
    scores: dict[str, list[Metrics]]

    def row(self) -> list[str]:
        """Return the figures in the order of HEAD: means of shares and counts, with robust colours."""
        shares = [f"{100 * np.mean([getattr(each, name) for each in self.scores['robust']]):.1f}" for name in SHARES]
        counts = [_mean(self.scores["robust"], name) for name in COUNTS]
        return [f"1 of {self.every}", *shares, *counts, *(_mean(self.scores[name], "IDS") for name in COLOURS)]


def _mean(scores: Sequence[Metrics], name: str) -> str:
    return f"{np.mean([getattr(each, name) for each in scores]):.2g}"


def sample_colours(dataset: Dataset, scene: Scene) -> dict[str, list[BoxColours]]:
    """Return the colours of the annotated boxes in each sample, from the images of that sample: robust, and the mode.

    Raises:
        DataError: if an image or a sweep is damaged.
    """
    samples = gather_inputs(dataset, scene).samples
    near = [vehicles_near(sample, BEVGrid.surround()) for sample in samples]
    bodies = [bodywork_by_box(sample, own, {}) for sample, own in zip(samples, near, strict=True)]
    return {
        "robust": [robust_colours([one], [own])[0] for one, own in zip(samples, bodies, strict=True)],
        "mode": [mode_colours(one, own) for one, own in zip(samples, near, strict=True)],
    }


def coloured(found: Detections, pose: FloatArray, boxes: Boxes, colours: BoxColours) -> Detections:
    """Return the detections with the colours of the nearest annotated boxes, NaN where there is none."""
    places = apply(pose, found.ground_m)[:, :2]
    distance = cdist(places, boxes.centre_m[:, :2])
    nearest = distance.argmin(axis=1)
    known = (distance.min(axis=1) < GATE_M) & colours.known[nearest]
    rgb = np.where(known[:, None], colours.rgb[nearest].astype(np.float64), np.nan)
    return replace(found, rgb=rgb, lab=lab_from_rgb(rgb))


def measured(dataset: Dataset, scene: Scene, source: str) -> list[Trial]:
    """Return the scores of a scene for each frame rate of EVERY.

    Raises:
        DataError: if a map is missing or damaged, or the scene has no annotations.
    """
    samples, poses = read_key_frames(dataset, scene)
    as_drawn = [Detections.from_bev(load_map(dataset.root, source, sample.token)) for sample in samples]
    boxes = [dataset.boxes_world(sample) for sample in samples]
    found = {"none": as_drawn, "scene": as_drawn}
    for name, colours in sample_colours(dataset, scene).items():
        found[name] = [coloured(*each) for each in zip(as_drawn, poses, boxes, colours, strict=True)]

    def scored(colours: str, kept: slice) -> Metrics:
        config = without_colour(MAPS) if colours == "none" else MAPS
        tracks = track_samples(samples[kept], poses[kept], found[colours][kept], Tracker(config))
        judged = score_scene(dataset, SceneTracks(scene.name, source, samples[kept], poses[kept], tracks))
        if judged is None:
            raise DataError(f"{dataset.root}: scene '{scene.name}' has no annotations")
        return judged["metrics"]

    return [
        Trial(every, {name: [scored(name, slice(first, None, every)) for first in range(every)] for name in COLOURS})
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
    Console(width=120).print(table)


if __name__ == "__main__":
    main()
