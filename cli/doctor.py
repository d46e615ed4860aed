"""`appocc doctor`: health check of the environment and of a dataset."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cli.common import JsonOption, VersionOption, emit, in_path, progress, say


def doctor(
    root: Annotated[
        Path | None, typer.Argument(parser=in_path, metavar="ROOT", help="Dataset root to check.")
    ] = None,
    images: Annotated[bool, typer.Option("--images", help="Decode every image and LiDAR file (slow).")] = False,
    version: VersionOption = None,
    as_json: JsonOption = False,
) -> None:
    """Check the environment and, with ROOT, a dataset. Exit 0: healthy; 1: problems found; 2: no dataset at ROOT.

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
