"""`appocc convert kitti`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cli.common import JsonOption, local_path
from cli.convert.importing import HzOption, LogsOption, OutArgument, WorkersOption, chosen_logs, run_import
from cli.engine import LOCAL, ClusterOption, shared


def kitti(
    src: Annotated[
        Path,
        typer.Argument(
            metavar="SRC",
            parser=local_path,
            help="A raw drive or a folder of them with their calibrations, the tracking benchmark, or KITTI-360; the "
            "layout is recognised.",
        ),
    ],
    out: OutArgument,
    log: LogsOption = None,
    hz: HzOption = 2.0,
    workers: WorkersOption = 1,
    cluster: ClusterOption = LOCAL,
    as_json: JsonOption = False,
) -> None:
    """Convert KITTI: raw drives, tracking sequences or KITTI-360, one scene each. The same command resumes.

    Example: appocc convert kitti kitti_raw OUT --log 2011_09_26_drive_0005_sync
    """
    from appocc.importers.kitti import find_logs

    logs = chosen_logs(find_logs(shared(cluster, src), hz), log, src)
    run_import(logs, out, "kitti", {"src": str(src.resolve()), "hz": hz}, workers, cluster, as_json)
