"""CPU time of the rendering stages."""

from __future__ import annotations

import time
from collections import Counter, defaultdict
from collections.abc import Iterator
from contextlib import contextmanager


class RenderProfile:
    """CPU seconds of this process by stage, and counts of rays and pixels, since the last reset."""

    def __init__(self) -> None:
        """Start with empty counters."""
        self.cpu_s: defaultdict[str, float] = defaultdict(float)
        self.count: Counter[str] = Counter()

    def clear(self) -> None:
        """Reset all counters."""
        self.cpu_s.clear()
        self.count.clear()

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Add the CPU time of the block to a stage."""
        started = time.process_time()
        yield
        self.cpu_s[name] += time.process_time() - started
