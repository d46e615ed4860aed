"""Vehicle blobs of one colour bird's-eye view: what stands together, where, how big, which way, which colour."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from scipy import ndimage

from appocc.bevmap import VEHICLE, BEVMap
from appocc.checks import BoolArray, FloatArray, IntArray, check_finite, check_shape, frozen
from appocc.grid import BEVGrid
from tracking.shapes import shapes_of
from tracking.split import split_touching


@dataclass(frozen=True)
class BlobConfig:
    """When cells of the vehicle layer make a blob.

    Attributes:
        min_area_m2: smaller blobs are dropped as specks; a narrow motorcycle covers about 0.6 m2.
        split: whether blobs that do not look like one vehicle are cut by colour and place.
    """

    min_area_m2: float = 0.4
    split: bool = True


@dataclass(frozen=True)
class Blobs:
    """N vehicle blobs in the ego frame, metres and radians.

    Attributes:
        centroid_m: (N, 2) centres of mass of their cells.
        yaw_rad: (N,) direction of the long axis in [-pi/2, pi/2): front and rear cannot be told apart.
        length_m: (N,) extent along the long axis, of the uniform rectangle with the same second moments.
        width_m: (N,) the same across it.
        area_m2: (N,) covered area.
        rgb: (N, 3) mean sRGB 0..255 over the cells whose colour is known, NaN where there is none.
        confidence: (N,) mean vehicle probability.
        touches_border: (N,) whether a cell lies on the rim of the grid, so that the vehicle may be cut off.
        grid: where blobs could be seen.
    """

    centroid_m: FloatArray
    yaw_rad: FloatArray
    length_m: FloatArray
    width_m: FloatArray
    area_m2: FloatArray
    rgb: FloatArray
    confidence: FloatArray
    touches_border: BoolArray
    grid: BEVGrid

    def __post_init__(self) -> None:
        """Check shapes.

        Raises:
            ShapeError: if one does not fit, or a number that must be known is not.
        """
        n = len(self.centroid_m)
        for name in _ARRAYS:
            array = getattr(self, name)
            width = {"centroid_m": (2,), "rgb": (3,)}.get(name, ())
            check_shape(f"blobs {name}", array, (n, *width))
            if name != "rgb":
                check_finite(f"blobs {name}", array)
            frozen(array)

    def __len__(self) -> int:
        """Number of blobs."""
        return len(self.area_m2)

    def select(self, keep: BoolArray | IntArray) -> Blobs:
        """The blobs of a mask (N,) or of indices."""
        return Blobs(
            self.centroid_m[keep],
            self.yaw_rad[keep],
            self.length_m[keep],
            self.width_m[keep],
            self.area_m2[keep],
            self.rgb[keep],
            self.confidence[keep],
            self.touches_border[keep],
            self.grid,
        )

    def cover(self, xy_m: FloatArray) -> BoolArray:
        """(P, N) whether points (P, 2) in the ego frame lie in the boxes of the blobs."""
        offset = xy_m[:, None] - self.centroid_m[None]
        cos, sin = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        along, across = offset[..., 0] * cos + offset[..., 1] * sin, offset[..., 1] * cos - offset[..., 0] * sin
        return np.asarray((np.abs(along) <= self.length_m / 2) & (np.abs(across) <= self.width_m / 2))


_ARRAYS = tuple(field.name for field in fields(Blobs) if field.name != "grid")


def find_blobs(bev: BEVMap, config: BlobConfig | None = None) -> Blobs:
    """The vehicle blobs of a map: connected cells (by their sides) of the vehicle layer, cut where vehicles touch."""
    config = config or BlobConfig()
    found, count = ndimage.label(bev.on[VEHICLE])
    labels = found.astype(np.int64)
    rgb = np.moveaxis(bev.appearance, 0, -1).astype(np.float64)
    rgb[~bev.appearance_valid] = np.nan
    if config.split:
        count = split_touching(labels, count, bev.grid.centres(), rgb, bev.grid.cell_m)
    blobs = _measured(bev, labels, count, rgb)
    return blobs.select(blobs.area_m2 >= config.min_area_m2)


def _measured(bev: BEVMap, labels: IntArray, count: int, rgb: FloatArray) -> Blobs:
    """Blobs 1..count of a label image (X, Y) with colours (X, Y, 3)."""
    cells = labels > 0
    member = labels[cells] - 1
    shapes = shapes_of(bev.grid.centres()[cells], member, count, bev.grid.cell_m)
    rim = np.ones(labels.shape, dtype=np.bool_)
    rim[1:-1, 1:-1] = False
    known = np.isfinite(rgb[cells, 0])
    with np.errstate(invalid="ignore"):
        sums = [np.bincount(member[known], channel, count) for channel in rgb[cells][known].T]
        colour = np.stack(sums, axis=1) / np.bincount(member[known], minlength=count)[:, None]
    size = np.bincount(member, minlength=count)
    return Blobs(
        shapes.centroid_m,
        shapes.yaw_rad,
        shapes.length_m,
        shapes.width_m,
        shapes.area_m2,
        colour,
        np.bincount(member, bev.occupancy[VEHICLE][cells].astype(np.float64), count) / size,
        np.bincount(member, rim[cells], count) > 0,
        bev.grid,
    )
