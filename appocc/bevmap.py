"""The colour bird's-eye view: what a cell holds, what colour it is; what a model predicts and what truth is."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from appocc.checks import BoolArray, ByteArray, Float32Array, check_dtype, check_numbers, check_shape, frozen
from appocc.errors import DataError, ShapeError
from appocc.files import plain_name, read_file, whole_file, zip_arrays
from appocc.grid import BEVGrid

CLASSES = ("road", "vehicle", "lane")
ROAD, VEHICLE, LANE = range(3)


@dataclass(frozen=True)
class BEVMap:
    """Occupancy and appearance on a grid, in the ego frame of one sample.

    Attributes:
        grid: extent and cell size; X, Y = grid.shape.
        occupancy: (3, X, Y) float32 in [0, 1]: probability of road, vehicle, lane (0 or 1 in truths).
        occupancy_valid: (3, X, Y) bool: False where nothing is known of that class; of a prediction: where no camera
            sees the cell.
        appearance: (3, X, Y) uint8 sRGB seen from above.
        appearance_valid: (X, Y) bool: False where no colour is known.
        meta: sources of each part, token, time, `thresholds` of a network's answer; JSON values only.
    """

    grid: BEVGrid
    occupancy: Float32Array
    occupancy_valid: BoolArray
    appearance: ByteArray
    appearance_valid: BoolArray
    meta: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check shapes, types and the range of the probabilities.

        Raises:
            ShapeError: if one does not fit.
        """
        x, y = self.grid.shape
        for name, array, shape, dtype in (
            ("occupancy", self.occupancy, (3, x, y), np.float32),
            ("occupancy_valid", self.occupancy_valid, (3, x, y), np.bool_),
            ("appearance", self.appearance, (3, x, y), np.uint8),
            ("appearance_valid", self.appearance_valid, (x, y), np.bool_),
        ):
            check_shape(name, array, shape)
            check_dtype(name, array, dtype)
            frozen(array)
        if not isinstance(self.meta, Mapping):
            raise ShapeError(f"meta: expected values by name, got {self.meta!r}")
        if self.occupancy.size and not (self.occupancy.min() >= 0 and self.occupancy.max() <= 1):
            raise ShapeError(
                f"occupancy: expected values in [0, 1], got {self.occupancy.min()}..{self.occupancy.max()}"
            )

    @property
    def thresholds(self) -> dict[str, float] | None:
        """Probability by class from which a cell is of it, as chosen on validation data; None where meta has none.

        Raises:
            DataError: if they are no shares, one a class.
        """
        kept = self.meta.get("thresholds")
        if kept is None:
            return None
        numbers = isinstance(kept, dict) and all(
            isinstance(kept.get(name), int | float) and 0 <= kept[name] <= 1 for name in CLASSES
        )
        if not numbers:
            raise DataError(f"thresholds of a map: expected a share for each of {', '.join(CLASSES)}, got {kept}")
        return {name: float(kept[name]) for name in CLASSES}

    @cached_property
    def on(self) -> BoolArray:
        """(3, X, Y) whether a cell is known to be road, vehicle, lane: from the map's thresholds, or from 0.5.

        Raises:
            DataError: as `thresholds`.
        """
        kept = self.thresholds or {}
        least = np.array([kept.get(name, 0.5) for name in CLASSES], np.float32)[:, None, None]
        return (self.occupancy >= least) & self.occupancy_valid

    @cached_property
    def unseen(self) -> BoolArray:
        """(X, Y) cells of a prediction that no camera sees; none of other maps."""
        if self.thresholds is None:
            return np.zeros(self.grid.shape, np.bool_)
        return np.asarray(~self.occupancy_valid.any(axis=0))

    def with_guesses(self) -> BEVMap:
        """The map with all cells of a prediction valid, those included that no camera sees; other maps as they are.

        A network answers for every cell of its grid; where no camera sees the cell, the answer is a guess.
        """
        if self.thresholds is None:
            return self
        coloured = np.full_like(self.appearance_valid, self.appearance_valid.any())
        return replace(self, occupancy_valid=np.ones_like(self.occupancy_valid), appearance_valid=coloured)

    def save(self, path: Path, more: Mapping[str, NDArray[np.generic]] | None = None) -> None:
        """Write `path` (.npz, compressed, whole or not at all; the same map gives the same bytes).

        `more` arrays are kept beside the map's own under names that `load` leaves alone.

        Raises:
            DataError: if it cannot be written.
        """
        certain = bool(((self.occupancy == 0) | (self.occupancy == 1)).all())
        with whole_file(path) as temporary, temporary.open("wb") as handle:
            np.savez_compressed(
                handle,
                occupancy=self.occupancy.astype(np.uint8 if certain else np.float16),
                occupancy_valid=self.occupancy_valid,
                appearance=self.appearance,
                appearance_valid=self.appearance_valid,
                grid=self.grid.as_array(),
                meta=np.array(json.dumps(dict(self.meta), sort_keys=True)),
                **(more or {}),  # type: ignore[arg-type]
            )

    @classmethod
    def load(cls, path: Path) -> BEVMap:
        """Read a map that `save` (or any tool that keeps to the format) wrote.

        Raises:
            DataError: if the file is missing, damaged, or lacks a part.
        """
        packed = read_file(path)
        try:
            with zip_arrays(packed) as data, np.errstate(over="ignore"):
                occupancy = data["occupancy"]
                check_numbers("occupancy", occupancy)
                made = cls(
                    BEVGrid.from_array(data["grid"]),
                    occupancy.astype(np.float32),
                    data["occupancy_valid"],
                    data["appearance"],
                    data["appearance_valid"],
                    json.loads(str(data["meta"])) if "meta" in data else {},
                )
                made.thresholds  # noqa: B018 - odd ones are told here, where the file's name is known
                return made
        except KeyError as error:
            raise DataError(f"{path}: no BEV map, {error.args[0]}") from error
        except Exception as error:  # damage surfaces as nearly any error of zipfile, zlib and numpy
            raise DataError(f"{path}: damaged BEV map ({error})") from error


def is_truth(source: str) -> bool:
    """Whether maps of this source were made from everything a recording has, boxes included, and not predicted."""
    return Path(source).name in ("exact", "groundtruth")


def bev_folder(root: Path, source: str) -> Path:
    """Where the maps of a source lie: `ROOT/bev/SOURCE`; a source with a slash in its name is a folder itself."""
    return Path(source) if "/" in source else root / "bev" / source


def bev_path(root: Path, source: str, sample_token: str) -> Path:
    """Where the map of a sample lies: `ROOT/bev/SOURCE/TOKEN.npz`.

    Raises:
        DataError: if the token leads elsewhere.
    """
    return bev_folder(root, source) / f"{plain_name(root, sample_token)}.npz"


def load_map(root: Path, source: str, sample_token: str) -> BEVMap:
    """The map of a sample.

    Raises:
        DataError: if it is missing (the message says how maps are made) or damaged.
    """
    path = bev_path(root, source, sample_token)
    if not path.is_file():
        how = f"appocc groundtruth {root}" if source == "groundtruth" else f"maps of source '{source}'"
        raise DataError(f"{path}: no BEV map; make it with: {how}")
    return BEVMap.load(path)
