"""Options that several sub-commands of `appocc track` have."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cli.common import out_path

SmoothOption = Annotated[
    bool,
    typer.Option("--smooth", help="Offline smoothing: smooth paths, fill gaps, drop predictions after the last hit."),
]
MinScoreOption = Annotated[
    float,
    typer.Option(
        "--min-score",
        min=0.0,
        max=1.0,
        help="Write a track only in frames in which its score, a probability, is at least this.",
    ),
]
VideoOption = Annotated[
    Path | None, typer.Option("--video", parser=out_path, help="Also write a video of the tracks (.webm).")
]
# Detectors for KITTI report many boxes of low scores; nuScenes' benchmark wants all of them.
KITTI_MIN_SCORE, ALL_SCORES = 0.5, 0.0
