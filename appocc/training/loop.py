"""Training loop; start reading at `train`.

Samples, augmentation and random numbers of micro-batch m depend on the seed and m only, so that an interrupted
training resumes to the same numbers.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from contextlib import nullcontext
from copy import deepcopy

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn.parallel import DistributedDataParallel

from appocc.environment import has_bfloat16, keep_freed_memory
from appocc.errors import DataError
from appocc.models.base import BEVModel, ModelOutput
from appocc.training.batches.prefetcher import PreparedBatch, prefetch
from appocc.training.checkpoint import TrainingProgress, list_checkpoints, load_checkpoint, save_checkpoint
from appocc.training.config import Config
from appocc.training.curves import plot_curves
from appocc.training.losses import compute_losses
from appocc.training.metrics import MetricAccumulator, ValidationMetrics
from appocc.training.process_group import ProcessGroup
from appocc.training.run import StepMetrics, StoppedError, TrainingMonitor, TrainingRun, TrainingSetup
from appocc.training.run_folder import RunFolder
from appocc.training.schedule import Budget, ema_decay, learning_rate
from appocc.training.step_metrics import fetch_due, fetch_metrics, log_step

_PLOT_EVERY_S = 60.0
# A threshold of 0 has no logit.
_LEAST_SCORE = 1e-3


def train(
    setup: TrainingSetup,
    config: Config,
    folder: RunFolder,
    processes: ProcessGroup,
    monitor: TrainingMonitor,
    resume: bool = False,
) -> TrainingProgress:
    """Train until the budget is spent; write the best weights and the curves to the run folder.

    Raises:
        DataError: if the run folder cannot be used.
        TrainingError: if the loss is not finite or diverges.
        StoppedError: if the monitor requested a stop.
    """
    run = _set_up(setup, config, folder, processes, monitor, resume)
    progress, model, monitor.running = run.progress, _distributed(run.model, processes), True
    first = progress.step * config.train.accumulate
    stream = setup.train.batches(first, config.data.workers, processes.on_gpu)
    with prefetch(stream, run.model, processes.device) as batches:
        while True:
            if _evaluation_due(run):
                _evaluate(run)
            if run.share >= 1:
                break
            _train_step(run, model, batches)
            if _checkpoint_due(run):
                _save_checkpoint(run)
            if run.should_stop:
                _save_checkpoint(run)
                raise StoppedError(f"stopped after step {progress.step}; use --resume to continue {folder.path}")
    _save_checkpoint(run)
    return progress


def _set_up(
    setup: TrainingSetup,
    config: Config,
    folder: RunFolder,
    processes: ProcessGroup,
    monitor: TrainingMonitor,
    resume: bool,
) -> TrainingRun:
    """Prepare the first step; on resume, load the latest readable checkpoint."""
    if config.train.threads is not None:
        torch.set_num_threads(config.train.threads)
    keep_freed_memory()
    folder.check(config, resume)
    model = setup.model.to(processes.device, memory_format=torch.channels_last)  # type: ignore[call-overload]
    seconds = None if config.train.minutes is None else 60 * config.train.minutes
    run = TrainingRun(
        config=config,
        setup=setup,
        processes=processes,
        folder=folder,
        monitor=monitor,
        model=model,
        ema_model=deepcopy(model).eval().requires_grad_(False),
        optimizer=_optimizer(model, config),
        budget=Budget(config.train.steps, seconds),
    )
    if resume:
        run.progress = _resume(run)
    if processes.size > 1:
        torch.distributed.barrier()  # the main process creates the folder after all others have checked it
    if processes.is_main:
        folder.clean_up(run.progress) if resume else folder.create(config)
        if config.save.tensorboard:
            folder.open_summary_writer(run.progress.step)
    return run


def _resume(run: TrainingRun) -> TrainingProgress:
    """Load the latest readable checkpoint and return its progress; start from step 0 if there is none."""
    for path in list_checkpoints(run.folder.path):
        try:
            return load_checkpoint(path, run.model, run.ema_model, run.optimizer)
        except DataError as error:
            run.monitor.on_message(f"checkpoint skipped: {error}")
    return TrainingProgress()


def _optimizer(model: nn.Module, config: Config) -> torch.optim.Optimizer:
    """Return AdamW with no weight decay on norms and biases, the parameters with one axis."""
    parameters = [each for each in model.parameters() if each.requires_grad]
    groups = [
        {"params": [each for each in parameters if each.ndim > 1], "weight_decay": config.train.weight_decay},
        {"params": [each for each in parameters if each.ndim <= 1], "weight_decay": 0.0},
    ]
    return torch.optim.AdamW([group for group in groups if group["params"]], lr=config.train.lr)


def _distributed(model: BEVModel, processes: ProcessGroup) -> nn.Module:
    """Wrap the network so that its gradients are averaged over the processes, if there are several."""
    return model if processes.size == 1 else DistributedDataParallel(model)


def _train_step(run: TrainingRun, model: nn.Module, batches: Iterator[PreparedBatch]) -> None:
    """Take one step of the optimizer and update the EMA."""
    config, progress = run.config.train, run.progress
    start, waited_s, plan_s, samples = time.perf_counter(), 0.0, 0.0, 0
    for group in run.optimizer.param_groups:
        group["lr"] = learning_rate(run.share, config.lr, config.warmup)
    run.model.train()
    values: list[Tensor] = []
    for micro in range(config.accumulate):
        requested = time.perf_counter()
        batch, plan, own_plan_s, _ = next(batches)
        waited_s, plan_s = waited_s + time.perf_counter() - requested - own_plan_s, plan_s + own_plan_s
        samples += len(batch.number)
        torch.manual_seed(_micro_batch_seed(run, micro))
        last = micro == config.accumulate - 1
        # Gradients are exchanged once per step, in the last micro-batch.
        with model.no_sync() if isinstance(model, DistributedDataParallel) and not last else nullcontext():
            with _autocast(run):
                output: ModelOutput = model(batch.images, plan, batch.past)
            terms = compute_losses(output, batch.truth, run.config.losses, run.model.spec.grid)
            total = terms.total(run.config.losses)
            torch.autograd.backward(total / config.accumulate)
        values.append(torch.stack([*(getattr(terms, name) for name in terms.names()), total]).detach())
    norm = nn.utils.clip_grad_norm_(run.model.parameters(), config.clip)
    measured = time.perf_counter()
    seconds = run.carried_s + measured - start
    row = torch.cat([torch.stack(values).mean(0), norm[None]])
    run.pending.append(
        StepMetrics(
            step=progress.step + 1,
            names=terms.names(),
            values=row,
            samples=samples,
            seconds=seconds,
            waited_s=waited_s,
            plan_s=plan_s,
        )
    )
    if fetch_due(run):
        fetch_metrics(run)  # raises before the weights of this step are updated
    run.optimizer.step()
    run.optimizer.zero_grad()
    progress.step += 1
    _update_ema(run)
    run.carried_s = time.perf_counter() - measured
    log_step(run)


def _micro_batch_seed(run: TrainingRun, micro: int) -> int:
    """Return the random seed of a micro-batch of the current step; torch uses 32 bits of it."""
    config, processes = run.config.train, run.processes
    number = (run.progress.step * config.accumulate + micro) * processes.size + processes.rank
    return int(np.random.SeedSequence([config.seed, number]).generate_state(1)[0])


def _autocast(run: TrainingRun) -> torch.autocast:
    """Return the context of the configured precision."""
    device, precision = run.processes.device.type, run.config.train.precision
    enabled = precision == "bf16" or (precision == "auto" and has_bfloat16(device))
    return torch.autocast(device, torch.bfloat16, enabled=enabled)


def _update_ema(run: TrainingRun) -> None:
    """Update the exponential moving average (EMA) of the weights."""
    # torch.optim.swa_utils.AveragedModel differs: it copies the weights at the first step, and its decay is constant.
    decay = ema_decay(run.progress.step, run.config.train.ema)
    averages: list[Tensor] = list(run.ema_model.parameters())
    torch._foreach_lerp_(averages, [weight.detach() for weight in run.model.parameters()], 1 - decay)


# Evaluation -------------------------------------------------------------------------------------------------------


def _evaluation_due(run: TrainingRun) -> bool:
    """Whether to evaluate the weights of this step: after some steps, and at the end."""
    progress = run.progress
    due = progress.step % run.config.evaluate.every_steps == 0 and progress.step > 0
    return (due or run.share >= 1) and progress.evaluated < progress.step


def _evaluate(run: TrainingRun) -> None:
    """Evaluate the EMA weights on the validation set; save them if they are the best so far."""
    progress, start = run.progress, time.perf_counter()
    _reestimate_batch_norm(run)
    found = validate(run)
    seconds = time.perf_counter() - start
    progress.evaluated = progress.step
    better = found.mean_iou > progress.best_iou
    if better:
        progress.best_step, progress.best_iou = progress.step, found.mean_iou
    if not run.processes.is_main:
        return
    if better:
        calibrated = run.ema_model.calibrated(list(found.calibration.values()), found.object_calibration)
        card = _model_card(run, found, calibrated is not None)
        run.setup.save(run.folder.best, calibrated or run.ema_model, card)
    run.folder.append_metrics({"kind": "val", "step": progress.step, **found.as_json(), "evaluation_s": seconds})
    if run.share >= 1 or time.monotonic() - run.plotted_at > _PLOT_EVERY_S:
        plot_curves(run.folder.read_metrics(), run.folder.curves)
        run.plotted_at = time.monotonic()
    shown = ", ".join(f"{name} {100 * value:.1f}" for name, value in found.best_iou.items())
    colour = "" if found.colour_l1 is None else f"; colour L1 {found.colour_l1:.1f}"
    boxes = "" if found.vehicle_f1 is None else f"; F1 of vehicles {100 * found.vehicle_f1:.1f}"
    run.monitor.on_message(f"step {progress.step}: IoU {shown}{boxes}{colour}{' (best so far)' if better else ''}")


@torch.no_grad()
def _reestimate_batch_norm(run: TrainingRun) -> None:
    """Re-estimate the batch-norm statistics for the EMA weights, over the first training batches.

    The running statistics of the trained weights do not fit the averaged ones.
    """
    # torch.optim.swa_utils.update_bn would switch dropout on, and neither averages over processes nor can be stopped.
    buffers = zip(run.ema_model.buffers(), run.model.buffers(), strict=True)
    for average, value in buffers:
        average.copy_(value)
    norms = [each for each in run.ema_model.modules() if isinstance(each, nn.modules.batchnorm._BatchNorm)]
    if not norms or not run.config.evaluate.norm_batches:
        return
    momenta = [norm.momentum for norm in norms]
    for norm in norms:
        norm.reset_running_stats()
        norm.momentum = None  # cumulative mean over the batches
        norm.train()
    stream = run.setup.train.batches(0, run.config.data.workers)
    count = -(-run.config.evaluate.norm_batches // run.processes.size)
    with prefetch(stream, run.ema_model, run.processes.device, count) as batches:
        for batch, plan, *_ in batches:
            _raise_if_stopped(run)
            with _autocast(run):
                run.ema_model(batch.images, plan, batch.past)
    for norm, momentum in zip(norms, momenta, strict=True):
        for statistic in (norm.running_mean, norm.running_var):
            if statistic is not None:
                statistic.copy_(run.processes.mean(statistic.clone()))
        norm.momentum = momentum
        norm.eval()


@torch.no_grad()
def validate(run: TrainingRun) -> ValidationMetrics:
    """Return the metrics of the EMA weights on the validation set, over all processes."""
    config, metrics = run.config, MetricAccumulator(run.processes.device, run.model.spec.grid)
    stream = run.setup.val.in_order(config.evaluate.samples, config.data.workers)
    with prefetch(stream, run.ema_model, run.processes.device) as batches:
        for number, (batch, plan, *_) in enumerate(batches, start=1):
            _raise_if_stopped(run)
            run.monitor.on_step(run.share, f"step {run.progress.step}: validating, batch {number}")
            with _autocast(run):
                output: ModelOutput = run.ema_model(batch.images, plan, batch.past)
            terms = compute_losses(output, batch.truth, config.losses, run.model.spec.grid)
            metrics.update(output, batch.truth, terms, terms.total(config.losses))
    return metrics.all_reduced().compute()


def _raise_if_stopped(run: TrainingRun) -> None:
    """Abort an evaluation if a stop is requested; resume repeats it.

    Raises:
        StoppedError: if a stop is requested.
    """
    if run.should_stop:
        _save_checkpoint(run)
        raise StoppedError(f"stopped at step {run.progress.step}; use --resume to continue {run.folder.path}")


def _model_card(run: TrainingRun, found: ValidationMetrics, calibrated: bool) -> dict[str, str]:
    """Return the model card of the weights, calibrated or not; all values but the network name are JSON.

    It holds no times: the same training writes the same file.
    """
    thresholds, least_score = dict(found.thresholds), found.object_threshold
    if calibrated and found.object_calibration is not None and least_score is not None:
        least_score = found.object_calibration.of(max(least_score, _LEAST_SCORE))
    if calibrated:
        thresholds = {name: found.calibration[name].of(value) for name, value in thresholds.items()}
    values = {
        "thresholds": [round(value, 4) for value in thresholds.values()],
        **({} if least_score is None else {"object_threshold": round(least_score, 4)}),
        "validation": found.as_json(),
        "step": run.progress.step,
        "training": run.config.model_dump(mode="json"),
        "versions": run.folder.versions(),
    }
    return {"network": run.config.network, **{name: json.dumps(value) for name, value in values.items()}}


# Checkpoints ------------------------------------------------------------------------------------------------------


def _checkpoint_due(run: TrainingRun) -> bool:
    """Whether to write a checkpoint now: after some steps or, once the metrics are fetched, some minutes.

    Also before an evaluation, which may fail and must not cost the training.
    """
    due = run.progress.step % run.config.save.every_steps == 0 or _evaluation_due(run)
    late = time.monotonic() - run.saved_at > 60 * run.config.save.every_minutes
    return due or (late and not run.pending)


def _save_checkpoint(run: TrainingRun) -> None:
    """Write a checkpoint in the main process; its weights have passed the checks of the metrics.

    Raises:
        TrainingError: if a pending loss is not finite or diverges.
    """
    fetch_metrics(run)  # pending in a single process only: several stop and save right after they fetched
    if run.processes.is_main:
        save_checkpoint(run.folder.path, run.progress, run.model, run.ema_model, run.optimizer)
    run.saved_at = time.monotonic()
