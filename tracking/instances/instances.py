"""Vehicle blobs of one colour bird's-eye view: what stands together, where, how big, which way, which colour."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from scipy import ndimage

from appocc.bevmap import VEHICLE, BEVMap
from appocc.checks import BoolArray, FloatArray, IntArray, check_finite, check_shape, frozen
from appocc.colours import lab_from_rgb
from appocc.grid import BEVGrid
from tracking.association.paint import robust_lab
from tracking.detections import Detections, View, log_odds_of
from tracking.instances.oriented_boxes import shapes_of
from tracking.instances.touching import split_touching
from tracking.instances.watershed import above_peaks, split_at_valleys


@dataclass(frozen=True)
class BlobConfig:
    """When cells of the vehicle layer make a blob.

    Attributes:
        min_area_m2: smaller blobs are dropped as specks; a narrow motorcycle covers about 0.6 m2.
        peak_share: of connected cells, those below this share of the highest probability among them are no vehicle.
        split: whether blobs that do not look like one vehicle are cut.
    """

    min_area_m2: float = 0.4
    peak_share: float = 0.75
    split: bool = True


@dataclass(frozen=True, eq=False)
class GridView(View):
    """A view of the cells of a grid in the ego frame.

    Attributes:
        grid: extent of the view.
        known: (X, Y) cells in which a vehicle would be detected, the others are blind spots; None: all.
    """

    grid: BEVGrid
    known: BoolArray | None = None

    def sees(self, xy_ego_m: FloatArray) -> BoolArray:
        """See `View`."""
        return self.grid.contains(self.grid.cell_of(xy_ego_m))

    def blind(self, xy_ego_m: FloatArray) -> BoolArray:
        """See `View`."""
        if self.known is None:
            return super().blind(xy_ego_m)
        cells = self.grid.cell_of(xy_ego_m)
        inside = self.grid.contains(cells)
        i, j = np.where(inside[:, None], cells, 0).T
        return np.asarray(inside & ~self.known[i, j])


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
        lab: (N, 3) robust CIELAB of the same cells (see `association.paint.robust_lab`), NaN where there is none.
        confidence: (N,) mean vehicle probability.
        touches_border: (N,) whether a cell is on the rim of the grid or next to a cell of which nothing is known, so
            that the vehicle may be cut off.
        view: where blobs can be detected.
    """

    centroid_m: FloatArray
    yaw_rad: FloatArray
    length_m: FloatArray
    width_m: FloatArray
    area_m2: FloatArray
    rgb: FloatArray
    lab: FloatArray
    confidence: FloatArray
    touches_border: BoolArray
    view: GridView

    def __post_init__(self) -> None:
        """Check shapes.

        Raises:
            ShapeError: if one does not fit, or a number that must be known is not.
        """
        n = len(self.centroid_m)
        widths = {"centroid_m": (2,), "rgb": (3,), "lab": (3,)}
        for name in _ARRAYS:
            array = getattr(self, name)
            check_shape(f"blobs {name}", array, (n, *widths.get(name, ())))
            if name not in ("rgb", "lab"):
                check_finite(f"blobs {name}", array)
            frozen(array)

    def __len__(self) -> int:
        """Number of blobs."""
        return len(self.area_m2)

    def select(self, keep: BoolArray | IntArray) -> Blobs:
        """The blobs of a mask (N,) or of indices."""
        return replace(self, **{name: getattr(self, name)[keep] for name in _ARRAYS})

    def as_detections(self) -> Detections:
        """The blobs as the tracker takes them: on the ego's ground plane, all of kind "vehicle", headings unknown."""
        n = len(self)
        return Detections(
            ground_m=np.pad(self.centroid_m, ((0, 0), (0, 1))),
            yaw_rad=self.yaw_rad,
            heading_known=np.zeros(n, np.bool_),
            size_m=np.stack([self.width_m, self.length_m, np.full(n, np.nan)], axis=1),
            log_odds=log_odds_of(self.confidence),
            kind=("vehicle",) * n,
            rgb=self.rgb,
            lab=self.lab,
            cut=self.touches_border,
            view=self.view,
        )


