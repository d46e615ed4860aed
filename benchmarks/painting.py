"""Error of both ways to paint vehicles against colours read by hand from the pictures.

Run: python -m benchmarks.painting ROOT FIXTURE.json
ROOT is a converted PandaSet recording; the fixture names track, frame and the hand-read RGB of each vehicle view.
Prints the mean absolute difference per channel (0..255) and the colour difference CIEDE2000.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any, get_args

import numpy as np
from skimage.color import deltaE_ciede2000, rgb2lab

from appocc.groundtruth.inputs import SampleInput, gather
from appocc.groundtruth.painting import Paint, paint_sample
from appocc.nuscenes import Dataset
from appocc.nuscenes.writer import token_of


def painted(sample: SampleInput, scene: str, entries: list[dict[str, Any]], paint: Paint) -> list[Any]:
    """The colour (3,) of each entry's vehicle in a sample, None where it is not seen."""
    instances = [token_of("instance", token_of("scene", scene), entry["track"]) for entry in entries]
    places = [sample.boxes_world.instance.index(name) for name in instances]
    wanted = np.zeros(len(sample.boxes_world), dtype=np.bool_)
    wanted[places] = True
    colours, known = paint_sample(sample, wanted, paint)
    return [colours[i] if known[i] else None for i in places]


def errors(root: Path, entries: list[dict[str, Any]], paint: Paint) -> tuple[list[float], list[float], int]:
    """Mean absolute differences, CIEDE2000 differences, and how many vehicles were not seen."""
    dataset = Dataset(root)
    scene = dataset.scenes[0]
    inputs = gather(dataset, scene)
    step = 80 // len(inputs.samples)  # the fixture counts PandaSet's 80 frames, of which only some have images
    absolute, delta, unseen = [], [], 0
    for frame in sorted({entry["frame"] for entry in entries}):
        own = [entry for entry in entries if entry["frame"] == frame]
        for entry, rgb in zip(own, painted(inputs.samples[frame // step], scene.name, own, paint), strict=True):
            if rgb is None:
                unseen += 1
                continue
            hand = np.array(entry["rgb"], dtype=np.float64)
            absolute.append(float(np.abs(rgb - hand).mean()))
            labs = rgb2lab(np.stack([rgb.astype(np.float64), hand])[None] / 255)[0]
            delta.append(float(deltaE_ciede2000(labs[0], labs[1])))
    return absolute, delta, unseen


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("root", type=Path)
    parser.add_argument("fixture", type=Path)
    arguments = parser.parse_args()
    entries = json.loads(arguments.fixture.read_text())["entries"]
    for paint in get_args(Paint):
        absolute, delta, unseen = errors(arguments.root, entries, paint)
        print(
            f"{paint:7s} {len(absolute)} views: |RGB difference| mean {np.mean(absolute):.1f} median "
            f"{np.median(absolute):.1f}; CIEDE2000 mean {np.mean(delta):.1f} median {np.median(delta):.1f}; "
            f"{unseen} not seen"
        )


if __name__ == "__main__":
    main()
