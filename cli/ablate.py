"""`appocc ablate`: the paper's ablation tables on your own data, by many small trainings; resumable."""

from __future__ import annotations

import signal
from pathlib import Path
from typing import Annotated

import typer

from cli.common import JsonOption, VersionOption, emit, in_path, local_out_path, local_path, say
from cli.train import stop_on_signal, training_progress


def ablate(
    config: Annotated[
        Path,
        typer.Argument(metavar="CONFIG", parser=local_path, help="YAML file, or the shipped configuration small."),
    ],
    test: Annotated[
        Path, typer.Option("--test", parser=in_path, metavar="ROOT", help="Dataset root to evaluate all rows on.")
    ],
    overrides: Annotated[
        list[str] | None,
        typer.Argument(metavar="KEY=VALUE", help="Override a value of CONFIG for all rows, such as train.steps=600."),
    ] = None,
    out: Annotated[Path, typer.Option("--out", parser=local_out_path, help="Folder of the runs and tables.")] = Path(
        "runs/ablation"
    ),
    seeds: Annotated[int, typer.Option(min=1, max=99, help="Seeds of the default network; others get one.")] = 3,
    only: Annotated[
        str | None, typer.Option(metavar="REGEX", help="Run only rows whose name matches, such as '^appocc-360'.")
    ] = None,
    budget_minutes: Annotated[
        float | None,
        typer.Option(min=0.0, help="Stop training after this time; the same command continues."),
    ] = None,
    scenes: Annotated[
        int | None, typer.Option(min=1, help="Evaluate on this many random scenes of ROOT; default: all.")
    ] = None,
    version: VersionOption = None,
    as_json: JsonOption = False,
) -> None:
    """Compare occupancy alone with occupancy and appearance, and networks with each other, at equal small budgets.

    A row sets network, grid, appearance and seed; CONFIG sets the rest. The same command resumes a stopped study.

    Exit 0: done, or out of time; 1: a training diverged; 2: bad input; 130: interrupted.

    Example: appocc ablate small train.minutes=10 --test runs/sets/test --out runs/ablation
    """
    import time

    from appocc.ablation.rows import chosen_rows
    from appocc.ablation.run import REPORT_FILE, build_study, study_results
    from appocc.nuscenes import Dataset
    from appocc.training.config import read_config
    from appocc.training.configs import config_path
    from appocc.training.run import StoppedError

    end = time.monotonic() + 60 * budget_minutes if budget_minutes is not None else float("inf")
    study = build_study(read_config(config_path(config), overrides or ()), Dataset(test, version), scenes, seeds, out)
    chosen = chosen_rows(study.rows, only)
    with training_progress() as monitor, stop_on_signal(monitor) as caught:
        try:
            outcomes = study.run(chosen, monitor, lambda: time.monotonic() > end)
        except StoppedError as stopped:
            monitor.on_message("stopped; the same command resumes")
            raise typer.Exit(128 + (caught or [signal.SIGINT])[0]) from stopped
    if as_json:
        emit(study_results(study, outcomes))
    done, failed = (sum(each.state == state for each in outcomes) for state in ("done", "failed"))
    diverged = f", {failed} diverged" if failed else ""
    say(f"{out / REPORT_FILE}: {done} of {len(outcomes)} rows done{diverged}")
    if failed:
        raise typer.Exit(1)
