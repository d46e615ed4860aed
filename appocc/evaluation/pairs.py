"""A sample's map and the true one, cut to the same cells, with what else their files hold."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from appocc.bevmap import BEVMap, bev_folder, bev_path
from appocc.checks import BoolArray, IntArray
from appocc.errors import DataError
from appocc.files import read_file, zip_arrays
from appocc.grid import BEVGrid
from appocc.nuscenes.records import Sample


class Pair(NamedTuple):
    """Two maps on one grid.

    Attributes:
        made: the map that is judged.
        truth: the map it should be.
        instance: (X, Y) whose each cell is, of simulated truth; None of other truth.
        seen: (X, Y) cells that a camera sees, of predictions; None of other maps.
    """

    made: BEVMap
    truth: BEVMap
    instance: IntArray | None
    seen: BoolArray | None


def read_pair(root: Path, source: str, against: str, token: str, ahead: bool) -> Pair:
    """Read the maps of a sample, only the cells with x >= 0 where only what lies `ahead` is wanted.

    Raises:
        DataError: if one is missing or damaged, or their grids differ.
    """
    paths = [bev_path(root, name, token) for name in (source, against)]
    made, truth = (BEVMap.load(path) for path in paths)
    seen, instance = (_more(path, name) for path, name in zip(paths, ("seen", "instance"), strict=True))
    if ahead:
        seen, instance = _ahead(made.grid, seen), _ahead(truth.grid, instance)
        made, truth = (_map_ahead(bev) for bev in (made, truth))
    if made.grid != truth.grid:
        expected, got = (bev.grid.as_array().tolist() for bev in (truth, made))
        hint = "; try --setting 180" if _map_ahead(truth).grid == made.grid else ""
        raise DataError(f"{paths[0]}: expected the grid {expected} of {paths[1]}, got {got}{hint}")
    shapes = {array.shape for array in (seen, instance) if array is not None}
    if shapes - {truth.grid.shape}:
        raise DataError(f"{paths[0]}: expected 'seen' and 'instance' of shape {truth.grid.shape}, got {shapes}")
    return Pair(
        made,
        truth,
        None if instance is None else instance.astype(np.int64),
        None if seen is None else seen.astype(np.bool_),
    )


def check_there(root: Path, source: str, samples: list[Sample]) -> None:
    """Check before the work that every sample has a map.

    Raises:
        DataError: if one has none.
    """
    missing = [sample.token for sample in samples if not bev_path(root, source, sample.token).is_file()]
    if missing:
        folder = bev_folder(root, source)
        how = {"groundtruth": f"appocc groundtruth {root}", "exact": "appocc simulate"}.get(source)
        how = how or f"appocc infer {root} --out {folder}"
        first = f"{missing[0]}.npz is the first"
        raise DataError(
            f"{folder}: {len(missing)} of {len(samples)} samples have no BEV map ({first}); make them with: {how}"
        )


def _more(path: Path, name: str) -> NDArray[np.generic] | None:
    """An array beside a map's own; None where the file has none."""
    packed = read_file(path)
    try:
        with zip_arrays(packed) as data:
            return data.get(name)
    except Exception as error:  # as in `BEVMap.load`
        raise DataError(f"{path}: damaged BEV map ({error})") from error


def _first_ahead(grid: BEVGrid) -> int:
    """Index of the first row of cells with x >= 0."""
    return min(max(int(np.ceil(-grid.x_min_m / grid.cell_m - 1e-6)), 0), grid.shape[0] - 1)


def _ahead(grid: BEVGrid, cells: NDArray[np.generic] | None) -> NDArray[np.generic] | None:
    return None if cells is None else cells[..., _first_ahead(grid) :, :]


def _map_ahead(bev: BEVMap) -> BEVMap:
    """The cells of a map with x >= 0: what the 180 degree setting sees."""
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
