"""Speed of training steps: loading, planning, and the step itself, on the device that `appocc train` would take.

    python -m benchmarks.training_speed ROOT [--batch 32 64] [--steps 20] [--parts depth memory objects]

ROOT is a simulated dataset of some scenes. For each batch size: milliseconds of loading a batch in one process, of
its view-transform plan, of a forward and backward pass, and of launching that (the rest is waiting for the device);
samples per second; and the memory of a GPU. Medians of `--steps` steps.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import torch

from appocc.environment import has_bfloat16
from appocc.training.batches.prefetcher import PreparedBatch, prefetch
from appocc.training.config import Config, read_config
from appocc.training.losses import compute_losses
from appocc.training.process_group import ProcessGroup, join_process_group
from appocc.training.run import TrainingMonitor, TrainingSetup
from appocc.training.session import prepare_training

_CONFIG = Path(__file__).parents[1] / "configs" / "release.yaml"
_DIFFERENT = 2  # batches that the steps alternate between


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("root", type=Path)
    parser.add_argument("--batch", type=int, nargs="+", default=[32, 64])
    parser.add_argument("--steps", type=int, default=20)
    parser.add_argument("--parts", nargs="*", default=["depth", "memory", "objects"])
    arguments = parser.parse_args()
    print(f"{'batch':>6}{'load':>8}{'plan':>8}{'step':>8}{'launch':>8}  samples/s  GiB")
    with tempfile.TemporaryDirectory() as packs, join_process_group("auto") as processes:
        for batch in arguments.batch:
            values = [f"data.train={arguments.root}", f"data.val={arguments.root}", f"data.packs={packs}"]
            values += [f"train.batch={batch}", f"parts=[{', '.join(arguments.parts)}]"]
            config = read_config(_CONFIG, values)
            setup = prepare_training(config, processes, TrainingMonitor())
            print(f"{batch:>6}{measure(setup, config, processes, arguments.steps)}", flush=True)


def measure(setup: TrainingSetup, config: Config, processes: ProcessGroup, steps: int) -> str:
    """Return a line of the table."""
    device = processes.device
    model = setup.model.to(device, memory_format=torch.channels_last).train()  # type: ignore[call-overload]
    with prefetch(setup.train.batches(0, 1), model, device, _DIFFERENT) as batches:
        prepared = list(batches)

    def step(given: PreparedBatch) -> None:
        with torch.autocast(device.type, torch.bfloat16, enabled=has_bfloat16(device.type)):
            output = model(given.batch.images, given.plan, given.batch.past)
        terms = compute_losses(output, given.batch.truth, config.losses, model.spec.grid)
        torch.autograd.backward(terms.total(config.losses))
        model.zero_grad()

    loads = setup.train.batches(_DIFFERENT, 0)
    load_ms = timed(lambda number: next(loads), 3)[0]
    plan_ms = timed(lambda number: model.plan(prepared[number % _DIFFERENT].batch.rigs), 3)[0]
    timed(lambda number: step(prepared[number % _DIFFERENT]), _DIFFERENT)
    step_ms, launch_ms = timed(lambda number: step(prepared[number % _DIFFERENT]), steps)
    rate = config.train.batch / step_ms * 1000
    memory = torch.cuda.max_memory_allocated() / 2**30 if processes.on_gpu else float("nan")
    return f"{load_ms:8.0f}{plan_ms:8.0f}{step_ms:8.0f}{launch_ms:8.0f}{rate:11.1f}{memory:5.1f}"


def wait() -> None:
    """Wait for the GPU, if there is one."""
    if torch.cuda.is_available():
        torch.cuda.synchronize()


def timed(job: Callable[[int], object], count: int) -> tuple[float, float]:
    """Return the median milliseconds of a job until the device is done, and until it returns."""
    whole, returned = [], []
    for number in range(count):
        wait()
        start = time.perf_counter()
        job(number)
        returned.append(1000 * (time.perf_counter() - start))
        wait()
        whole.append(1000 * (time.perf_counter() - start))
    return statistics.median(whole), statistics.median(returned)


if __name__ == "__main__":
    main()
