"""`appocc convert waymo`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cli.common import JsonOption, local_path
from cli.convert.importing import HzOption, LogsOption, OutArgument, WorkersOption, chosen_logs, run_import
from cli.engine import LOCAL, ClusterOption, shared


def waymo(
    src: Annotated[
        Path,
        typer.Argument(
            metavar="SRC",
            parser=local_path,
            help="Version 1: a file *.tfrecord or a folder of them; version 2: the folder of camera_image/, lidar/, "
            "...; or a folder of such folders.",
        ),
    ],
    out: OutArgument,
    log: LogsOption = None,
    hz: HzOption = 2.0,
    workers: WorkersOption = 1,
    cluster: ClusterOption = LOCAL,
    as_json: JsonOption = False,
) -> None:
    """Convert the Waymo Open Dataset (perception): one scene a segment. The same command resumes.

    Example: appocc convert waymo waymo/validation OUT --workers 4
    """
    from appocc.importers.waymo import find_logs

    logs = chosen_logs(find_logs(shared(cluster, src), hz), log, src)
    run_import(logs, out, "waymo", {"src": str(src.resolve()), "hz": hz}, workers, cluster, as_json)
