"""Rising functions of one number, and their inverse: how far from the axis a lens puts what it sees."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Protocol

import numpy as np

from appocc.checks import FloatArray

_STEPS = 4096
_NEWTON_STEPS = 6
# A pixel on the very rim of a picture rounds to either side of it.
_RIM = 1 + 1e-12


class Rising(Protocol):
    """A function that rises from 0, up to the end `most` of its range."""

    @property
    def most(self) -> float:
        """End of its range."""
        ...

    def __call__(self, places: FloatArray) -> FloatArray:
        """Return the values at places (N,); NaN beyond `most`."""
        ...

    def inverse(self, values: FloatArray) -> FloatArray:
        """Return the places (N,) of values (N,); NaN where there is none."""
        ...


class RisingFunction(ABC):
    """A function that rises from 0 on [0, most], with its inverse by a table and Newton's method.

    Attributes:
        most: end of its range.
        largest: its value there.
    """

    def __init__(self, most: float) -> None:
        """Tabulate the function as far as it rises, at most up to `most`."""
        places = np.linspace(0.0, most, _STEPS)
        falls = np.flatnonzero(~(self.slope(places) > 0))
        self.most = float(places[max(int(falls[0]) - 1, 0)]) if len(falls) else most
        self._places = np.linspace(0.0, self.most, _STEPS)
        self._values = self.value(self._places)
        self.largest = float(self._values[-1])

    @abstractmethod
    def value(self, places: FloatArray) -> FloatArray:
        """Return the values at places (N,) of its range."""

    @abstractmethod
    def slope(self, places: FloatArray) -> FloatArray:
        """Return the derivatives at places (N,), not positive where it does not rise."""

    def __call__(self, places: FloatArray) -> FloatArray:
        """Return the values at places (N,); NaN beyond `most`."""
        return np.where(places <= self.most * _RIM, self.value(np.minimum(places, self.most)), np.nan)

    def inverse(self, values: FloatArray) -> FloatArray:
        """Return the places (N,) of values (N,); NaN where there is none."""
        there = (values >= 0) & (values <= self.largest * _RIM)
        wanted = np.where(there, values, 0.0)
        places = np.interp(wanted, self._values, self._places)
        for _ in range(_NEWTON_STEPS):
            slope = self.slope(places)
            step = (self.value(places) - wanted) / np.where(slope > 0, slope, np.inf)
            places = np.clip(places - step, 0.0, self.most)
        return np.where(there, places, np.nan)


class Inverted:
    """The inverse of a rising function, as a rising function on [0, most]."""

    def __init__(self, function: RisingFunction, most: float) -> None:
        """Invert a function; the range ends at its largest value, if that is less than `most`."""
        self._function = function
        self.most = min(most, function.largest)

    def __call__(self, places: FloatArray) -> FloatArray:
        """Return the values at places (N,); NaN beyond `most`."""
        return np.where(places <= self.most * _RIM, self._function.inverse(np.minimum(places, self.most)), np.nan)

    def inverse(self, values: FloatArray) -> FloatArray:
        """Return the places (N,) of values (N,); NaN where there is none."""
        places = self._function(values)
        return np.where(places <= self.most * _RIM, places, np.nan)
