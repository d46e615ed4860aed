"""Parity of an exported file with its network, over inputs, repeated runs and numbers of threads."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch

from appocc.camera import CameraRig
from appocc.checks import Float32Array
from appocc.errors import AppoccError
from appocc.export.graph import SEEN, named_outputs
from appocc.export.runtimes import Outputs, Runner
from appocc.models.base import BEVModel
from appocc.models.rounding import count_terms, rounding

THREADS = (1, 2, 4)


class ParityError(AppoccError):
    """The outputs of an exported file differ from those of the network."""

    exit_code = 1


@dataclass(frozen=True, kw_only=True)
class Parity:
    """Differences between an exported file and its network.

    Attributes:
        limit: largest difference that rounding explains; outputs are 0..1.
        largest: largest |difference| of each output over all inputs, runs and threads; infinite if not finite.
        between_runs: largest difference between outputs of the file for one input, over runs and threads.
        inputs: names of the inputs.
        runs: number of runs of each input with each number of threads.
        threads: numbers of threads.
        eager_s: median time of the network in torch with one thread, seconds.
        exported_s: median time of the file with one thread, seconds.
    """

    limit: float
    largest: dict[str, float]
    between_runs: float
    inputs: tuple[str, ...]
    runs: int
    threads: tuple[int, ...]
    eager_s: float
    exported_s: float

    @property
    def holds(self) -> bool:
        """Whether all differences are within the limit."""
        return max(self.largest.values()) <= self.limit

    def as_json(self) -> dict[str, Any]:
        """Return the values for JSON."""
        return {
            "limit": self.limit,
            "largest_difference": self.largest,
            "between_runs": self.between_runs,
            "inputs": list(self.inputs),
            "runs": self.runs,
            "threads": list(self.threads),
            "median_ms": {"torch": self.eager_s * 1e3, "exported": self.exported_s * 1e3},
        }

    def lines(self) -> list[str]:
        """Return the report as lines of text."""
        far = ", ".join(f"{name} {value:.1e}" for name, value in self.largest.items())
        count = len(self.inputs) * self.runs * len(self.threads)
        ratio = self.eager_s / self.exported_s
        return [
            f"largest difference: {far} (limit {self.limit:.1e}), between runs {self.between_runs:.1e}",
            f"{count} runs: {len(self.inputs)} inputs, each {self.runs} times with "
            f"{', '.join(map(str, self.threads))} threads",
            f"median, one thread: torch {self.eager_s * 1e3:.0f} ms, exported {self.exported_s * 1e3:.0f} ms "
            f"({ratio:.2f} times faster)",
        ]


def parity_limit(model: BEVModel) -> float:
    """Return the largest difference that rounding in float32 explains, for outputs 0..1 of a network."""
    return rounding(count_terms(model))


def synthetic_inputs(shape: tuple[int, ...], seed: int = 0) -> dict[str, Float32Array]:
    """Return synthetic images (1, N, 3, H, W) by name: noise, noise in large patches, and uniform grey."""
    draw = np.random.default_rng(seed)
    patches = draw.random((*shape[:3], -(-shape[3] // 16), -(-shape[4] // 16)), dtype=np.float32)
    large = patches.repeat(16, axis=3).repeat(16, axis=4)[..., : shape[3], : shape[4]]
    return {
        "noise": draw.random(shape, dtype=np.float32),
        "patches": np.ascontiguousarray(large),
        "grey": np.full(shape, 0.5, np.float32),
    }


def torch_runner(model: BEVModel, rig: CameraRig) -> Runner:
    """Return a runner for the network in torch, for images of a rig after `fit_image`."""
    plan = model.plan([rig])
    seen = plan.seen[0].numpy()

    def run(images: Float32Array) -> Outputs:
        with torch.inference_mode():
            output = model(torch.from_numpy(images), plan)
            named = named_outputs(output.occupancy, output.appearance)
        return {**{name: value.numpy() for name, value in named.items()}, SEEN: seen}

    return run


def measure_parity(
    network: Runner,
    open_file: Callable[[int], Runner],
    inputs: Mapping[str, Float32Array],
    limit: float,
    runs: int,
    advance: Callable[[float], None],
) -> Parity:
    """Run a file repeatedly and compare every output with that of the network.

    Args:
        network: runner of the network, the reference.
        open_file: opens the file with a number of threads.
        inputs: images by name; at least one.
        limit: see `parity_limit`.
        runs: number of runs of each input with each number of threads.
        advance: called with the number of finished steps, of len(THREADS) in total.
    """
    first = next(iter(inputs.values()))
    expected = {name: network(images) for name, images in inputs.items()}
    largest = dict.fromkeys(next(iter(expected.values())), 0.0)
    between, earlier = 0.0, dict[str, Outputs]()
    seconds: dict[str, list[float]] = {"eager": [], "exported": []}
    for threads in THREADS:
        exported = open_file(threads)
        exported(first)  # warm-up
        for _ in range(runs):
            for name, images in inputs.items():
                start = time.perf_counter()
                found = exported(images)
                if threads == 1:
                    seconds["exported"].append(time.perf_counter() - start)
                for output, value in _differences(expected[name], found).items():
                    largest[output] = max(largest[output], value)
                between = max(between, *_differences(earlier.setdefault(name, found), found).values())
            if threads == 1:
                with _one_thread():
                    start = time.perf_counter()
                    network(first)
                    seconds["eager"].append(time.perf_counter() - start)
        advance(1)
    medians = {which: statistics.median(values) for which, values in seconds.items()}
    return Parity(
        limit=limit,
        largest=largest,
        between_runs=between,
        inputs=tuple(inputs),
        runs=runs,
        threads=THREADS,
        eager_s=medians["eager"],
        exported_s=medians["exported"],
    )


def _differences(expected: Outputs, found: Outputs) -> dict[str, float]:
    """Return the largest |difference| of each output; infinite if one is missing, of another shape or not finite."""
    differences = {}
    for name, want in expected.items():
        got = found.get(name)
        if got is None or got.shape != want.shape or got.dtype != want.dtype:
            differences[name] = float("inf")
            continue
        value = float(np.abs(got.astype(np.float64) - want).max())
        differences[name] = value if np.isfinite(value) else float("inf")
    return differences


@contextmanager
def _one_thread() -> Iterator[None]:
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)
