"""Comparison of the cells of a map with the truth: overlap of the layers and colour errors, by groups of cells."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from appocc.bevmap import CLASSES, BEVMap
from appocc.checks import BoolArray, FloatArray
from appocc.grid import BEVGrid

RINGS_M = ((0, 10), (10, 20), (20, 30), (30, 40))
RINGS = tuple(f"{low}-{high} m" for low, high in RINGS_M)
# "seen" and "unseen" are empty if the map does not store which cells a camera sees.
GROUPS = ("all", *RINGS, "seen", "unseen")


class CellCounts(NamedTuple):
    """Sums over cells; counts of several maps can be added.

    Attributes:
        overlap: (T, G, 3, 2) intersection and union in cells, by threshold, group (`GROUPS`) and class.
        colour: (G, 4, 2) sum of |RGB| (0..255, mean of the channels) and number of cells: all, road, vehicle, lane.
        squared: (G, 2) sum of squared RGB errors (0..255, mean of the channels) and number of cells of any class.
        known: (2,) cells of known colour in the truth, and those of them with known colour in the map.
    """

    overlap: FloatArray
    colour: FloatArray
    squared: FloatArray
    known: FloatArray

    @classmethod
    def zeros(cls, thresholds: int) -> CellCounts:
        """Return zero counts for a number of thresholds."""
        groups, classes = len(GROUPS), len(CLASSES)
        colour = np.zeros((groups, classes + 1, 2))
        return cls(np.zeros((thresholds, groups, classes, 2)), colour, np.zeros((groups, 2)), np.zeros(2))

    def plus(self, other: CellCounts) -> CellCounts:
        """Return the sum of both counts."""
        return CellCounts(*(a + b for a, b in zip(self, other, strict=True)))


def cell_group_masks(grid: BEVGrid, within: BoolArray, seen: BoolArray | None) -> BoolArray:
    """Return the (G, X, Y) masks of `GROUPS`.

    Args:
        grid: grid of the maps.
        within: (X, Y) cells to evaluate.
        seen: (X, Y) cells that a camera sees; None if unknown.
    """
    distance = np.linalg.norm(grid.centres(), axis=-1)
    rings = [(distance >= low) & (distance < high) for low, high in RINGS_M]
    empty = np.zeros(grid.shape, np.bool_)
    sight = [empty, empty] if seen is None else [seen, ~seen]
    return np.stack([np.ones(grid.shape, np.bool_), *rings, *sight]) & within


def count_cells(predicted: BEVMap, truth: BEVMap, masks: BoolArray, thresholds: FloatArray) -> CellCounts:
    """Compare two maps on one grid.

    Occupancy is compared where the true class is known, so that all maps are evaluated on the same cells; a class
    without any valid cell in the map is skipped. Colours are compared where both are known, by the true class.

    Args:
        predicted: evaluated map.
        truth: true map.
        masks: (G, X, Y) groups of cells.
        thresholds: (T, 3) lowest probability of an occupied cell, by class.
    """
    flat = masks.reshape(len(masks), -1).astype(np.float64)  # G XY
    on = truth.occupancy >= 0.5
    compared = truth.occupancy_valid & predicted.occupancy_valid.any(axis=(1, 2), keepdims=True)
    overlap = np.zeros((len(thresholds), len(masks), len(CLASSES), 2))
    for t, least in enumerate(thresholds):
        mine = predicted.occupancy >= least[:, None, None]
        for k, cells in enumerate((mine & on & compared, (mine | on) & compared)):
            overlap[t, :, :, k] = flat @ cells.reshape(len(CLASSES), -1).T
    known = predicted.appearance_valid & truth.appearance_valid
    difference = predicted.appearance.astype(np.float64) - truth.appearance
    error, squares = np.abs(difference).mean(axis=0), (difference**2).mean(axis=0)
    colour = np.zeros((len(masks), len(CLASSES) + 1, 2))
    for c, cells in enumerate((known, *(known & layer & truth.occupancy_valid[i] for i, layer in enumerate(on)))):
        chosen = flat[:, cells.ravel()]
        colour[:, c] = np.stack([chosen @ error[cells], chosen.sum(axis=1)], axis=1)
    of_a_class = known & (on & truth.occupancy_valid).any(axis=0)
    squared = np.stack([flat[:, of_a_class.ravel()] @ squares[of_a_class], flat @ of_a_class.ravel()], axis=1)
    totals = np.array([(truth.appearance_valid & masks[0]).sum(), (known & masks[0]).sum()], dtype=np.float64)
    return CellCounts(overlap, colour, squared, totals)


def colour_error(predicted: BEVMap, truth: BEVMap) -> FloatArray:
    """Return the (X, Y) mean absolute difference of the three channels, 0..255."""
    return np.asarray(np.abs(predicted.appearance.astype(np.float64) - truth.appearance).mean(axis=0))


def ious(overlap: FloatArray) -> dict[str, float]:
    """Return the IoU by class from sums (3, 2); NaN where neither map has a cell."""
    return {name: ratio(*overlap[i]) for i, name in enumerate(CLASSES)}


def l1_by_class(colour: FloatArray) -> dict[str, float]:
    """Return the mean colour error by class from sums (4, 2)."""
    return {name: ratio(*colour[i + 1]) for i, name in enumerate(CLASSES)}


def psnr(squared: FloatArray) -> float:
    """Return the peak signal-to-noise ratio in dB from a sum and a number (2,); NaN without cells or error."""
    error = ratio(*squared)
    return 10 * math.log10(255**2 / error) if error > 0 else math.nan


def ratio(part: float, whole: float) -> float:
    """Return part / whole; NaN if `whole` is 0."""
    return float(part / whole) if whole else float("nan")


def mean_of_known(values: Iterable[float]) -> float:
    """Return the mean of the finite values; NaN without any."""
    known = known_values(values)
    return float(known.mean()) if len(known) else float("nan")


def known_values(values: Iterable[float]) -> FloatArray:
    """Return the finite values."""
    array = np.array(list(values), dtype=np.float64)
    return array[np.isfinite(array)]


def threshold_rows(kept: Mapping[str, float] | None) -> FloatArray:
    """Return the (T, 3) thresholds: 0.5, and those stored with the maps, if any."""
    rows = [[0.5] * len(CLASSES)]
    if kept is not None:
        rows.append([kept[name] for name in CLASSES])
    return np.array(rows)
