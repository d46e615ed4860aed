"""What all commands share: where text for people and for machines goes, and how errors end."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer

RootArgument = Annotated[Path, typer.Argument(metavar="ROOT", help="Dataset root in the nuScenes schema.")]
VersionOption = Annotated[
    str | None, typer.Option("--version", help="Folder of the tables, such as v1.0-mini, where ROOT has several.")
]
JsonOption = Annotated[bool, typer.Option("--json", help="Machine-readable output on stdout, nothing else there.")]


def say(text: str) -> None:
    """A line for people, on stderr."""
    typer.echo(text, err=True)


def emit(value: Any) -> None:
    """A JSON object for machines, on stdout; numbers that are not finite become null."""
    sys.stdout.write(json.dumps(_plain(value), indent=2, allow_nan=False) + "\n")


def _plain(value: Any) -> Any:
    """JSON cannot say NaN or infinity."""
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not -1e308 < value < 1e308:
        return None
    return value


@contextmanager
def progress(title: str, total: int | None) -> Iterator[Callable[[int], None]]:
    """A progress bar on stderr (None: length unknown); the block gets a function to call with the steps done."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(title, total=total)
        yield lambda steps: bar.advance(task, steps)
