"""Depth and class of what each camera sees, at an eighth of the picture's size: extra targets for training."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numba
import numpy as np

from appocc.checks import ByteArray, Float32Array, check_dtype, check_shape, frozen
from appocc.errors import DataError
from appocc.files import read_file, whole_file, zip_arrays

FACTOR = 8


@dataclass(frozen=True)
class ViewTargets:
    """What one camera sees, h x w pixels.

    Attributes:
        depth_m: (h, w) float16 or float32 depth along the optical axis; infinite where it is the sky.
        kind: (h, w) uint8 class, numbers as the renderer gives them.
    """

    depth_m: np.ndarray[tuple[int, int], np.dtype[np.floating]]
    kind: ByteArray

    def __post_init__(self) -> None:
        """Check shapes.

        Raises:
            ShapeError: if the two differ.
        """
        check_shape("depth_m", self.depth_m, (None, None))
        check_shape("kind", self.kind, self.depth_m.shape)
        check_dtype("kind", self.kind, np.uint8)
        frozen(self.depth_m)
        frozen(self.kind)


def reduce_view(depth_m: Float32Array, kind: ByteArray, factor: int = FACTOR) -> ViewTargets:
    """Reduce each block of factor x factor pixels to its most frequent class and the median depth of that class.

    A mean across the edge of a car would be a depth at which nothing is. Among equally frequent classes the nearest
    one wins. Blocks at the right and lower edge may be incomplete.

    Args:
        depth_m: (H, W) float32, infinite in the sky.
        kind: (H, W) uint8.
        factor: side length of a block in pixels.
    """
    depth, common = _reduce(depth_m, kind, factor)
    with np.errstate(over="ignore"):
        return ViewTargets(depth.astype(np.float16), common)


@numba.njit(cache=True, nogil=True)
def _reduce(depth: Float32Array, kind: ByteArray, factor: int) -> tuple[Float32Array, ByteArray]:
    """Return the median depth of the most frequent class of each block, and that class."""
    high, wide = depth.shape
    rows, columns = (high + factor - 1) // factor, (wide + factor - 1) // factor
    median, common = np.empty((rows, columns), np.float32), np.empty((rows, columns), np.uint8)
    count, nearest = np.zeros(256, np.int64), np.empty(256, np.float32)
    chosen = np.empty(factor * factor, np.float32)
    for i in range(rows):
        for j in range(columns):
            bottom, right = min((i + 1) * factor, high), min((j + 1) * factor, wide)
            best = kind[i * factor, j * factor]
            for r in range(i * factor, bottom):
                for c in range(j * factor, right):
                    k = kind[r, c]
                    nearest[k] = depth[r, c] if count[k] == 0 else min(nearest[k], depth[r, c])
                    count[k] += 1
            for r in range(i * factor, bottom):
                for c in range(j * factor, right):
                    k = kind[r, c]
                    if count[k] > count[best] or (count[k] == count[best] and nearest[k] < nearest[best]):
                        best = k
            n = 0
            for r in range(i * factor, bottom):
                for c in range(j * factor, right):
                    count[kind[r, c]] = 0
                    if kind[r, c] == best:
                        at = n
                        while at > 0 and chosen[at - 1] > depth[r, c]:
                            chosen[at] = chosen[at - 1]
                            at -= 1
                        chosen[at] = depth[r, c]
                        n += 1
            # The lower of the two middle values: a depth that occurs.
            median[i, j] = chosen[(n - 1) // 2]
            common[i, j] = best
    return median, common


def save_views(path: Path, views: Mapping[str, ViewTargets]) -> None:
    """Write the views of a sample's cameras by channel as one .npz, whole or not at all.

    Raises:
        DataError: if it cannot be written.
    """
    arrays = {
        f"{channel}.{part}": getattr(view, part) for channel, view in views.items() for part in ("depth_m", "kind")
    }
    with whole_file(path) as temporary, temporary.open("wb") as handle:
        np.savez_compressed(handle, **arrays)


def load_views(path: Path) -> dict[str, ViewTargets]:
    """Read what `save_views` wrote, by channel.

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
