"""`appocc convert pandaset`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cli.common import JsonOption, emit, local_path, progress, say
from cli.convert.importing import OutArgument


def pandaset(
    src: Annotated[
        Path,
        typer.Argument(
            metavar="SRC", parser=local_path, help="Folder with frames.json (plain), or a published sequence folder."
        ),
    ],
    out: OutArgument,
    lidar: Annotated[
        Path | None, typer.Option(parser=local_path, help="Folder of the LiDAR sweeps, if it is a separate one.")
    ] = None,
    trust_pickles: Annotated[
        bool,
        typer.Option(
            "--trust-pickles",
            help="Read the published pickles. A pickle can run code: only if you trust it.",
        ),
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Convert PandaSet.

    Example: appocc convert pandaset pandaset_002 OUT --lidar pandaset_002_lidar
    """
    from appocc.pandaset import convert_folder

    with progress("converting", None) as bar:
        summary = convert_folder(src, out, lidar, trust_pickles, bar)
    if as_json:
        emit(summary)
    say(
        f"{out}: {summary['samples']} samples, {summary['images']} images, {summary['sweeps']} LiDAR sweeps, "
        f"{summary['annotations']} boxes of scenes {', '.join(summary['scenes'])}"
    )
    if not summary["sweeps"]:
        say("no LiDAR was converted: name its folder with --lidar")
