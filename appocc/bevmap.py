"""The colour bird's-eye-view map: occupancy and appearance per cell, predicted or ground truth."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from appocc.checks import BoolArray, ByteArray, Float32Array, check_dtype, check_numbers, check_shape, freeze_arrays
from appocc.errors import DataError, ShapeError
from appocc.files import path_of, plain_name, read_file, whole_file, zip_arrays
from appocc.files.questions import can_list
from appocc.grid import BEVGrid
from appocc.objects import BEVObjects
from appocc.typing import PathLike

CLASSES = ("road", "vehicle", "lane")
# Folder of pictures in the folder of a source of maps.
PICTURES = "pictures"
ROAD, VEHICLE, LANE = range(3)


@dataclass(frozen=True, eq=False)
class BEVMap:
    """Occupancy and appearance on a grid, in the ego frame of one sample.

    Attributes:
        grid: extent and cell size; X, Y = grid.shape.
        occupancy: (3, X, Y) float32 in [0, 1]: probability of road, vehicle, lane (0 or 1 in ground truth).
        occupancy_valid: (3, X, Y) bool: False where the class is unknown; in predictions, where no camera sees the
            cell.
        appearance: (3, X, Y) uint8 sRGB, seen from above.
        appearance_valid: (X, Y) bool: False where the colour is unknown.
        meta: source of each part, token, time, `thresholds` of predictions, `object_threshold` of their objects; JSON
            values only.
        objects: predicted objects; None if the source of the map predicts none.
    """

    grid: BEVGrid
    occupancy: Float32Array
    occupancy_valid: BoolArray
    appearance: ByteArray
    appearance_valid: BoolArray
    meta: Mapping[str, Any] = field(default_factory=dict)
    objects: BEVObjects | None = None

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
        if not isinstance(self.meta, Mapping):
            raise ShapeError(f"meta: expected values by name, got {self.meta!r}")
        if self.occupancy.size and not (self.occupancy.min() >= 0 and self.occupancy.max() <= 1):
            raise ShapeError(
                f"occupancy: expected values in [0, 1], got {self.occupancy.min()}..{self.occupancy.max()}"
            )
        freeze_arrays(self, "occupancy", "occupancy_valid", "appearance", "appearance_valid")

    @property
    def thresholds(self) -> dict[str, float] | None:
        """Decision threshold of each class; None if meta has none.

        Raises:
            DataError: if they are not one number in [0, 1] for each class.
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

    @property
    def object_threshold(self) -> float:
        """Lowest score of a detected object, chosen on validation data; 0.5 if meta has none.

        Raises:
            DataError: if it is not a number in [0, 1].
        """
        kept = self.meta.get("object_threshold", 0.5)
        if not (isinstance(kept, int | float) and 0 <= kept <= 1):
            raise DataError(f"object_threshold of a map: expected a share, got {kept}")
        return float(kept)

    @cached_property
    def on(self) -> BoolArray:
        """(3, X, Y) bool: known cells of road, vehicle, lane, by the map's thresholds or 0.5.

        Raises:
            DataError: as `thresholds`.
        """
        kept = self.thresholds or {}
        least = np.array([kept.get(name, 0.5) for name in CLASSES], np.float32)[:, None, None]
        return (self.occupancy >= least) & self.occupancy_valid

    @cached_property
    def unseen(self) -> BoolArray:
        """(X, Y) bool: cells of a prediction that no camera sees; all False for other maps."""
        if self.thresholds is None:
            return np.zeros(self.grid.shape, np.bool_)
        return np.asarray(~self.occupancy_valid.any(axis=0))

    @cached_property
    def known_objects(self) -> BEVObjects | None:
        """Objects whose centre is in a known vehicle cell, or beyond the grid next to one; None as `objects`."""
        return None if self.objects is None else self.objects.select(self.are_known(self.objects))

    def are_known(self, objects: BEVObjects) -> BoolArray:
        """Return (N,) whether the centre of an object is in a known vehicle cell, or beyond the grid next to one."""
        cells = self.grid.cell_of(objects.centre_m[:, :2])
        i, j = np.clip(cells, 0, np.array(self.grid.shape) - 1).T
        return np.asarray(self.occupancy_valid[VEHICLE][i, j])

    @cached_property
    def detected_objects(self) -> BEVObjects | None:
        """Known objects with a score of `object_threshold` or more; None as `objects`.

        Raises:
            DataError: as `object_threshold`.
        """
        known = self.known_objects
        return None if known is None else known.select(known.score >= self.object_threshold)

    def with_guesses(self) -> BEVMap:
        """Return a prediction with all cells valid, including those that no camera sees; other maps unchanged.

        A network predicts every cell of its grid; where no camera sees the cell, the prediction is a guess.
        """
        if self.thresholds is None:
            return self
        coloured = np.full_like(self.appearance_valid, self.appearance_valid.any())
        return replace(self, occupancy_valid=np.ones_like(self.occupancy_valid), appearance_valid=coloured)

    def save(self, path: PathLike, more: Mapping[str, NDArray[np.generic]] | None = None) -> None:
        """Write the map to `path` (.npz, compressed, atomic; the same map gives the same bytes).

        Objects are stored with `instance`, the object of each vehicle cell. `more` arrays are stored next to those of
        the map; `load` ignores them.

        Raises:
            DataError: if it cannot be written.
        """
        extra: dict[str, NDArray[np.generic]] = {}
        if self.objects is not None:
            owner = self.objects.vehicle_owner(self.grid)
            extra = {**self.objects.as_arrays(), "instance": owner.astype(np.int16)}
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
                **{**extra, **(more or {})},  # type: ignore[arg-type]
            )

    @property
    def is_truth(self) -> bool:
        """Whether the map is simulated or made from all data of a recording, by its meta, and not predicted."""
        return self.meta.get("source") == "simulated" or "sources" in self.meta

    @classmethod
    def load(cls, path: PathLike) -> BEVMap:
        """Read a map written by `save` or by another tool in the same format.

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
                    BEVObjects.from_arrays(data),
                )
                made.thresholds, made.object_threshold  # noqa: B018 - checked here, where the file's name is known
                return made
        except KeyError as error:
            raise DataError(f"{path}: no BEV map, {error.args[0]}") from error
        except Exception as error:  # damage surfaces as nearly any error of zipfile, zlib and numpy
            raise DataError(f"{path}: damaged BEV map ({error})") from error


def bev_folder(root: PathLike, source: str) -> Path:
    """Return the folder of a source of maps: `ROOT/bev/SOURCE`; a source with a slash in its name is a folder."""
    return path_of(source) if "/" in source else path_of(root) / "bev" / source


def picture_path(folder: Path, title: str) -> Path:
    """Return the path of the picture of a map in the folder of a source."""
    return folder / PICTURES / f"{title}.jpg"


def bev_path(root: PathLike, source: str, sample_token: str) -> Path:
    """Return the path of a sample's map: `ROOT/bev/SOURCE/TOKEN.npz`.

    Raises:
        DataError: if the token is not a plain file name.
    """
    return bev_folder(root, source) / f"{plain_name(path_of(root), sample_token)}.npz"


def load_map(root: PathLike, source: str, sample_token: str) -> BEVMap:
    """Read the map of a sample.

    Raises:
        DataError: if it is missing (the message names the sources that there are, and the command that makes the map)
            or damaged.
    """
    path = bev_path(root, source, sample_token)
    if not path.is_file():
        others = [other for other in map_sources(root) if other != source] if can_list(path_of(root)) else []
        there = f"there are maps of source {' and '.join(others)}; " if others else ""
        raise DataError(f"{path}: no BEV map; {there}{_how_to_make(path_of(root), source)}")
    return BEVMap.load(path)


def map_sources(root: PathLike) -> list[str]:
    """Return the sources of maps in a dataset: the folders of `ROOT/bev` with maps, sorted."""
    folders = path_of(root).joinpath("bev").glob("*/")
    return sorted(folder.name for folder in folders if next(folder.glob("*.npz"), None) is not None)


def _how_to_make(root: Path, source: str) -> str:
    """Return how maps of a source are made."""
    if source == "exact":
        return "exact maps come with simulated drives only: appocc simulate"
    if source == "groundtruth":
        return f"make it with: appocc groundtruth {root}"
    return f"make it with: appocc infer {root} --out {bev_folder(root, source)}"