_ARRAYS = tuple(field.name for field in fields(Blobs) if field.name != "view")


def find_blobs(bev: BEVMap, config: BlobConfig | None = None) -> Blobs:
    """The vehicle blobs of a map: connected cells (by their sides) of the vehicle layer, cut where vehicles touch."""
    return measure_blobs(bev, *label_blobs(bev, config or BlobConfig()))


def label_blobs(bev: BEVMap, config: BlobConfig) -> tuple[IntArray, int]:
    """Blob 1..N of each cell (X, Y) of a map, 0 outside blobs, and N."""
    found, count = ndimage.label(bev.on[VEHICLE])
    labels = found.astype(np.int64)
    probability = bev.occupancy[VEHICLE]
    count = above_peaks(labels, count, probability, config.peak_share)
    if config.split:
        count = split_at_valleys(labels, count, probability, bev.grid.cell_m)
        count = split_touching(labels, count, bev)
    size = np.bincount(labels.ravel(), minlength=count + 1)[1:]
    return labels, _renumber(labels, size * bev.grid.cell_m**2 >= config.min_area_m2)


def _renumber(labels: IntArray, keep: BoolArray) -> int:
    """Number those of the blobs 1..N to be kept (N,) anew, in place, and drop the others; how many they are."""
    if not keep.all():
        labels[:] = np.append(0, np.where(keep, np.cumsum(keep), 0))[labels]
    return int(keep.sum())


def measure_blobs(bev: BEVMap, labels: IntArray, count: int) -> Blobs:
    """Blobs 1..count of a label image (X, Y), each of at least one cell."""
    flat = labels.ravel()
    cells = np.flatnonzero(flat)
    member = flat[cells] - 1
    places = np.stack(np.divmod(cells, labels.shape[1]), axis=1)
    shapes = shapes_of(bev.grid.centre_of(places), member, count, bev.grid.cell_m)
    known = bev.occupancy_valid[VEHICLE]
    rim = ((places == 0) | (places == np.array(labels.shape) - 1)).any(axis=1)
    if not known.all():
        rim |= ndimage.binary_dilation(~known)[tuple(places.T)]
    rgb, lab = _colours(bev, flat, cells, member, count)
    return Blobs(
        shapes.centroid_m,
        shapes.yaw_rad,
        shapes.length_m,
        shapes.width_m,
        shapes.area_m2,
        rgb,
        lab,
        np.bincount(member, bev.occupancy[VEHICLE].ravel()[cells], count) / np.bincount(member, minlength=count),
        np.bincount(member, rim, count) > 0,
        GridView(bev.grid, None if known.all() else known),
    )


def _colours(
    bev: BEVMap, flat: IntArray, cells: IntArray, member: IntArray, count: int
) -> tuple[FloatArray, FloatArray]:
    """Mean sRGB and robust CIELAB (N, 3) of `count` blobs: flat labels, the C cells of blobs in them, and whose."""
    known = bev.appearance_valid.ravel()[cells]
    cells, member = cells[known], member[known]
    seen = bev.appearance.reshape(3, -1)[:, cells]
    size = np.bincount(member, minlength=count)[:, None]
    sums = np.stack([np.bincount(member, channel, count) for channel in seen], axis=1)
    with np.errstate(invalid="ignore"):
        mean = sums / size
    inside = np.ones(len(cells), np.bool_)
    for step in (1, -1, bev.grid.shape[1], -bev.grid.shape[1]):
        # What lies beyond the grid is not looked at: a cell on its rim has a neighbour less.
        inside &= flat.take(cells + step, mode="clip") == member + 1
    return mean, robust_lab(lab_from_rgb(seen.T), inside, member, count)
