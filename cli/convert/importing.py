"""Shared by the commands that import logs: arguments, progress and the summary."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cli.common import emit, out_path, progress, say
from cli.engine import engine, shared

if TYPE_CHECKING:
    from appocc.importers import Log, Summary

OutArgument = Annotated[Path, typer.Argument(parser=out_path, metavar="OUT", help="New folder for the dataset.")]
WorkersOption = Annotated[
    int, typer.Option("--workers", min=1, max=1024, help="Logs imported at once, one process each.")
]
HzOption = Annotated[float, typer.Option("--hz", min=0.05, max=100, help="Key frames per second.")]
LogsOption = Annotated[
    list[str] | None, typer.Option("--log", metavar="NAME", help="Only this log; may be repeated. Default: all.")
]


def chosen_logs(logs: Sequence[Log], names: Sequence[str] | None, src: Path) -> list[Log]:
    """Return the logs with these names, in the order found; all without names.

    Raises:
        NotFoundError: if there is no log of a name.
    """
    from appocc.errors import NotFoundError

    known = [log.name for log in logs]
    for name in names or ():
        if name not in known:
            raise NotFoundError(f"{src}: expected --log, one of {', '.join(known[:12])}, got '{name}'")
    return [log for log in logs if not names or log.name in names]


def run_import(
    logs: Sequence[Log],
    out: Path,
    source: str,
    settings: Mapping[str, Any],
    workers: int,
    cluster: str,
    as_json: bool,
) -> None:
    """Import logs with a progress bar, and print the summary.

    Raises:
        DataError: as `import_logs` does.
    """
    from appocc.importers import import_logs
    from appocc.nuscenes.assembly import unfinished_folder

    total = sum(log.frames_in_total for log in logs) or None
    with (
        engine(cluster, min(workers, len(logs)), unfinished_folder(out)) as pool,
        progress("importing", total) as bar,
    ):
        summary = import_logs(logs, shared(cluster, out), source, settings, pool, bar)
    report(summary, out, as_json)


def report(summary: Summary, out: Path, as_json: bool) -> None:
    """Print the summary of an import."""
    if as_json:
        emit(summary.as_json() | {"folder": str(out)})
    for sensor, count in sorted(summary.missing.items()):
        say(f"{sensor}: missing in {count} of {summary.samples} key frames")
    for line in (*summary.damaged, *summary.notes):
        say(line)
    classes = f", {summary.pixel_classes} images with pixel classes" if summary.pixel_classes else ""
    say(
        f"{out}: {summary.samples} key frames, {summary.images} images, {summary.sweeps} LiDAR sweeps, "
        f"{summary.boxes} boxes of {len(summary.scenes)} scene{'s' if len(summary.scenes) != 1 else ''}{classes}"
    )
