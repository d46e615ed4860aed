"""A bounded cache that several threads share."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from threading import Lock
from typing import Generic, TypeVar

K = TypeVar("K", bound=Hashable)
V = TypeVar("V")


class BoundedCache(Generic[K, V]):
    """The values used last, up to a total size."""

    def __init__(self, limit: int, size_of: Callable[[V], int] = lambda value: 1) -> None:
        """Begin empty.

        Args:
            limit: largest total size of the values.
            size_of: size of a value; by default each counts as 1.
        """
        self._limit, self._size_of = limit, size_of
        self._kept: OrderedDict[K, V] = OrderedDict()
        self._size = 0
        self._lock = Lock()

    def get(self, key: K, make: Callable[[], V]) -> V:
        """Return the value of a key, made if it is not kept; the lock is not held while it is made."""
        with self._lock:
            if key in self._kept:
                self._kept.move_to_end(key)
                return self._kept[key]
        value = make()
        with self._lock:
            if key not in self._kept:
                self._kept[key] = value
                self._size += self._size_of(value)
            while self._size > self._limit and len(self._kept) > 1:
                _, dropped = self._kept.popitem(last=False)
                self._size -= self._size_of(dropped)
        return value

    def __len__(self) -> int:
        """Number of values."""
        return len(self._kept)

    @property
    def size(self) -> int:
        """Total size of the values."""
        return self._size
