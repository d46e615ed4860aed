"""Jobs of one scene, with progress."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

from appocc.workers import Pool, in_order

T = TypeVar("T")
R = TypeVar("R")


class Work:
    """Jobs of one scene, run in order on a pool, with progress in samples."""

    def __init__(self, pool: Pool | None, advance: Callable[[float], None], samples: int) -> None:
        """Begin with a scene of so many samples to be made; `advance` is called with parts of them."""
        self._pool, self._advance, self._left = pool, advance, float(samples)

    def done(self, job: Callable[[T], R], items: Sequence[T], share: float) -> list[R]:
        """Results of a job in the order of the items; it moves the bar by a share of what is left."""
        return list(self.each(job, items, share))

    def each(self, job: Callable[[T], R], items: Sequence[T], share: float) -> Iterator[R]:
        """The same one by one, for results that are too large to be kept."""
        part = self._left * share
        for result in in_order(self._pool, job, items, chunksize=2):
            yield result
            self._advance(part / len(items))
        self._left -= part if items else 0.0
