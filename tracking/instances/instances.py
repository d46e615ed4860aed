"""Vehicle instances of a bird's-eye-view map: connected components with position, size, heading and colour."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from scipy import ndimage

from appocc.bevmap import VEHICLE, BEVMap
from appocc.checks import BoolArray, FloatArray, IntArray, check_finite, check_shape, frozen
from appocc.colours import lab_from_rgb
from tracking.field_of_view import GridView
from tracking.instances.oriented_boxes import fit_oriented_boxes
from tracking.instances.robust_colour import robust_lab
from tracking.instances.touching import split_touching
from tracking.instances.watershed import split_by_watershed, suppress_below_peak


@dataclass(frozen=True)
class InstanceConfig:
    """Configuration of the instance segmentation.

    Attributes:
        min_area_m2: minimum area of an instance; a narrow motorcycle covers about 0.6 m2.
        peak_share: minimum probability of a cell, as a fraction of the peak of its connected component.
        split: whether components that are not shaped like one vehicle are split.
    """

    min_area_m2: float = 0.4
    peak_share: float = 0.75
    split: bool = True


@dataclass(frozen=True, kw_only=True, eq=False)
class Instances:
    """N vehicle instances in the ego frame, metres and radians.

    Attributes:
        centroid_m: (N, 2) centroids of the cells.
        yaw_rad: (N,) direction of the long axis in [-pi/2, pi/2); front and rear are not distinguished.
        length_m: (N,) length of the uniform rectangle with the same second moments.
        width_m: (N,) width of that rectangle.
        area_m2: (N,) covered area.
        rgb: (N, 3) mean sRGB, 0..255, over cells of known colour; NaN if there are none.
        lab: (N, 3) robust CIELAB over the same cells, see `robust_lab`; NaN if there are none.
        confidence: (N,) mean vehicle probability.
        touches_border: (N,) whether a cell is at the border of the grid or next to an unknown cell: the vehicle may
            be truncated.
        view: field of view.
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
        """Check boxes.

        Raises:
            ShapeError: if a shape differs, or a required number is not finite.
        """
        n = len(self.centroid_m)
        widths = {"centroid_m": (2,), "rgb": (3,), "lab": (3,)}
        for name in _ARRAYS:
            array = getattr(self, name)
            check_shape(f"instances {name}", array, (n, *widths.get(name, ())))
            if name not in ("rgb", "lab"):
                check_finite(f"instances {name}", array)
            copy = array.copy()
            frozen(copy)
            object.__setattr__(self, name, copy)

    def __len__(self) -> int:
        """Number of instances."""
        return len(self.area_m2)

    def select(self, keep: BoolArray | IntArray) -> Instances:
        """Return the instances of a mask (N,) or of indices."""
        return replace(self, **{name: getattr(self, name)[keep] for name in _ARRAYS})


_ARRAYS = tuple(field.name for field in fields(Instances) if field.name != "view")


def find_instances(bev: BEVMap, config: InstanceConfig | None = None) -> Instances:
    """Return the vehicle instances of a map: 4-connected components, split where vehicles touch."""
    return measure_instances(bev, *label_instances(bev, config or InstanceConfig()))


def label_instances(bev: BEVMap, config: InstanceConfig) -> tuple[IntArray, int]:
    """Label the cells (X, Y) of a map with instances 1..N, 0 for background; return the labels and N."""
    found, count = ndimage.label(bev.on[VEHICLE])
    labels = found.astype(np.int64)
    probability = bev.occupancy[VEHICLE]
    count = suppress_below_peak(labels, count, probability, config.peak_share)
    if config.split:
        count = split_by_watershed(labels, count, probability, bev.grid.cell_m)
        count = split_touching(labels, count, bev)
    size = np.bincount(labels.ravel(), minlength=count + 1)[1:]
    return labels, _renumber(labels, size * bev.grid.cell_m**2 >= config.min_area_m2)


def _renumber(labels: IntArray, keep: BoolArray) -> int:
    """Keep the labels 1..N of a mask (N,), renumber them in place, and return their number."""
    if not keep.all():
        labels[:] = np.append(0, np.where(keep, np.cumsum(keep), 0))[labels]
    return int(keep.sum())


def measure_instances(bev: BEVMap, labels: IntArray, count: int) -> Instances:
    """Measure the instances 1..count of a label image (X, Y), each of at least one cell."""
    flat = labels.ravel()
    cells = np.flatnonzero(flat)
    member = flat[cells] - 1
    places = np.stack(np.divmod(cells, labels.shape[1]), axis=1)
    boxes = fit_oriented_boxes(bev.grid.centre_of(places), member, count, bev.grid.cell_m)
    known, probability = bev.occupancy_valid[VEHICLE], bev.occupancy[VEHICLE].ravel()[cells]
    border = ((places == 0) | (places == np.array(labels.shape) - 1)).any(axis=1)
    if not known.all():
        border |= ndimage.binary_dilation(~known)[tuple(places.T)]
    rgb, lab = _colours(bev, flat, cells, member, count)
    return Instances(
        centroid_m=boxes.centroid_m,
        yaw_rad=boxes.yaw_rad,
        length_m=boxes.length_m,
        width_m=boxes.width_m,
        area_m2=boxes.area_m2,
        rgb=rgb,
        lab=lab,
        confidence=np.bincount(member, probability, count) / np.bincount(member, minlength=count),
        touches_border=np.bincount(member, border, count) > 0,
        view=GridView(bev.grid, None if known.all() else known),
    )


def _colours(
    bev: BEVMap, flat: IntArray, cells: IntArray, member: IntArray, count: int
) -> tuple[FloatArray, FloatArray]:
    """Return mean sRGB and robust CIELAB (N, 3) of `count` instances.

    Args:
        bev: the map.
        flat: flat label image.
        cells: (C,) indices of labelled cells in it.
        member: (C,) instance of each cell, 0..count - 1.
        count: number of instances.
    """
    known = bev.appearance_valid.ravel()[cells]
    cells, member = cells[known], member[known]
    seen = bev.appearance.reshape(3, -1)[:, cells]
    size = np.bincount(member, minlength=count)[:, None]
    sums = np.stack([np.bincount(member, channel, count) for channel in seen], axis=1)
    with np.errstate(invalid="ignore"):
        mean = sums / size
    inside = np.ones(len(cells), np.bool_)
    for step in (1, -1, bev.grid.shape[1], -bev.grid.shape[1]):
        # Indices are clipped at the ends of the grid, so that its border cells lack a neighbour.
        inside &= flat.take(cells + step, mode="clip") == member + 1
    return mean, robust_lab(lab_from_rgb(seen.T), inside, member, count)
