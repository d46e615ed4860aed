"""Depth and class of camera pixels (`views/TOKEN.npz`): auxiliary training targets of simulated datasets."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path

import numpy as np

from appocc.checks import ByteArray, check_dtype, check_shape, frozen
from appocc.errors import DataError
from appocc.files import read_file, whole_file, zip_arrays

# Side of a block of image pixels that shares one target.
BLOCK_PX = 8


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
        depth_m: (h, w) float16 or float32 depth along the optical axis; infinite in the sky.
        kind: (h, w) uint8 `ViewClass`.
    """

    depth_m: np.ndarray[tuple[int, int], np.dtype[np.floating]]
    kind: ByteArray

    def __post_init__(self) -> None:
        """Check shapes and types.

        Raises:
            ShapeError: if the shapes differ or `kind` is not uint8.
        """
        check_shape("depth_m", self.depth_m, (None, None))
        check_shape("kind", self.kind, self.depth_m.shape)
        check_dtype("kind", self.kind, np.uint8)
        for name in ("depth_m", "kind"):
            array = np.array(getattr(self, name))
            frozen(array)
            object.__setattr__(self, name, array)


def view_targets_path(root: Path, token: str) -> Path:
    """Return the path of the view targets of a sample."""
    return root / "views" / f"{token}.npz"


def save_view_targets(path: Path, targets: Mapping[str, ViewTargets]) -> None:
    """Write the view targets of a sample by camera channel to one .npz file, atomically.

    Raises:
        DataError: if the file cannot be written.
    """
    arrays = {
        f"{channel}.{part}": getattr(target, part)
        for channel, target in targets.items()
        for part in ("depth_m", "kind")
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
            channels = [name.removesuffix(".depth_m") for name in data.files if name.endswith(".depth_m")]
            return {name: ViewTargets(data[f"{name}.depth_m"], data[f"{name}.kind"]) for name in channels}
    except Exception as error:  # damage surfaces as nearly any error of zipfile, zlib and numpy
        raise DataError(f"{path}: damaged depth file ({error})") from error
