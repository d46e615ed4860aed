"""Rising functions of one number, and their inverse: how far from the axis a lens puts what it sees."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from appocc.checks import FloatArray

Function = Callable[[FloatArray], FloatArray]
_STEPS = 4096
_NEWTON_STEPS = 6
# A pixel on the very rim of a picture rounds to either side of it.
_RIM = 1 + 1e-12


def rising_until(slope: Function, most: float) -> float:
    """Return how far from 0, at most `most`, a function rises whose slope is given."""
    places = np.linspace(0.0, most, _STEPS)
    falls = np.flatnonzero(~(slope(places) > 0))
    return float(places[max(int(falls[0]) - 1, 0)]) if len(falls) else most


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


class RisingFunction:
    """A function that rises from 0 on [0, most], with its inverse by a table and Newton's method.

    Attributes:
        most: end of its range.
        largest: its value there.
    """

    def __init__(self, value: Function, slope: Function, most: float) -> None:
        """Tabulate the function."""
        self._value, self._slope = value, slope
        self._places = np.linspace(0.0, most, _STEPS)
        self._values = value(self._places)
        self.most, self.largest = most, float(self._values[-1])

    def __call__(self, places: FloatArray) -> FloatArray:
        """Return the values at places (N,); NaN beyond `most`."""
        return np.where(places <= self.most * _RIM, self._value(np.minimum(places, self.most)), np.nan)

    def inverse(self, values: FloatArray) -> FloatArray:
        """Return the places (N,) of values (N,); NaN where there is none."""
        there = (values >= 0) & (values <= self.largest * _RIM)
        wanted = np.where(there, values, 0.0)
        places = np.interp(wanted, self._values, self._places)
        for _ in range(_NEWTON_STEPS):
            slope = self._slope(places)
            step = (self._value(places) - wanted) / np.where(slope > 0, slope, np.inf)
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
