"""Tracking of all classes on real trajectories with made detections, in two halves.

    OMP_NUM_THREADS=1 python -m benchmarks.made_boxes FOLDER [--hz 2] [--seeds 3]

FOLDER contains trajectories of nuScenes scenes, `scene-*.npz`. Their objects within 50 m are detected with errors:
misses that are likelier far away and come in runs, errors of position, heading and size, and false boxes beside
objects; scores overlap. The detections are made, the motion and the density are real.

Parameters are chosen on one half of the scenes, every second one from the first, and judged on the other; both have
been seen. AMOTA is that of `benchmarks.nuscenes_mini`, and so is the plain filter, which gets one class alone.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from appocc.errors import AppoccError, DataError
from appocc.geometry import apply, inverse, quaternion_from_yaw, transform
from appocc.objects import KINDS, kind_of
from benchmarks.nuscenes_mini import measure
from tracking.detections import Detections
from tracking.field_of_view import CircularView
from tracking.io.nuscenes_detections import RANGE_M, AnnotatedObjects, SceneDetections

PUBLISHED_HZ = 10
# Standard deviations of position, heading, and size on a logarithmic scale.
POSITION_M, YAW_RAD, SIZE = 0.2, 0.1, 0.06
# Probability of a miss nearby and at the end of the range; half of the misses last for another key frame.
MISSED, MISSED_FAR, LASTS = 0.05, 0.4, 0.5
# False boxes for each object, their distance to it, and log-odds of true and of false ones.
FALSE, BESIDE_M = 0.5, 3.0
TRUE_LOG_ODDS, FALSE_LOG_ODDS = (1.0, 1.3), (-2.0, 1.0)


def make_scene(path: Path, hz: float, seed: int) -> SceneDetections:
    """Return a scene with made detections.

    Raises:
        DataError: if the file is missing.
    """
    if not path.is_file():
        raise DataError(f"{path}: expected trajectories, found no file")
    dice = np.random.default_rng([seed, *path.stem.encode()])
    data = np.load(path)
    kinds = np.array([kind_of(str(category)) or "" for category in data["category"]])
    missed = np.zeros(len(kinds), np.bool_)
    poses, found, truth = [], [], []
    frames = np.arange(0, len(data["t"]), round(PUBLISHED_HZ / hz))
    for k in frames:
        pose = transform(quaternion_from_yaw(data["ego_heading"][k]), data["ego_position"][k])
        place_m = np.nan_to_num(data["position"][:, k], nan=np.inf)
        range_m = np.hypot(*(place_m - data["ego_position"][k])[:, :2].T)
        (here,) = np.nonzero(data["valid"][:, k] & (kinds != "") & (range_m < RANGE_M))
        often = MISSED + (MISSED_FAR - MISSED) * (range_m[here] / RANGE_M) ** 2
        missed[here] = dice.random(len(here)) < np.where(missed[here], LASTS, often)
        seen = here[~missed[here]]
        beside = here[dice.random(len(here)) < FALSE]
        boxes = np.concatenate([seen, beside])
        false = np.arange(len(boxes)) >= len(seen)
        off_m = dice.normal(0, np.where(false, BESIDE_M, POSITION_M)[:, None], (len(boxes), 2))
        size_m = data["size_lwh"][boxes][:, [1, 0, 2]] * np.exp(dice.normal(0, SIZE, (len(boxes), 3)))
        ground_m = apply(inverse(pose), data["position"][boxes, k] + np.pad(off_m, ((0, 0), (0, 1))))
        ground_m[:, 2] -= size_m[:, 2] / 2
        mean, std = np.where(false[:, None], FALSE_LOG_ODDS, TRUE_LOG_ODDS).T
        found.append(
            Detections.from_boxes(
                ground_m=ground_m,
                yaw_rad=data["heading"][boxes, k] - data["ego_heading"][k] + dice.normal(0, YAW_RAD, len(boxes)),
                size_m=size_m,
                log_odds=dice.normal(mean, std),
                kind=tuple(kinds[boxes].tolist()),
                view=CircularView(RANGE_M),
            )
        )
        poses.append(pose)
        present, ones = data["position"][here, k], np.ones(len(here), np.int64)
        truth.append(AnnotatedObjects(here + 1, tuple(kinds[here].tolist()), present, ones))
    times_us = np.asarray(np.rint(1e6 * data["t"][frames]), np.int64)
    tokens = tuple(f"{path.stem}-{k}" for k in frames)
    return SceneDetections(path.stem, tokens, times_us, np.stack(poses), tuple(found), tuple(truth))


def main(arguments: Sequence[str] | None = None) -> None:
    """Parse arguments, measure, print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--hz", type=float, default=2.0, help="key frames per second (2)")
    parser.add_argument("--seeds", type=int, default=3, help="number of different detections of each scene (3)")
    options = parser.parse_args(arguments)
    table = Table("half", "class", "AMOTA", "plain filter", "MOTA", "plain filter", "IDS", "plain filter")
    try:
        paths = sorted(options.folder.glob("scene-*.npz"))
        for name, half in (("to choose", paths[::2]), ("to judge", paths[1::2])):
            scenes = [make_scene(path, options.hz, seed) for path in half for seed in range(options.seeds)]
            here = {kind for scene in scenes for objects in scene.truth for kind in objects.kind}
            for kind in (kind for kind in KINDS if kind in here):
                ours, plain = (measure(scenes, plain, kind) for plain in (False, True))
                shares = [f"{100 * one[figure]:.1f}" for figure in ("AMOTA", "MOTA") for one in (ours, plain)]
                table.add_row(name, kind, *shares, *(f"{one['IDS']:.0f}" for one in (ours, plain)))
    except AppoccError as error:
        sys.exit(f"error: {error}")
    Console().print(table)


if __name__ == "__main__":
    main()
