"""Metrics of training steps: kept on the device, copied to the host at the log interval, checked and logged.

Copying them waits for the device, and averaging them over the processes is an all-reduce; neither is done every step.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import torch

from appocc.training.run import TrainingError, TrainingRun

_LOG_EVERY_STEPS = 10
# The training diverged if the running mean of the loss exceeds this multiple of the mean of the first steps.
_DIVERGED, _FIRST_STEPS = 5.0, 10


def fetches_every_step(run: TrainingRun) -> bool:
    """Whether metrics are on the host already: for one process on a CPU, fetching them is free."""
    return run.processes.size == 1 and run.processes.device.type == "cpu"


def fetch_due(run: TrainingRun) -> bool:
    """Whether to fetch the metrics in this step: where they are logged, and before evaluations and checkpoints.

    All processes agree, since it depends on the step only.
    """
    step, config = run.progress.step + 1, run.config
    due = (step % every == 0 for every in (_LOG_EVERY_STEPS, config.evaluate.every_steps, config.save.every_steps))
    return fetches_every_step(run) or any(due) or step == config.train.steps


def fetch_metrics(run: TrainingRun) -> None:
    """Copy all pending metrics to the host, averaged over the processes: one all-reduce, one wait for the device.

    Raises:
        TrainingError: if losses or gradients are not finite, or the loss diverges.
    """
    pending, processes, progress = run.pending, run.processes, run.progress
    if not pending:
        return
    values = torch.stack([each.values for each in pending]).double()
    stop = float(run.monitor.stop_requested)
    times = [[each.seconds, each.waited_s, each.plan_s, stop] for each in pending]
    clocks = torch.tensor(times, dtype=torch.float64, device=processes.device)
    rows = processes.mean(torch.cat([values, clocks], 1)).tolist()
    run.stop_agreed = rows[-1][-1] > 0  # all processes stop after the same step
    run.pending = []
    for each, (*losses, total, norm, seconds, waited_s, plan_s, _) in zip(pending, rows, strict=True):
        named = dict(zip(each.names, losses, strict=True)) | {"total": total}
        _check_loss(run, each.step, named, norm)
        progress.seconds += seconds
        times_s = {"seconds": seconds, "waited": waited_s, "planned": plan_s}
        progress.window.append({**named, "grad_norm": norm, "samples": each.samples * processes.size, **times_s})
    shown = " ".join(f"{name} {named[name]:.3f}" for name in named if name != "total")
    run.status = f", {_samples_per_s(run):.1f} samples/s, {shown}"


def _samples_per_s(run: TrainingRun) -> float:
    """Return the training speed over the window of steps since the last log line."""
    window = run.progress.window
    return sum(step["samples"] for step in window) / sum(step["seconds"] for step in window)


def _check_loss(run: TrainingRun, step: int, named: Mapping[str, float], norm: float) -> None:
    """Stop a training that cannot recover.

    Raises:
        TrainingError: if losses or gradients are not finite, or the loss diverges.
    """
    progress, total = run.progress, named["total"]
    best = f"{run.folder.best} is kept" if progress.best_step >= 0 else "no weights were evaluated yet"
    hint = f"try a lower train.lr or train.precision=fp32 ({best})"
    if not all(map(math.isfinite, [*named.values(), norm])):
        text = ", ".join(f"{name} {value:.3g}" for name, value in [*named.items(), ("gradient", norm)])
        raise TrainingError(f"step {step}: expected finite losses and gradients, got {text}; {hint}")
    if len(progress.first_losses) < _FIRST_STEPS:
        progress.first_losses.append(total)
        progress.smooth_loss = sum(progress.first_losses) / len(progress.first_losses)
        return
    progress.smooth_loss += 0.1 * (total - progress.smooth_loss)
    reference = sum(progress.first_losses) / _FIRST_STEPS
    if progress.smooth_loss > _DIVERGED * reference:
        grown = f"has grown from {reference:.3g} to {progress.smooth_loss:.3g}"
        raise TrainingError(f"step {step}: expected a loss that falls, but it {grown}; {hint}")


def log_step(run: TrainingRun) -> None:
    """Report a step; every `_LOG_EVERY_STEPS` steps, write a line with the means of the metrics."""
    progress, window = run.progress, run.progress.window
    run.monitor.on_step(run.share, f"step {progress.step}{run.status}")
    if run.pending or (progress.step % _LOG_EVERY_STEPS and run.share < 1):
        return
    mean = {name: sum(step[name] for step in window) / len(window) for name in window[0]}
    times = ("seconds", "waited", "planned")
    losses = {name: value for name, value in mean.items() if name not in ("grad_norm", "samples", *times)}
    line = {"kind": "train", "step": progress.step, "share": run.share, "lr": run.optimizer.param_groups[0]["lr"]}
    line |= {"losses": losses, "grad_norm": mean["grad_norm"], "samples_per_s": _samples_per_s(run)}
    # Shares of the step time: waiting for data, and view-transform plans (on a GPU a thread makes them).
    line |= {f"{name}_share": mean[key] / mean["seconds"] for name, key in (("wait", "waited"), ("plan", "planned"))}
    line["seconds"] = progress.seconds
    window.clear()
    if run.processes.is_main:
        run.folder.append_metrics(line)
