"""Pairs of an evaluated and a true map of a sample, cropped to the same cells, with extra arrays of their files."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from appocc.bevmap import BEVMap, bev_folder, bev_path
from appocc.checks import BoolArray, IntArray
from appocc.errors import DataError
from appocc.files import read_file, zip_arrays
from appocc.files.questions import files_there
from appocc.grid import BEVGrid
from appocc.nuscenes.records import Sample

# Key frames in a job of a worker.
FRAMES_AT_ONCE = 4


class MapPair(NamedTuple):
    """Two maps on one grid.

    Attributes:
        predicted: evaluated map.
        truth: true map.
        instance: (X, Y) index of the vehicle of each cell, in simulated truth; None otherwise.
        seen: (X, Y) cells that a camera sees, in predicted maps; None otherwise.
    """

    predicted: BEVMap
    truth: BEVMap
    instance: IntArray | None
    seen: BoolArray | None


def read_map_pair(root: Path, source: str, against: str, token: str, ahead: bool) -> MapPair:
    """Read the maps of a sample; with `ahead` only their cells with x >= 0.

    Raises:
        DataError: if a map is missing or damaged, or the grids differ.
    """
    paths = [bev_path(root, name, token) for name in (source, against)]
    predicted, truth = (BEVMap.load(path) for path in paths)
    seen, instance = (_extra_array(path, name) for path, name in zip(paths, ("seen", "instance"), strict=True))
    if ahead:
        seen, instance = _crop_ahead(predicted.grid, seen), _crop_ahead(truth.grid, instance)
        predicted, truth = (_crop_map_ahead(bev) for bev in (predicted, truth))
    if predicted.grid != truth.grid:
        expected, got = (bev.grid.as_array().tolist() for bev in (truth, predicted))
        hint = "; try --setting 180" if _crop_map_ahead(truth).grid == predicted.grid else ""
        raise DataError(f"{paths[0]}: expected the grid {expected} of {paths[1]}, got {got}{hint}")
    shapes = {array.shape for array in (seen, instance) if array is not None}
    if shapes - {truth.grid.shape}:
        raise DataError(f"{paths[0]}: expected 'seen' and 'instance' of shape {truth.grid.shape}, got {shapes}")
    return MapPair(
        predicted,
        truth,
        None if instance is None else instance.astype(np.int64),
        None if seen is None else seen.astype(np.bool_),
    )


def check_maps_exist(root: Path, source: str, samples: list[Sample]) -> None:
    """Check that every sample has a map.

    Raises:
        DataError: if a map is missing.
    """
    folder = bev_folder(root, source)
    names = {bev_path(root, source, sample.token).name: sample.token for sample in samples}
    there = files_there(folder, names)
    missing = [token for name, token in names.items() if name not in there]
    if missing:
        how = {"groundtruth": f"appocc groundtruth {root}", "exact": "appocc simulate"}.get(source)
        how = how or f"appocc infer {root} --out {folder}"
        first = f"{missing[0]}.npz is the first"
        raise DataError(
            f"{folder}: {len(missing)} of {len(samples)} samples have no BEV map ({first}); make them with: {how}"
        )


def _extra_array(path: Path, name: str) -> NDArray[np.generic] | None:
    """Read an extra array of a map file; None if the file has none."""
    packed = read_file(path)
    try:
        with zip_arrays(packed) as data:
            return data.get(name)
    except Exception as error:  # as in `BEVMap.load`
        raise DataError(f"{path}: damaged BEV map ({error})") from error


def _first_ahead(grid: BEVGrid) -> int:
    """Return the index of the first row of cells with x >= 0."""
    return min(max(int(np.ceil(-grid.x_min_m / grid.cell_m - 1e-6)), 0), grid.shape[0] - 1)


def _crop_ahead(grid: BEVGrid, cells: NDArray[np.generic] | None) -> NDArray[np.generic] | None:
    return None if cells is None else cells[..., _first_ahead(grid) :, :]


def _crop_map_ahead(bev: BEVMap) -> BEVMap:
    """Crop a map to its cells with x >= 0, the grid of the 180 degree setting."""
    first = _first_ahead(bev.grid)
    if not first:
        return bev
    g = bev.grid
    return BEVMap(
        BEVGrid(round(g.x_min_m + first * g.cell_m, 9), g.x_max_m, g.y_min_m, g.y_max_m, g.cell_m),
        bev.occupancy[:, first:],
        bev.occupancy_valid[:, first:],
        bev.appearance[:, first:],
        bev.appearance_valid[first:],
        bev.meta,
    )
