"""The training loop: read `train` from top to bottom.

Micro-batch number m of a training is one and the same samples, changes and random numbers, whenever it is computed:
so a training that was interrupted goes on to the same numbers.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Iterator
from contextlib import nullcontext
from copy import deepcopy

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn.parallel import DistributedDataParallel

from appocc.errors import DataError
from appocc.models.base import BEVModel, ModelOutput
from appocc.training.checkpoint import Progress, load_state, save_state, states
from appocc.training.config import Config
from appocc.training.curves import draw_curves
from appocc.training.losses import losses
from appocc.training.metrics import Tally, Validation
from appocc.training.prefetcher import Fed, feed
from appocc.training.process_group import World
from appocc.training.run import Parts, Run, StoppedError, TrainingError, Watcher
from appocc.training.run_folder import RunFolder
from appocc.training.schedule import Budget, ema_decay, learning_rate

_LINE_EVERY = 10  # steps of a line of metrics
_DRAW_EVERY_S = 60.0
# A running mean of losses so many times that of the first steps will not come back.
_DIVERGED, _FIRST_STEPS = 5.0, 10


def train(
    parts: Parts, config: Config, folder: RunFolder, world: World, watcher: Watcher, resume: bool = False
) -> Progress:
    """Train until the budget is spent; the best weights and the curves lie in the run's folder then.

    Raises:
        DataError: if the folder cannot be used as it is told.
        TrainingError: if the loss is no number any more, or grows without end.
        StoppedError: if the watcher asked for it.
    """
    run = _begin(parts, config, folder, world, watcher, resume)
    progress, wrapped, watcher.running = run.progress, _wrapped(run.model, world), True
    stream = parts.train.batches(progress.step * config.train.accumulate, config.data.workers)
    with feed(stream, run.model, world.device) as batches:
        while True:
            due = progress.step % config.evaluate.every_steps == 0 and progress.step > 0
            if (due or run.share >= 1) and progress.evaluated < progress.step:
                _evaluate(run)
            if run.share >= 1:
                break
            _step(run, wrapped, batches)
            if _save_due(run):
                _save(run)
            if run.stopping:
                _save(run)
                raise StoppedError(f"stopped after step {progress.step}; {folder.path} goes on with --resume")
    _save(run)
    return progress


def _begin(parts: Parts, config: Config, folder: RunFolder, world: World, watcher: Watcher, resume: bool) -> Run:
    """Everything in place for the next step; the latest state that can be read is taken up."""
    if config.train.threads is not None:
        torch.set_num_threads(config.train.threads)
    folder.check(config, resume)
    model = parts.model.to(world.device, memory_format=torch.channels_last)  # type: ignore[call-overload]
    average = deepcopy(model).eval().requires_grad_(False)
    seconds = None if config.train.minutes is None else 60 * config.train.minutes
    budget = Budget(config.train.steps, seconds)
    run = Run(config, parts, world, folder, watcher, model, average, _optimizer(model, config), budget)
    if resume:
        run.progress = _taken_up(run)
    if world.size > 1:
        torch.distributed.barrier()  # else the first would make the folder before others have looked for it
    if world.first:
        folder.go_on(run.progress) if resume else folder.begin(config)
        if config.save.tensorboard:
            folder.show(run.progress.step)
    return run


def _taken_up(run: Run) -> Progress:
    """The progress of the latest state that can be read; with none, the beginning."""
    for path in states(run.folder.path):
        try:
            return load_state(path, run.model, run.average, run.optimizer)
        except DataError as error:
            run.watcher.say(f"left aside: {error}")
    return Progress()


def _optimizer(model: nn.Module, config: Config) -> torch.optim.Optimizer:
    """AdamW that lets norms and biases, which have one axis, keep their size."""
    parameters = [each for each in model.parameters() if each.requires_grad]
    groups = [
        {"params": [each for each in parameters if each.ndim > 1], "weight_decay": config.train.weight_decay},
        {"params": [each for each in parameters if each.ndim <= 1], "weight_decay": 0.0},
    ]
    return torch.optim.AdamW([group for group in groups if group["params"]], lr=config.train.lr)


def _wrapped(model: BEVModel, world: World) -> nn.Module:
    """The network as its gradients are to be taken: averaged over the processes, if there are several."""
    return model if world.size == 1 else DistributedDataParallel(model)


def _step(run: Run, wrapped: nn.Module, batches: Iterator[Fed]) -> None:
    """One step of the optimizer, and of the average."""
    config, progress, world = run.config.train, run.progress, run.world
    start, waited, planned, samples = time.perf_counter(), 0.0, 0.0, 0
    for group in run.optimizer.param_groups:
        group["lr"] = learning_rate(run.share, config.lr, config.warmup)
    run.model.train()
    told: list[Tensor] = []
    for micro in range(config.accumulate):
        asked = time.perf_counter()
        batch, plan, plan_s = next(batches)
        waited, planned = waited + time.perf_counter() - asked - plan_s, planned + plan_s
        samples += len(batch.number)
        torch.manual_seed(_seed(config.seed, (progress.step * config.accumulate + micro) * world.size + world.rank))
        last = micro == config.accumulate - 1
        # Gradients travel between processes once a step.
        with wrapped.no_sync() if isinstance(wrapped, DistributedDataParallel) and not last else nullcontext():
            with _autocast(run):
                output: ModelOutput = wrapped(batch.images, plan)
            terms = losses(output, batch.truth, run.config.losses)
            total = terms.total(run.config.losses)
            torch.autograd.backward(total / config.accumulate)
        told.append(torch.stack([*(getattr(terms, name) for name in terms.names()), total]).detach())
    length = nn.utils.clip_grad_norm_(run.model.parameters(), config.clip)
    values = torch.cat(
        [torch.stack(told).mean(0), length[None], length.new_tensor([waited, float(run.watcher.stop)])]
    )
    *parts, total_loss, norm, waited, stop = world.mean(values).tolist()
    run.agreed = stop > 0  # all processes stop after the same step
    named = dict(zip(terms.names(), parts, strict=True)) | {"total": total_loss}
    _check_loss(run, named, norm)  # before the weights are moved
    run.optimizer.step()
    run.optimizer.zero_grad()
    progress.step += 1
    _follow(run)
    taken = float(world.mean(torch.tensor([time.perf_counter() - start], device=world.device)))
    progress.seconds += taken
    samples *= world.size
    times = {"seconds": taken, "waited": waited, "planned": planned}
    _note(run, named, {"grad_norm": norm, "samples": samples, **times})


def _seed(seed: int, number: int) -> int:
    """Seed of the random numbers of a micro-batch; torch looks at 32 bits only."""
    return int(np.random.SeedSequence([seed, number]).generate_state(1)[0])


def _autocast(run: Run) -> torch.autocast:
    """The precision that was asked for."""
    return torch.autocast(run.world.device.type, torch.bfloat16, enabled=run.config.train.precision == "bf16")


def _follow(run: Run) -> None:
    """Move the averaged weights towards the weights."""
    decay = ema_decay(run.progress.step, run.config.train.ema)
    averages: list[Tensor] = list(run.average.parameters())
    torch._foreach_lerp_(averages, [weight.detach() for weight in run.model.parameters()], 1 - decay)


def _check_loss(run: Run, named: dict[str, float], norm: float) -> None:
    """Stop where nothing good can come any more.

    Raises:
        TrainingError: if the losses or gradients are no numbers, or the loss has grown without end.
    """
    progress, total = run.progress, named["total"]
    best = f"{run.folder.best} stays" if progress.best_step >= 0 else "nothing was evaluated yet"
    hint = f"try a lower train.lr or train.precision=fp32 ({best})"
    if not all(map(math.isfinite, [*named.values(), norm])):
        text = ", ".join(f"{name} {value:.3g}" for name, value in [*named.items(), ("gradient", norm)])
        raise TrainingError(f"step {progress.step + 1}: expected finite losses and gradients, got {text}; {hint}")
    if len(progress.first_losses) < _FIRST_STEPS:
        progress.first_losses.append(total)
        progress.smooth_loss = sum(progress.first_losses) / len(progress.first_losses)
        return
    progress.smooth_loss += 0.1 * (total - progress.smooth_loss)
    reference = sum(progress.first_losses) / _FIRST_STEPS
    if progress.smooth_loss > _DIVERGED * reference:
        grown = f"has grown from {reference:.3g} to {progress.smooth_loss:.3g}"
        raise TrainingError(f"step {progress.step + 1}: expected a loss that falls, but it {grown}; {hint}")


def _note(run: Run, named: dict[str, float], more: dict[str, float]) -> None:
    """Keep what a step did; every so many steps their means become a line of metrics."""
    progress, window = run.progress, run.progress.window
    window.append(named | more)
    rate = sum(step["samples"] for step in window) / sum(step["seconds"] for step in window)
    shown = " ".join(f"{name} {named[name]:.3f}" for name in named if name != "total")
    run.watcher.step(run.share, f"step {progress.step}, {rate:.1f} samples/s, {shown}")
    if progress.step % _LINE_EVERY and run.share < 1:
        return
    mean = {name: sum(step[name] for step in window) / len(window) for name in window[0]}
    line = {"kind": "train", "step": progress.step, "share": run.share, "lr": run.optimizer.param_groups[0]["lr"]}
    line |= {"losses": {name: mean[name] for name in named}, "grad_norm": mean["grad_norm"], "samples_per_s": rate}
    # Of the time of steps: what was spent waiting for the loader, and on plans (on a GPU a thread makes them).
    line |= {f"{name}_share": mean[key] / mean["seconds"] for name, key in (("wait", "waited"), ("plan", "planned"))}
    line["seconds"] = progress.seconds
    window.clear()
    if run.world.first:
        run.folder.add(line)


def _evaluate(run: Run) -> None:
    """Look at the averaged weights on the validation set; keep them where they are the best so far."""
    progress, start = run.progress, time.perf_counter()
    _estimate_norms(run)
    found = validate(run)
    seconds = time.perf_counter() - start
    progress.evaluated = progress.step
    better = found.mean_iou > progress.best_iou
    if better:
        progress.best_step, progress.best_iou = progress.step, found.mean_iou
    if not run.world.first:
        return
    if better:
        run.parts.save(run.folder.best, run.average, _card(run, found))
    run.folder.add({"kind": "val", "step": progress.step, **found.as_json(), "evaluation_s": seconds})
    if run.share >= 1 or time.monotonic() - run.drawn_at > _DRAW_EVERY_S:
        draw_curves(run.folder.lines(), run.folder.curves)
        run.drawn_at = time.monotonic()
    shown = ", ".join(f"{name} {100 * value:.1f}" for name, value in found.best_iou.items())
    colour = "" if found.colour_l1 is None else f"; colour L1 {found.colour_l1:.1f}"
    run.watcher.say(f"step {progress.step}: IoU {shown}{colour}{' (best so far)' if better else ''}")


@torch.no_grad()
def _estimate_norms(run: Run) -> None:
    """Estimate the statistics of batch norms for the averaged weights, over the first training batches.

    Those that followed the weights belong to other weights: with them an average can score near nothing.
    """
    buffers = zip(run.average.buffers(), run.model.buffers(), strict=True)
    for average, value in buffers:
        average.copy_(value)
    norms = [each for each in run.average.modules() if isinstance(each, nn.modules.batchnorm._BatchNorm)]
    if not norms or not run.config.evaluate.norm_batches:
        return
    momenta = [norm.momentum for norm in norms]
    for norm in norms:
        norm.reset_running_stats()
        norm.momentum = None  # the plain mean over the batches
        norm.train()
    stream = run.parts.train.batches(0, run.config.data.workers)
    count = -(-run.config.evaluate.norm_batches // run.world.size)
    with feed(stream, run.average, run.world.device, count) as batches:
        for batch, plan, _ in batches:
            _ask_to_stop(run)
            with _autocast(run):
                run.average(batch.images, plan)
    for norm, momentum in zip(norms, momenta, strict=True):
        for statistic in (norm.running_mean, norm.running_var):
            if statistic is not None:
                statistic.copy_(run.world.mean(statistic.clone()))
        norm.momentum = momentum
        norm.eval()


@torch.no_grad()
def validate(run: Run) -> Validation:
    """What the averaged weights do on the validation set, all processes together."""
    config, tally = run.config, Tally(run.world.device)
    stream = run.parts.val.in_order(config.evaluate.samples, config.data.workers)
    with feed(stream, run.average, run.world.device) as batches:
        for batch, plan, _ in batches:
            _ask_to_stop(run)
            with _autocast(run):
                output: ModelOutput = run.average(batch.images, plan)
            terms = losses(output, batch.truth, config.losses)
            tally.add(output, batch.truth, terms, terms.total(config.losses))
    return tally.reduced().validation()


def _ask_to_stop(run: Run) -> None:
    """End an evaluation that nobody waits for; it is done again on resume."""
    if run.stopping:
        _save(run)
        raise StoppedError(f"stopped at step {run.progress.step}; {run.folder.path} goes on with --resume")


def _card(run: Run, found: Validation) -> dict[str, str]:
    """What one must know of weights to use them, and to judge them; texts, of which all but the name are JSON.

    Nothing that a clock says: the same training makes the same file.
    """
    values = {
        "thresholds": list(found.thresholds.values()),
        "validation": found.as_json(),
        "step": run.progress.step,
        "training": run.config.model_dump(mode="json"),
        "versions": run.folder.versions(),
    }
    return {"network": run.config.network, **{name: json.dumps(value) for name, value in values.items()}}


def _save_due(run: Run) -> bool:
    """Whether the state should be written now."""
    due = run.progress.step % run.config.save.every_steps == 0
    return due or time.monotonic() - run.saved_at > 60 * run.config.save.every_minutes


def _save(run: Run) -> None:
    """Write the state, in the first process."""
    if run.world.first:
        save_state(run.folder.path, run.progress, run.model, run.average, run.optimizer)
    run.saved_at = time.monotonic()
