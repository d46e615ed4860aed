"""Error of vehicle colour estimation, compared with colours picked by hand from the images.

Run: python -m benchmarks.painting ROOT FIXTURE.json
ROOT is a converted PandaSet recording; the fixture lists track, frame and hand-picked RGB of each vehicle view.
Prints the mean absolute difference per channel (0..255) and the colour difference CIEDE2000 of the paper's mode, of
the robust colour of each single sample, and of the robust colour of the whole scene, which `appocc groundtruth` uses.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from skimage.color import deltaE_ciede2000, rgb2lab

from appocc.checks import ByteArray
from appocc.grid import BEVGrid
from appocc.groundtruth.compose import vehicles_near
from appocc.groundtruth.inputs import SampleInput, gather_inputs
from appocc.groundtruth.painting import BoxColours, bodywork_by_box, mode_colours, robust_colours
from appocc.nuscenes import Dataset
from appocc.nuscenes.writer import token_of


def colour_of(sample: SampleInput, own: BoxColours, scene: str, track: str) -> ByteArray | None:
    """Return the colour (3,) of a track in a sample, None if unknown."""
    place = sample.boxes_world.instance.index(token_of("instance", token_of("scene", scene), track))
    return own.rgb[place] if own.known[place] else None


def report(
    name: str,
    samples: Sequence[SampleInput],
    colours: Sequence[BoxColours],
    scene: str,
    entries: list[dict[str, Any]],
) -> None:
    """Print the errors of one method."""
    step = 80 // len(samples)  # the fixture counts PandaSet's 80 frames, of which only some have images
    absolute, delta, unseen = [], [], 0
    for entry in entries:
        k = entry["frame"] // step
        rgb = colour_of(samples[k], colours[k], scene, entry["track"])
        if rgb is None:
            unseen += 1
            continue
        pair = np.stack([rgb, entry["rgb"]]).astype(np.float64)
        absolute.append(float(np.abs(pair[0] - pair[1]).mean()))
        labs = rgb2lab(pair[None] / 255)[0]
        delta.append(float(deltaE_ciede2000(labs[0], labs[1])))
    print(
        f"{name:20s} {len(absolute)} views: |RGB difference| mean {np.mean(absolute):.1f} median "
        f"{np.median(absolute):.1f}; CIEDE2000 mean {np.mean(delta):.1f} median {np.median(delta):.1f}; "
        f"{unseen} not seen"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("root", type=Path)
    parser.add_argument("fixture", type=Path)
    arguments = parser.parse_args()
    entries = json.loads(arguments.fixture.read_text())["entries"]
    dataset = Dataset(arguments.root)
    scene = dataset.scenes[0]
    samples = gather_inputs(dataset, scene).samples
    wanted = [vehicles_near(sample, BEVGrid.surround()) for sample in samples]
    pairs = list(zip(samples, wanted, strict=True))
    report("mode (paper)", samples, [mode_colours(*pair) for pair in pairs], scene.name, entries)
    bodies = [bodywork_by_box(*pair, {}) for pair in pairs]  # the fixture has the colours of the images
    alone = [robust_colours([sample], [own])[0] for sample, own in zip(samples, bodies, strict=True)]
    report("robust, by sample", samples, alone, scene.name, entries)
    report("robust, as written", samples, robust_colours(samples, bodies), scene.name, entries)


if __name__ == "__main__":
    main()
