"""Depth and class of camera pixels (`views/TOKEN.npz`): auxiliary training targets.

Simulated datasets have both, imported ones that label pixels have classes alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib.npyio import NpzFile
from numpy.typing import NDArray

from appocc.checks import ByteArray, check_dtype, check_shape, frozen
from appocc.errors import DataError, ShapeError
from appocc.files import open_plain, read_file, whole_file, zip_arrays

# Side of a block of image pixels that shares one target.
BLOCK_PX = 8
# In place of a class where the pixel is not labelled.
UNKNOWN_KIND = 255


class ViewClass(IntEnum):
    """Semantic class at the centre of a pixel."""

    SKY = 0
    ROAD = 1
    LANE_MARKING = 2
    PAVEMENT = 3
    TERRAIN = 4
    BUILDING = 5
    VEGETATION = 6
    POLE_OR_SIGN = 7
    VEHICLE = 8
    TWO_WHEELER = 9
    PERSON = 10
    OTHER = 11


@dataclass(frozen=True, eq=False)
class ViewTargets:
    """Targets of one camera image, h x w pixels or blocks; the arrays are copied and read-only.

    Attributes:
        depth_m: (h, w) float16 or float32 depth along the optical axis; infinite in the sky. None if unknown.
        kind: (h, w) uint8 `ViewClass`, `UNKNOWN_KIND` where not labelled.
    """

    depth_m: np.ndarray[tuple[int, int], np.dtype[np.floating]] | None
    kind: ByteArray

    def __post_init__(self) -> None:
        """Check shapes and types.

        Raises:
            ShapeError: if the shapes differ, or `kind` is not uint8 or has a class that is not known.
        """
        if self.depth_m is not None:
            check_shape("depth_m", self.depth_m, (None, None))
        check_shape("kind", self.kind, (None, None) if self.depth_m is None else self.depth_m.shape)
        check_dtype("kind", self.kind, np.uint8)
        known = self.kind[self.kind != UNKNOWN_KIND]
        if known.max(initial=0) >= len(ViewClass):
            raise ShapeError(f"kind: expected classes below {len(ViewClass)} or {UNKNOWN_KIND}, got {known.max()}")
        for name, array in self.arrays().items():
            copy = np.array(array)
            frozen(copy)
            object.__setattr__(self, name, copy)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return the arrays that are known, by name."""
        return ({} if self.depth_m is None else {"depth_m": self.depth_m}) | {"kind": self.kind}


def view_targets_path(root: Path, token: str) -> Path:
    """Return the path of the view targets of a sample."""
    return root / "views" / f"{token}.npz"


def save_view_targets(path: Path, targets: Mapping[str, ViewTargets]) -> None:
    """Write the view targets of a sample by camera channel to one .npz file, atomically.

    Raises:
        DataError: if the file cannot be written.
    """
    arrays: dict[str, Any] = {
        f"{channel}.{part}": array for channel, target in targets.items() for part, array in target.arrays().items()
    }
    with whole_file(path) as temporary, temporary.open("wb") as handle:
        np.savez_compressed(handle, **arrays)


def load_view_targets(path: Path) -> dict[str, ViewTargets]:
    """Read the view targets of a sample by camera channel.

    Raises:
        DataError: if the file is missing or damaged.
    """
    packed = read_file(path)
    try:
        with zip_arrays(packed) as data:
            return {channel: _view(data, channel) for channel in _labelled(data)}
    except Exception as error:  # damage surfaces as nearly any error of zipfile, zlib and numpy
        raise DataError(f"{path}: damaged depth and classes of pixels ({error})") from error


def count_labelled_images(path: Path) -> int:
    """Return how many images of a sample have pixel classes, by the directory of the file.

    Raises:
        DataError: if the file is missing or damaged.
    """
    try:
        with open_plain(path) as file, zip_arrays(file) as data:
            return len(_labelled(data))
    except ValueError as error:
        raise DataError(f"{path}: damaged depth and classes of pixels ({error})") from error


def _labelled(data: NpzFile) -> list[str]:
    return [name.removesuffix(".kind") for name in data.files if name.endswith(".kind")]


def _view(data: NpzFile, channel: str) -> ViewTargets:
    depth = f"{channel}.depth_m"
    return ViewTargets(data[depth] if depth in data.files else None, data[f"{channel}.kind"])
