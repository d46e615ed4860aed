"""Parity of an exported file with its network, over inputs, repeated runs and numbers of threads."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import zip_longest
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from appocc.camera import CameraRig
from appocc.errors import AppoccError
from appocc.export.clips import Clip, run_clip
from appocc.export.graph import SEEN, run_network
from appocc.export.runtimes import Inputs, Outputs, Runner
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
        limit: largest difference that rounding explains.
        largest: largest |difference| of each output over all inputs, runs and threads, relative to the size of the
            output: 1 for probabilities and colours, else its largest number; infinite if not finite.
        between_runs: largest difference between outputs of the file for one input, over runs and threads.
        inputs: names of the inputs.
        frames: largest number of consecutive frames of an input, each with the memory of the one before.
        runs: number of runs of each input with each number of threads.
        threads: numbers of threads.
        eager_s: median time of the network in torch with one thread, seconds.
        exported_s: median time of the file with one thread, seconds.
    """

    limit: float
    largest: dict[str, float]
    between_runs: float
    inputs: tuple[str, ...]
    frames: int
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
            "frames": self.frames,
            "runs": self.runs,
            "threads": list(self.threads),
            "median_ms": {"torch": self.eager_s * 1e3, "exported": self.exported_s * 1e3},
        }

    def lines(self) -> list[str]:
        """Return the report as lines of text."""
        far = ", ".join(f"{name} {value:.1e}" for name, value in self.largest.items())
        count = len(self.inputs) * self.runs * len(self.threads)
        ratio = self.eager_s / self.exported_s
        frames = f" of up to {self.frames} consecutive frames" if self.frames > 1 else ""
        return [
            f"largest difference: {far} (limit {self.limit:.1e}), between runs {self.between_runs:.1e}",
            f"{count} runs: {len(self.inputs)} inputs{frames}, each {self.runs} times with "
            f"{', '.join(map(str, self.threads))} threads",
            f"median, one thread: torch {self.eager_s * 1e3:.0f} ms, exported {self.exported_s * 1e3:.0f} ms "
            f"({ratio:.2f} times faster)",
        ]


def parity_limit(model: BEVModel, frames: int = 1) -> float:
    """Return the largest difference that rounding in float32 explains, relative to the size of an output.

    Over consecutive frames a network with memory is one network with the layers of all frames in sequence. A position
    in a memory of n cells rounds by up to n eps, and bilinear sampling passes this on: it counts as n² terms.

    Args:
        model: network.
        frames: number of consecutive frames.
    """
    terms = count_terms(model)
    if model.parts.memory:
        terms = frames * (terms + max(model.spec.grid.halved().shape) ** 2)
    return rounding(terms)


def torch_runner(model: BEVModel, rig: CameraRig) -> Runner:
    """Return a runner for the network in torch, for images of a rig after `fit_image`."""
    plan = model.plan([rig])
    seen = plan.seen[0].numpy()

    def run(inputs: Inputs) -> Outputs:
        with torch.inference_mode():
            found = run_network(model, plan, {name: torch.from_numpy(value) for name, value in inputs.items()})
        return {**{name: value.numpy() for name, value in found.items()}, SEEN: seen}

    return run


def measure_parity(
    network: Runner,
    open_file: Callable[[int], Runner],
    clips: Mapping[str, Clip],
    limit: float,
    runs: int,
    advance: Callable[[float], None],
) -> Parity:
    """Run a file repeatedly and compare every output with that of the network.

    Args:
        network: runner of the network, the reference.
        open_file: opens the file with a number of threads.
        clips: clips by name; at least one.
        limit: see `parity_limit`.
        runs: number of runs of each clip with each number of threads.
        advance: called with the number of finished steps, of len(THREADS) in total.
    """
    first = next(iter(clips.values()))
    expected = {name: run_clip(network, clip) for name, clip in clips.items()}
    largest = dict.fromkeys(next(iter(expected.values()))[0], 0.0)
    between, earlier = 0.0, dict[str, list[Outputs]]()
    seconds: dict[str, list[float]] = {"eager": [], "exported": []}
    for threads in THREADS:
        exported = open_file(threads)
        exported(first[0])  # warm-up
        for _ in range(runs):
            for name, clip in clips.items():
                start = time.perf_counter()
                found = run_clip(exported, clip)
                if threads == 1:
                    seconds["exported"].append((time.perf_counter() - start) / len(found))
                for output, value in _differences(expected[name], found).items():
                    largest[output] = max(largest[output], value)
                between = max(between, *_differences(earlier.setdefault(name, found), found).values())
            if threads == 1:
                with one_thread():
                    start = time.perf_counter()
                    network(first[0])
                    seconds["eager"].append(time.perf_counter() - start)
        advance(1)
    medians = {which: statistics.median(values) for which, values in seconds.items()}
    return Parity(
        limit=limit,
        largest=largest,
        between_runs=between,
        inputs=tuple(clips),
        frames=max(map(len, clips.values())),
        runs=runs,
        threads=THREADS,
        eager_s=medians["eager"],
        exported_s=medians["exported"],
    )


def _differences(expected: Sequence[Outputs], found: Sequence[Outputs]) -> dict[str, float]:
    """Return the largest |difference| of each output over the frames of a clip, relative to its size.

    The size is the largest number of the output, at least 1. The difference is infinite if an output is missing, of
    another shape or not finite.
    """
    differences: dict[str, float] = {}
    for wanted, got in zip_longest(expected, found, fillvalue=dict[str, NDArray[Any]]()):
        for name, want in wanted.items():
            differences[name] = max(differences.get(name, 0.0), _difference(want, got.get(name)))
    return differences


def _difference(want: NDArray[Any], got: NDArray[Any] | None) -> float:
    if got is None or got.shape != want.shape or got.dtype != want.dtype:
        return float("inf")
    size = max(1.0, float(np.abs(want.astype(np.float64)).max()))
    value = float(np.abs(got.astype(np.float64) - want).max()) / size
    return value if np.isfinite(value) else float("inf")


@contextmanager
def one_thread() -> Iterator[None]:
    """Limit torch to one thread."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)
