"""What all commands share: where text for people and for machines goes, and how errors end."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from appocc.errors import DataError

if TYPE_CHECKING:
    from appocc.nuscenes import Dataset, Scene

RootArgument = Annotated[Path, typer.Argument(metavar="ROOT", help="Dataset root in the nuScenes schema.")]
VersionOption = Annotated[
    str | None, typer.Option("--version", help="Folder of the tables, such as v1.0-mini, where ROOT has several.")
]
JsonOption = Annotated[bool, typer.Option("--json", help="Machine-readable output on stdout, nothing else there.")]


def say(text: str) -> None:
    """Lines for people, on stderr; what controls terminals, in names of files or rows, is written out."""
    plain = (c if c.isprintable() or c == "\n" else c.encode("unicode_escape").decode() for c in text)
    typer.echo("".join(plain), err=True)


def say_error(reason: object) -> None:
    """Why a command ends, in one line."""
    say("error: " + str(reason).replace("\n", "\\n"))


def say_empty(dataset: Dataset, scenes: Iterable[Scene]) -> None:
    """A line for each scene that has no key frames and is passed over."""
    for scene in scenes:
        if not dataset.samples(scene):
            say(f"left out: scene '{scene.name}', which has no key frames")


def emit(value: Any) -> None:
    """A JSON object for machines, on stdout; numbers that are not finite become null.

    Raises:
        DataError: if stdout cannot be written, a full disk for example.
        typer.Exit: with 141, as for the signal, if nobody reads it.
    """
    try:
        print(json.dumps(_plain(value), indent=2, allow_nan=False), flush=True)
    except OSError as error:
        # What is still in the buffer would be tried again, and complained of, when Python ends.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if isinstance(error, BrokenPipeError):
            raise typer.Exit(141) from error
        raise DataError(f"standard output: cannot be written ({error.strerror})") from error


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
def progress(title: str, total: int | None) -> Iterator[Callable[[float], None]]:
    """A progress bar on stderr (None: length unknown); the block gets a function to call with the steps done."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    console = Console(stderr=True)
    # Into a file or a pipe a bar would only write an empty line.
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(title, total=total)
        yield lambda steps: bar.advance(task, steps)
