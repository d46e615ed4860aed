"""What the demo left behind, in words."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from shlex import quote
from typing import Any

from appocc.demo.dataset import HZ, SCENE, SOURCE, VERSION

_TEXT = """\
appocc demo
===========

A car with six cameras and a LiDAR drives through a simulated town for {seconds:.0f} seconds, rendered just now on
this machine. No picture was downloaded, and nothing was recorded on a real street.

What each file shows
--------------------
bev.png      Above, the six camera images of key frame {frame}, as one looks out of the car. Below, the same moment
             from above, ahead is up and left is left: on the left the colour of each cell of 0.4 m, on the right
             what is there (road grey, line markings yellow, vehicles blue). The green outline is the car itself;
             the numbers are metres ahead of (+) or behind (-) its rear axle. This map is the simulator's own truth,
             not a prediction.
tracks.webm  The vehicles followed through all {samples} key frames: the cameras with the tracks drawn in, and the map
             with each vehicle's number, distance, trail and colour. Plays in any browser.
tracks.png   Key frame {frame} of it.
ground.png   "{command}": the vehicle that was meant (red), and the place where the car should
             stand (cyan), in the map and in the camera that sees the vehicle best.
dataset/     The recording itself, in the nuScenes schema (images, LiDAR sweeps, boxes, vector map), and under
             bev/{source} the maps. It is yours to play with; nuscenes-devkit opens it as version {version}.

What came out
-------------
tracking     {metrics}
             The maps are the truth itself, so near-perfect scores are what should come out here:
             they show that the parts fit together, not how well a trained model would do.
grounding    {answer}

The same by hand
----------------
{steps}

Try next
--------
{next}

Running 'appocc demo' again makes these files anew, and leaves alone whatever else you put into this folder.
"""


def explanation(out: Path, samples: int, frame: int, command: str, metrics: Mapping[str, Any], answer: str) -> str:
    """The text of README.txt: what the files in `out` show, what came out, and what to try next."""
    root, video, picture = (quote(str(out / name)) for name in ("dataset", "tracks.webm", "ground.png"))
    asked = f"--scene {SCENE} --frame {frame}"
    steps = [
        f"appocc track {root} --scene {SCENE} --bev {SOURCE} --video {video}",
        f'appocc ground "{command}" {root} {asked} --bev {SOURCE} --picture {picture}',
    ]
    tries = [
        f"appocc doctor {root}",
        f'appocc ground "stop next to the red car" {root} {asked} --bev {SOURCE} --picture red.png',
        f"appocc groundtruth {root}",
        "appocc simulate town --scenes 2 --seconds 2 --split test --sheet town.png",
    ]
    return _TEXT.format(
        samples=samples,
        seconds=(samples - 1) / HZ,
        frame=frame,
        version=VERSION,
        source=SOURCE,
        command=command,
        metrics="MOTA {MOTA:.2f}, IDF1 {IDF1:.2f}, {IDS} id switches, {GT} annotated places".format(**metrics),
        answer=answer.replace("\n", "\n             "),
        steps="\n".join(steps),
        next="\n".join(tries),
    )
