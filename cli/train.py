"""`appocc train`: train a network; a resumed run gives the same numbers as an uninterrupted one."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Annotated

import typer

from cli.common import Interrupted, JsonOption, emit, is_quiet, local_out_path, local_path, say

if TYPE_CHECKING:
    from appocc.training.run import TrainingMonitor


def train(
    config: Annotated[
        Path,
        typer.Argument(
            metavar="CONFIG", parser=local_path, help="YAML file, or a shipped one: small, release or recording."
        ),
    ],
    overrides: Annotated[
        list[str] | None,
        typer.Argument(metavar="KEY=VALUE", help="Override values of CONFIG: train.lr=1e-3."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", parser=local_out_path, help="Folder of the run; default: runs/NAME-OF-CONFIG."),
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Continue the run in this folder.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Train a network; with torchrun, on several GPUs. Exit 0: done; 1: diverged; 2: bad input; 130: interrupted.

    All keys: docs/configuration.md.

    Example: appocc train small data.train=SIM data.val=VAL --out runs/first
    """
    from appocc.training.config import read_config
    from appocc.training.configs import config_path
    from appocc.training.run import StoppedError
    from appocc.training.run_folder import RunFolder
    from appocc.training.session import run_training

    settings, folder = read_config(config_path(config), overrides or ()), RunFolder(out or Path("runs") / config.stem)
    with training_progress() as monitor, stop_on_signal(monitor) as caught:
        try:
            summary = run_training(settings, folder, resume, monitor)
        except StoppedError as stopped:
            monitor.on_message(str(stopped))
            raise typer.Exit(128 + (caught or [signal.SIGINT])[0]) from stopped
        except Interrupted as ended:
            raise Interrupted(ended.number, () if resume or not folder.config.is_file() else ["--resume"]) from ended
    if int(os.environ.get("RANK", "0")):
        return
    if as_json:
        emit(summary)
    best = summary["best"]
    scores = ", ".join(f"{name} {100 * (value or 0):.1f}" for name, value in best["best_iou"].items())
    say(f"{folder.best}: step {best['step']}, IoU {scores} (percent, on validation); curves in {folder.curves}")


@contextmanager
def training_progress() -> Iterator[TrainingMonitor]:
    """Show a training on stderr: a bar with rate, time left and losses, and a line per evaluation."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    from appocc.training.run import TrainingMonitor

    if int(os.environ.get("RANK", "0")):  # only the first process prints
        yield TrainingMonitor()
        return
    columns = (BarColumn(20), TaskProgressColumn(), TimeRemainingColumn(), TextColumn("{task.description}"))
    console = Console(stderr=True)
    with Progress(*columns, console=console, transient=True, disable=is_quiet() or not console.is_terminal) as bar:
        task = bar.add_task("preparing", total=1.0)
        yield TrainingMonitor(lambda share, text: bar.update(task, completed=share, description=text), say)


@contextmanager
def stop_on_signal(monitor: TrainingMonitor) -> Iterator[list[int]]:
    """Stop the training after the current step on Ctrl-C or SIGTERM.

    The block gets a list that collects the numbers of the signals.

    Raises:
        Interrupted: on a second signal, or before the first step.
    """
    caught: list[int] = []

    def stop(number: int, frame: FrameType | None) -> None:
        if caught or not monitor.running:
            raise Interrupted(number)
        caught.append(number)
        monitor.stop_requested = True

    before = {number: signal.signal(number, stop) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield caught
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
