"""`appocc convert argoverse`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cli.common import JsonOption, local_path
from cli.convert.importing import HzOption, LogsOption, OutArgument, WorkersOption, chosen_logs, run_import
from cli.engine import LOCAL, ClusterOption, shared


def argoverse(
    src: Annotated[
        Path, typer.Argument(metavar="SRC", parser=local_path, help="Folder of a log, of a split, or of all splits.")
    ],
    out: OutArgument,
    log: LogsOption = None,
    hz: HzOption = 2.0,
    workers: WorkersOption = 1,
    cluster: ClusterOption = LOCAL,
    as_json: JsonOption = False,
) -> None:
    """Convert logs of the Argoverse 2 Sensor Dataset: one scene a log. The same command resumes.

    Example: appocc convert argoverse av2/sensor/val OUT --workers 4
    """
    from appocc.importers.argoverse import find_logs

    logs = chosen_logs(find_logs(shared(cluster, src), hz), log, src)
    run_import(logs, out, "argoverse", {"src": str(src.resolve()), "hz": hz}, workers, cluster, as_json)
