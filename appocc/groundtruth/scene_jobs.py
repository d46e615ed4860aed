"""Parallel jobs of one scene with progress."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

from appocc.workers import Engine, in_order

T = TypeVar("T")
R = TypeVar("R")


class SceneJobs:
    """Runs the jobs of one scene on a pool, in order, with progress in samples."""

    def __init__(self, pool: Engine | None, advance: Callable[[float], None], samples: int) -> None:
        """Start a scene of a number of samples; `advance` is the progress callback in samples."""
        self._pool, self._advance, self._remaining = pool, advance, float(samples)

    def run(self, job: Callable[[T], R], items: Sequence[T], share: float) -> list[R]:
        """Return the results in the order of the items; the job takes a share of the remaining progress."""
        return list(self.run_lazily(job, items, share))

    def run_lazily(self, job: Callable[[T], R], items: Sequence[T], share: float) -> Iterator[R]:
        """Yield the results one by one, for results too large to keep in memory."""
        part = self._remaining * share
        for result in in_order(self._pool, job, items, chunksize=2):
            yield result
            self._advance(part / len(items))
        self._remaining -= part if items else 0.0
