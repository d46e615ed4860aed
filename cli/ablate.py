"""`appocc ablate`: the paper's tables on one's own data, by many small trainings; goes on where it was ended."""

from __future__ import annotations

import signal
from pathlib import Path
from typing import Annotated

import typer

from cli.common import JsonOption, VersionOption, emit, out_path, say
from cli.train import stoppable, training_monitor


def ablate(
    config: Annotated[Path, typer.Argument(metavar="CONFIG", help="YAML file, or small, which is shipped.")],
    test: Annotated[Path, typer.Option("--test", metavar="ROOT", help="Dataset root that all rows are judged on.")],
    overrides: Annotated[
        list[str] | None,
        typer.Argument(metavar="KEY=VALUE", help="Replace what it says: train.steps=600; for all rows alike."),
    ] = None,
    out: Annotated[Path, typer.Option("--out", parser=out_path, help="Folder of the runs and the tables.")] = Path(
        "runs/ablation"
    ),
    seeds: Annotated[int, typer.Option(min=1, max=99, help="Seeds of the default network; others have one.")] = 3,
    only: Annotated[
        str | None, typer.Option(metavar="REGEX", help="Run only the rows whose names it is found in: '^appocc-360'.")
    ] = None,
    budget_minutes: Annotated[
        float | None,
        typer.Option(min=0.0, help="No training begins or goes on after so many minutes."),
    ] = None,
    scenes: Annotated[
        int | None, typer.Option(min=1, help="Judge on so many scenes of ROOT, drawn once, not on all.")
    ] = None,
    version: VersionOption = None,
    as_json: JsonOption = False,
) -> None:
    """Compare occupancy alone with occupancy + appearance, and networks with each other, at equal small budgets.

    The row says network, setting, appearance and seed; CONFIG says all else. The same command goes on.

    Exit 0: done, or the time is up; 1: a training diverged; 2: bad input; 130: interrupted.

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
    with training_monitor() as monitor, stoppable(monitor) as caught:
        try:
            outcomes = study.run(chosen, monitor, lambda: time.monotonic() > end)
        except StoppedError as stopped:
            monitor.on_message("stopped; the same command goes on")
            raise typer.Exit(128 + (caught or [signal.SIGINT])[0]) from stopped
    if as_json:
        emit(study_results(study, outcomes))
    done, failed = (sum(each.state == state for each in outcomes) for state in ("done", "failed"))
    ended = f", {failed} diverged" if failed else ""
    say(f"{out / REPORT_FILE}: {done} of {len(outcomes)} rows done{ended}")
    if failed:
        raise typer.Exit(1)
