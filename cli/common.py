"""What all commands share: where text for people and for machines goes, and how errors end."""

from __future__ import annotations

import json
import os
import shlex
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
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
TrustUnseenOption = Annotated[
    bool,
    typer.Option("--trust-unseen", help="Of predicted maps, also use what the network guesses where no camera sees."),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Machine-readable output on stdout, nothing else there.")]
# A line for people about a name or value of a stranger is no longer than this.
_MOST_TOLD = 2000


class Interrupted(SystemExit):
    """A signal ends the command; it ends as an exception does, so that what is half made is removed.

    Attributes:
        number: of the signal.
        more: words that the command needs to go on where it was.
    """

    def __init__(self, number: int, more: Sequence[str] = ()) -> None:
        """End with the exit code of a process that this signal ended."""
        super().__init__(128 + number)
        self.number, self.more = number, tuple(more)

    def __str__(self) -> str:
        """The line that says how to go on."""
        return f"interrupted; to go on: {shlex.join(['appocc', *sys.argv[1:], *self.more])}"


def say(text: str) -> None:
    """Lines for people, on stderr; what controls terminals, in names of files or rows, is written out."""
    plain = (c if c.isprintable() or c == "\n" else c.encode("unicode_escape").decode() for c in text)
    typer.echo("".join(plain), err=True)


def say_error(reason: object) -> None:
    """Why a command ends, in one line; names and values in it may be as long as a stranger likes."""
    line = str(reason)
    say("error: " + (line if len(line) <= _MOST_TOLD else line[:_MOST_TOLD] + " ...").replace("\n", "\\n"))


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


def say_stale(stale: Mapping[str, int]) -> None:
    """How many results were there and were made anew, and why."""
    if stale:
        say(f"made anew: {'; '.join(f'{count} ({reason})' for reason, count in stale.items())}")


def out_path(text: str) -> Path:
    """The value of `--out`; an empty one would be the working folder.

    Raises:
        typer.BadParameter: if it is empty.
    """
    if not text:
        raise typer.BadParameter("expected a name, got an empty one")
    return Path(text)


out_path.__name__ = "path"  # how --help calls the value


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
