"""Does an exported file answer as the network does: over inputs, repeated runs and numbers of threads."""

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
from appocc.export.graph import SEEN, answers
from appocc.export.runtimes import Answers, Run
from appocc.models.base import BEVModel
from appocc.models.rounding import count_terms, rounding

THREADS = (1, 2, 4)


class ParityError(AppoccError):
    """An exported file does not answer as the network does."""

    exit_code = 1


@dataclass(frozen=True)
class Parity:
    """How far an exported file is from the network.

    Attributes:
        limit: the largest difference that rounding explains; answers are 0..1.
        largest: |difference| by output, over all inputs, runs and threads; infinite where an answer is not finite.
        between_runs: of the file's own answers to one input, over runs and threads.
        inputs: names of them.
        runs: of each input with each number of threads.
        threads: numbers of them.
        eager_s: median seconds of the network in torch, one thread.
        exported_s: median seconds of the file, one thread.
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
        """Whether every difference is within the limit."""
        return max(self.largest.values()) <= self.limit

    def as_json(self) -> dict[str, Any]:
        """For machines."""
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
        """For people."""
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


def limit_of(model: BEVModel) -> float:
    """How far a right file may be from a network: by the rounding of its sums in float32, of answers 0..1."""
    return rounding(count_terms(model))


def made_inputs(shape: tuple[int, ...], seed: int = 0) -> dict[str, Float32Array]:
    """Pictures (1, N, 3, H, W) that need no camera: noise, noise in large patches, and flat grey."""
    draw = np.random.default_rng(seed)
    patches = draw.random((*shape[:3], -(-shape[3] // 16), -(-shape[4] // 16)), dtype=np.float32)
    large = patches.repeat(16, axis=3).repeat(16, axis=4)[..., : shape[3], : shape[4]]
    return {
        "noise": draw.random(shape, dtype=np.float32),
        "patches": np.ascontiguousarray(large),
        "grey": np.full(shape, 0.5, np.float32),
    }


def eager(model: BEVModel, rig: CameraRig) -> Run:
    """The network as it is used in torch, on pictures of a rig's fitted cameras."""
    plan = model.plan([rig])
    seen = plan.seen[0].numpy()

    def run(images: Float32Array) -> Answers:
        with torch.inference_mode():
            output = model(torch.from_numpy(images), plan)
            told = answers(output.occupancy, output.appearance)
        return {**{name: value.numpy() for name, value in told.items()}, SEEN: seen}

    return run


def compare(
    network: Run,
    open_file: Callable[[int], Run],
    inputs: Mapping[str, Float32Array],
    limit: float,
    runs: int,
    advance: Callable[[float], None],
) -> Parity:
    """Run a file again and again and compare every answer with the network's.

    Args:
        network: what is right.
        open_file: the file, with a number of threads.
        inputs: pictures by name; at least one.
        limit: see `limit_of`.
        runs: of each input with each number of threads.
        advance: called with the number of steps done, of len(THREADS) in all.
    """
    first = next(iter(inputs.values()))
    expected = {name: network(images) for name, images in inputs.items()}
    largest = dict.fromkeys(next(iter(expected.values())), 0.0)
    between, earlier = 0.0, dict[str, Answers]()
    seconds: dict[str, list[float]] = {"eager": [], "exported": []}
    for threads in THREADS:
        exported = open_file(threads)
        exported(first)  # the first run prepares, and would spoil the times
        for _ in range(runs):
            for name, images in inputs.items():
                start = time.perf_counter()
                found = exported(images)
                if threads == 1:
                    seconds["exported"].append(time.perf_counter() - start)
                for output, value in _apart(expected[name], found).items():
                    largest[output] = max(largest[output], value)
                between = max(between, *_apart(earlier.setdefault(name, found), found).values())
            if threads == 1:
                with _one_thread():
                    start = time.perf_counter()
                    network(first)
                    seconds["eager"].append(time.perf_counter() - start)
        advance(1)
    medians = {which: statistics.median(values) for which, values in seconds.items()}
    return Parity(limit, largest, between, tuple(inputs), runs, THREADS, medians["eager"], medians["exported"])


def _apart(expected: Answers, found: Answers) -> dict[str, float]:
    """Largest |difference| by output; infinite where one is missing, of another shape or not finite."""
    far = {}
    for name, want in expected.items():
        got = found.get(name)
        if got is None or got.shape != want.shape or got.dtype != want.dtype:
            far[name] = float("inf")
            continue
        value = float(np.abs(got.astype(np.float64) - want).max())
        far[name] = value if np.isfinite(value) else float("inf")
    return far


@contextmanager
def _one_thread() -> Iterator[None]:
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)
