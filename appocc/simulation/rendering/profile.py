"""What the stages of rendering cost."""

from __future__ import annotations

import time
from collections import Counter, defaultdict
from collections.abc import Iterator
from contextlib import contextmanager


class Profile:
    """CPU seconds of this process by stage, and counts of rays and pixels, since it was cleared."""

    def __init__(self) -> None:
        """Begin with nothing."""
        self.cpu_s: defaultdict[str, float] = defaultdict(float)
        self.count: Counter[str] = Counter()

    def clear(self) -> None:
        """Begin anew."""
        self.cpu_s.clear()
        self.count.clear()

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Add the CPU time of what is done inside to a stage."""
        started = time.process_time()
        yield
        self.cpu_s[name] += time.process_time() - started
