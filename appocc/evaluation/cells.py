"""Cells of one map against the truth: overlap of the layers and errors of the colours, by groups of cells."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from appocc.bevmap import CLASSES, BEVMap
from appocc.checks import BoolArray, FloatArray
from appocc.grid import BEVGrid

RINGS_M = ((0, 10), (10, 20), (20, 30), (30, 40))
RINGS = tuple(f"{low}-{high} m" for low, high in RINGS_M)
# "seen" by a camera or not is told apart only where the map says it.
GROUPS = ("all", *RINGS, "seen", "unseen")


class CellCounts(NamedTuple):
    """Sums over cells; those of several maps add up.

    Attributes:
        overlap: (T, G, 3, 2) cells of each class that are on in both and in either, at each threshold; `GROUPS`.
        colour: (G, 4, 2) sum of |RGB| (0..255, mean of the channels) and number of cells: all, road, vehicle, lane.
        known: (2,) cells whose colour the truth knows, and those of them that the map knows too.
    """

    overlap: FloatArray
    colour: FloatArray
    known: FloatArray

    @classmethod
    def nothing(cls, thresholds: int) -> CellCounts:
        """Sums over no map, for a number of thresholds."""
        groups, classes = len(GROUPS), len(CLASSES)
        return cls(np.zeros((thresholds, groups, classes, 2)), np.zeros((groups, classes + 1, 2)), np.zeros(2))

    def plus(self, other: CellCounts) -> CellCounts:
        """The sums over both."""
        return CellCounts(*(a + b for a, b in zip(self, other, strict=True)))


def group_masks(grid: BEVGrid, within: BoolArray, seen: BoolArray | None) -> BoolArray:
    """(G, X, Y) which cells each of `GROUPS` has.

    Args:
        grid: of the maps.
        within: (X, Y) cells that are looked at at all.
        seen: (X, Y) cells that a camera sees; None where that is not known.
    """
    away = np.linalg.norm(grid.centres(), axis=-1)
    rings = [(away >= low) & (away < high) for low, high in RINGS_M]
    nothing = np.zeros(grid.shape, np.bool_)
    sight = [nothing, nothing] if seen is None else [seen, ~seen]
    return np.stack([np.ones(grid.shape, np.bool_), *rings, *sight]) & within


def count_cells(made: BEVMap, truth: BEVMap, masks: BoolArray, thresholds: FloatArray) -> CellCounts:
    """Compare two maps on one grid.

    Layers are compared where the truth knows the class, so that every map is judged on the same cells; a class of
    which the map knows no cell is not judged. Colours are compared where both know them, by the true class.

    Args:
        made: the map that is judged.
        truth: the map it should be.
        masks: (G, X, Y) the groups of cells.
        thresholds: (T, 3) least probability of a cell that is on, by class.
    """
    flat = masks.reshape(len(masks), -1).astype(np.float64)  # G XY
    on = truth.occupancy >= 0.5
    judged = truth.occupancy_valid & made.occupancy_valid.any(axis=(1, 2), keepdims=True)
    overlap = np.zeros((len(thresholds), len(masks), len(CLASSES), 2))
    for t, least in enumerate(thresholds):
        mine = made.occupancy >= least[:, None, None]
        for k, cells in enumerate((mine & on & judged, (mine | on) & judged)):
            overlap[t, :, :, k] = flat @ cells.reshape(len(CLASSES), -1).T
    known = made.appearance_valid & truth.appearance_valid
    error = colour_error(made, truth)
    colour = np.zeros((len(masks), len(CLASSES) + 1, 2))
    for c, cells in enumerate((known, *(known & layer & truth.occupancy_valid[i] for i, layer in enumerate(on)))):
        chosen = flat[:, cells.ravel()]
        colour[:, c] = np.stack([chosen @ error[cells], chosen.sum(axis=1)], axis=1)
    told = np.array([(truth.appearance_valid & masks[0]).sum(), (known & masks[0]).sum()], dtype=np.float64)
    return CellCounts(overlap, colour, told)


def colour_error(made: BEVMap, truth: BEVMap) -> FloatArray:
    """(X, Y) mean absolute difference of the three channels, 0..255."""
    return np.asarray(np.abs(made.appearance.astype(np.float64) - truth.appearance).mean(axis=0))


def ious(overlap: FloatArray) -> dict[str, float]:
    """Intersection over union by class of sums (3, 2); NaN where neither map has a cell."""
    return {name: share(*overlap[i]) for i, name in enumerate(CLASSES)}


def l1_by_class(colour: FloatArray) -> dict[str, float]:
    """Mean colour error by class of sums (4, 2)."""
    return {name: share(*colour[i + 1]) for i, name in enumerate(CLASSES)}


def share(part: float, whole: float) -> float:
    """A ratio; NaN of nothing."""
    return float(part / whole) if whole else float("nan")


def threshold_rows(kept: Mapping[str, float] | None) -> FloatArray:
    """(T, 3) thresholds to count at: 0.5, and those kept with the maps, if any."""
    rows = [[0.5] * len(CLASSES)]
    if kept is not None:
        rows.append([kept[name] for name in CLASSES])
    return np.array(rows)
