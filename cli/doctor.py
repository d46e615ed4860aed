"""`appocc doctor`: is the environment in order, and is a dataset?"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cli.common import JsonOption, VersionOption, emit, progress, say


def doctor(
    root: Annotated[Path | None, typer.Argument(metavar="ROOT", help="Dataset root to be checked.")] = None,
    images: Annotated[bool, typer.Option("--images", help="Read every image and LiDAR file whole: slow.")] = False,
    version: VersionOption = None,
    as_json: JsonOption = False,
) -> None:
    """Check the environment and, with ROOT, a dataset; exit 0: healthy, 1: something is wrong, 2: no dataset there.

    Example: appocc doctor ROOT --images
    """
    from appocc.doctor import examine

    report = examine(root, version, images, progress)
    if as_json:
        emit(report.as_json())
    else:
        say("\n".join(report.lines()))
    if not report.healthy:
        raise typer.Exit(1)
