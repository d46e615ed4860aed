"""Shared by all commands: options, output for people (stderr) and machines (stdout), progress, interruption."""

from __future__ import annotations

import json
import os
import shlex
import sys
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from appocc.errors import DataError

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress

    from appocc.nuscenes import Dataset, Scene


def in_path(text: str) -> Path:
    """Return the value of an option or argument as a path, which may be a URL.

    Raises:
        typer.BadParameter: if it is no valid URL.
    """
    if "://" not in str(text):  # without the imports that a URL needs
        return Path(text)
    from appocc.files import path_of
    from appocc.files.downloads import show_downloads

    show_downloads(progress)
    try:
        return path_of(text)
    except DataError as error:
        raise typer.BadParameter(str(error)) from error


def local_path(text: str) -> Path:
    """Return the value of an option or argument that is a path on this machine.

    Raises:
        typer.BadParameter: if it is a URL.
    """
    path = in_path(text)
    if "://" in str(path):
        raise typer.BadParameter(f"{path}: expected a path on this machine, got a URL")
    return path


def out_path(text: str) -> Path:
    """Return the value of `--out` as a path, which may be a URL; an empty one would mean the working folder.

    Raises:
        typer.BadParameter: if it is empty, no valid URL, or one of a web server, which is read-only.
    """
    if not text:
        raise typer.BadParameter("expected a name, got an empty one")
    path = in_path(text)
    if "://" in str(path):
        from appocc.files.object_store import check_writable

        try:
            check_writable(str(path))
        except DataError as error:
            raise typer.BadParameter(str(error)) from error
    return path


def local_out_path(text: str) -> Path:
    """Return the value of `--out` as a path on this machine.

    Raises:
        typer.BadParameter: if it is empty or a URL.
    """
    return local_path(str(out_path(text)))


for _parser in (in_path, local_path, out_path, local_out_path):
    _parser.__name__ = "path"  # the metavar in --help

RootArgument = Annotated[
    Path,
    typer.Argument(parser=in_path, metavar="ROOT", help="Dataset root in the nuScenes schema: a folder or a URL."),
]
VersionOption = Annotated[
    str | None, typer.Option("--version", help="Folder of the tables, such as v1.0-mini; needed if ROOT has several.")
]
WeightsOption = Annotated[
    Path | None,
    typer.Option(
        "--weights",
        parser=in_path,
        help="Weights file or folder, or the name of shipped ones: appocc (default) or street.",
    ),
]
SceneOption = Annotated[
    str | None, typer.Option("--scene", help="Name or token of the scene; default: the only one of ROOT.")
]
SourceOption = Annotated[
    str | None,
    typer.Option(
        "--bev",
        metavar="SOURCE",
        help="Source of the maps: ROOT/bev/SOURCE, or a folder with a slash in its name; "
        "default: the only one, else groundtruth.",
    ),
]
TrustUnseenOption = Annotated[
    bool,
    typer.Option(
        "--trust-unseen", help="In predicted maps, also use the network's guess for cells that no camera sees."
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON, and nothing else, to stdout.")]
# Error messages quote names and values from input files; longer lines are cut.
_MAX_CHARACTERS, _MAX_LISTED = 2000, 12


class Interrupted(SystemExit):
    """A signal interrupts the command. It is an exception, so that partial results are removed on the way out.

    Attributes:
        number: number of the signal.
        more: extra arguments with which the command resumes.
    """

    def __init__(self, number: int, more: Sequence[str] = ()) -> None:
        """Set the exit code of a process terminated by this signal."""
        super().__init__(128 + number)
        self.number, self.more = number, tuple(more)

    def __str__(self) -> str:
        """Return the message with the command that resumes the run."""
        return f"interrupted; to resume: {shlex.join(['appocc', *sys.argv[1:], *self.more])}"


@dataclass
class _Verbosity:
    """What is printed to stderr: `quiet` errors only, `verbose` also where an error arose."""

    quiet: bool = False
    verbose: bool = False


_verbosity = _Verbosity()


def set_verbosity(quiet: bool, verbose: bool) -> None:
    """Set what is printed to stderr by the commands of this process."""
    _verbosity.quiet, _verbosity.verbose = quiet, verbose


def is_quiet() -> bool:
    """Return whether only errors are printed to stderr."""
    return _verbosity.quiet


def wide_console(least_width: int) -> Console:
    """Return a console on stderr for tables, silent if only errors are wanted.

    In a narrow terminal its lines wrap, and no number is cut.
    """
    from rich.console import Console

    console = Console(stderr=True, quiet=_verbosity.quiet)
    console.width = max(console.width, least_width)
    return console


def say(text: str) -> None:
    """Print lines for people to stderr, unless they want errors only."""
    if not _verbosity.quiet:
        say_always(text)


def say_always(text: str) -> None:
    """Print lines to stderr; control characters in quoted names are escaped."""
    plain = (c if c.isprintable() or c == "\n" else c.encode("unicode_escape").decode() for c in text)
    typer.echo("".join(plain), err=True)


def say_error(reason: object) -> None:
    """Print the reason for a failure in one line of limited length; if verbose, first where it arose."""
    line = str(reason)
    if _verbosity.verbose and isinstance(reason, BaseException):
        say_always("".join(traceback.format_exception(reason)).rstrip())
    say_always(
        "error: " + (line if len(line) <= _MAX_CHARACTERS else line[:_MAX_CHARACTERS] + " ...").replace("\n", "\\n")
    )


def say_empty(dataset: Dataset, scenes: Iterable[Scene]) -> None:
    """Print a line for each scene that is skipped because it has no key frames."""
    for scene in scenes:
        if not dataset.samples(scene):
            say(f"skipped: scene '{scene.name}' has no key frames")


def emit(value: Any) -> None:
    """Print a JSON object to stdout; numbers that are not finite become null.

    Raises:
        DataError: if stdout cannot be written, for example on a full disk.
        typer.Exit: with 141, the exit code of SIGPIPE, if the reader has closed the pipe.
    """
    try:
        print(json.dumps(_plain(value), indent=2, allow_nan=False), flush=True)
    except OSError as error:
        # Python flushes the buffer again at exit; let that succeed.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if isinstance(error, BrokenPipeError):
            raise typer.Exit(141) from error
        raise DataError(f"standard output: cannot be written ({error.strerror})") from error


def _plain(value: Any) -> Any:
    """Return a copy without NaN and infinity, which JSON does not have."""
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not -1e308 < value < 1e308:
        return None
    return value


def choose_scene(dataset: Dataset, name: str | None) -> Scene:
    """Return the scene with a name or token; without a name the only scene.

    Raises:
        NotFoundError: if there is no such scene.
        DataError: if there is no name and several scenes or none.
    """
    if name is not None:
        return dataset.scene(name)
    if len(dataset.scenes) == 1:
        return dataset.scenes[0]
    if not dataset.scenes:
        raise DataError(f"{dataset.root}: no scenes")
    names = ", ".join(scene.name for scene in dataset.scenes[:_MAX_LISTED])
    more = f" and {len(dataset.scenes) - _MAX_LISTED} more" if len(dataset.scenes) > _MAX_LISTED else ""
    raise DataError(f"{dataset.root}: expected --scene, one of {names}{more}")


def choose_source(root: Path, name: str | None, truth: str | None = None) -> str:
    """Return the source of maps with a name; without a name the only one, or the ground truth among several.

    A name without maps is returned too: reading a map reports what there is. A choice among several is told. `truth`
    is the source that the maps are compared with: it is not chosen.

    Raises:
        DataError: if there is no name, and no maps, or several sources without ground truth.
    """
    from appocc.bevmap import map_sources

    if name is not None:
        return name
    sources = [each for each in map_sources(root) if each != truth]
    chosen = sources if len(sources) == 1 else [each for each in sources if each == "groundtruth"]
    if chosen:
        others = ", ".join(each for each in sources if each != chosen[0])
        if others:
            say(f"maps of {chosen[0]}; there are also {others} (--bev)")
        return chosen[0]
    if sources:
        raise DataError(f"{root}: expected --bev, one of {', '.join(sources)}")
    beside = f" beside {truth}" if truth else ""
    how = f"make them with: appocc infer {root} --out {root}/bev/predicted"
    raise DataError(f"{root}: no maps in {root / 'bev'}{beside}; {how}")


def say_stale(stale: Mapping[str, int]) -> None:
    """Print how many existing results were regenerated, by reason."""
    if stale:
        say(f"regenerated: {'; '.join(f'{count} ({reason})' for reason, count in stale.items())}")


# The progress bars that are shown: one display, with a line for each.
_shown: list[Progress] = []


@contextmanager
def progress(title: str, total: float | None) -> Iterator[Callable[[float], None]]:
    """Show a progress bar on stderr; the block gets a function that advances it by a number of steps.

    A total of None means an unknown length. A bar within the block of another one is a line below it.
    """
    if _shown:
        task = _shown[0].add_task(title, total=total)
        try:
            yield lambda steps: _shown[0].advance(task, steps)
        finally:
            _shown[0].remove_task(task)
        return
    with _display() as bar:
        _shown.append(bar)
        task = bar.add_task(title, total=total)
        try:
            yield lambda steps: bar.advance(task, steps)
        finally:
            _shown.clear()


def _display() -> Progress:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    console = Console(stderr=True)
    # In a file or a pipe the bar would only print an empty line.
    return Progress(*columns, console=console, transient=True, disable=_verbosity.quiet or not console.is_terminal)
