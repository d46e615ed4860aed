"""Splitting instances in which several vehicles touch: by colour, otherwise by position and colour."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy import ndimage
from scipy.spatial.distance import cdist

from appocc.bevmap import BEVMap
from appocc.checks import BoolArray, FloatArray, IntArray
from tracking.instances.oriented_boxes import fit_oriented_boxes, is_vehicle_shaped, size_deviation

# Two typical cars cover more than this; smaller instances are not split.
MIN_SPLIT_AREA_M2 = 14.0
# Smaller pieces of one colour are parts of a vehicle, such as windows and lamps.
MIN_PIECE_AREA_M2 = 3.5
# Neighbouring cells with a larger RGB distance belong to different vehicles; 50 RGB steps correspond to one metre.
COLOUR_STEP_RGB = 40.0
METRES_PER_RGB = 0.02
MAX_PIECES = 8
# Cap on the colour distance from a small part, of any colour, to its vehicle.
MAX_COLOUR_M = 2.0


def split_touching(labels: IntArray, count: int, bev: BEVMap) -> int:
    """Split those of the instances 1..count of a map that are not vehicle-shaped into pieces that are.

    Labels (X, Y), 0 for background, are changed in place: the first piece keeps its label, the others are appended.
    An instance without such a split is not changed.

    Returns:
        The number of instances afterwards.
    """
    cell_m = bev.grid.cell_m
    cells = np.flatnonzero(labels)
    member = labels.reshape(-1)[cells] - 1
    large = np.bincount(member, minlength=count) * cell_m**2 >= MIN_SPLIT_AREA_M2
    if not large.any():
        return count
    places = np.stack(np.divmod(cells, labels.shape[1]), axis=1)
    shapes = fit_oriented_boxes(bev.grid.centre_of(places), member, count, cell_m)
    windows = ndimage.find_objects(labels)
    for index in np.flatnonzero(~is_vehicle_shaped(shapes) & large):
        window = windows[index]
        mask = labels[window] == index + 1
        known = bev.appearance_valid[window][mask][:, None]
        rgb = np.where(known, bev.appearance[:, *window][:, mask].T, np.nan)
        piece = _best_split(mask, np.argwhere(mask).astype(np.float64) * cell_m, rgb, cell_m)
        labels[window][mask] = np.where(piece == 0, index + 1, count + piece)
        count += int(piece.max())
    return count


def _best_split(mask: BoolArray, xy_m: FloatArray, rgb: FloatArray, cell_m: float) -> IntArray:
    """Return the piece of each cell of a mask (H, W), at (C, 2) with colours (C, 3); all 0 if not split."""
    whole = np.zeros(len(xy_m), dtype=np.int64)
    if len(xy_m) < 2:  # cells larger than cars
        return whole
    by_colour = _by_colour(mask, xy_m, rgb, cell_m)
    if _mean_deviation(xy_m, by_colour, cell_m) < np.inf:
        return by_colour
    # The whole and invalid splits have infinite deviation; the whole comes first.
    splits = [whole, *_candidate_splits(xy_m, rgb, cell_m)]
    return splits[int(np.argmin([_mean_deviation(xy_m, member, cell_m) for member in splits]))]


def _candidate_splits(xy_m: FloatArray, rgb: FloatArray, cell_m: float) -> Iterator[IntArray]:
    """Yield splits of C cells into 2, 3 ... compact pieces of similar colour, initialised along both axes."""
    known = np.asarray(np.isfinite(rgb).all(axis=1))
    mean_rgb = rgb[known].mean(axis=0) if known.any() else np.zeros(3)
    features = np.hstack([xy_m, METRES_PER_RGB * np.where(known[:, None], rgb, mean_rgb)])
    axes = np.linalg.eigh(np.cov(xy_m.T))[1].T
    most = min(MAX_PIECES, int(len(features) * cell_m**2 / MIN_PIECE_AREA_M2), len(features))
    for pieces in range(2, most + 1):
        for axis in axes:
            yield _k_means(features, xy_m @ axis, pieces)


def _mean_deviation(xy_m: FloatArray, member: IntArray, cell_m: float) -> float:
    """Return the mean size deviation of the pieces; infinite for one piece or if one is not vehicle-shaped."""
    pieces = int(member.max()) + 1
    shapes = fit_oriented_boxes(xy_m, member, pieces, cell_m)
    if pieces == 1 or not is_vehicle_shaped(shapes).all():
        return float("inf")
    return float(size_deviation(shapes).mean())


def _by_colour(mask: BoolArray, xy_m: FloatArray, rgb: FloatArray, cell_m: float) -> IntArray:
    """Return the pieces of the C cells of a mask, connected through neighbours of similar or unknown colour."""
    image = np.full((*mask.shape, 3), np.nan)
    image[mask] = rgb
    # A lattice with cells at even indices and links between them, so that labelling follows the links.
    lattice = np.zeros((2 * mask.shape[0] - 1, 2 * mask.shape[1] - 1), dtype=np.bool_)
    lattice[::2, ::2] = mask
    lattice[1::2, ::2] = mask[1:] & mask[:-1] & _similar(image[1:], image[:-1])
    lattice[::2, 1::2] = mask[:, 1:] & mask[:, :-1] & _similar(image[:, 1:], image[:, :-1])
    label = ndimage.label(lattice)[0][::2, ::2][mask]
    large = (np.bincount(label) * cell_m**2 >= MIN_PIECE_AREA_M2)[label]
    if large.any():
        colour_m = METRES_PER_RGB * np.nan_to_num(cdist(rgb[~large], rgb[large]))
        apart_m = cdist(xy_m[~large], xy_m[large]) + np.minimum(colour_m, MAX_COLOUR_M)
        label[~large] = label[large][apart_m.argmin(axis=1)]
    return np.unique(label, return_inverse=True)[1].astype(np.int64)


def _similar(one: FloatArray, other: FloatArray) -> BoolArray:
    """Return whether colours (..., 3) are similar, or one of them is unknown."""
    return np.asarray(~(np.linalg.norm(one - other, axis=-1) > COLOUR_STEP_RGB))


def _k_means(features: FloatArray, order: FloatArray, pieces: int, iterations: int = 30) -> IntArray:
    """Return the cluster of each row (C, F) by Lloyd's algorithm, from equal parts in the order of (C,)."""
    member = np.empty(len(features), np.int64)
    member[np.argsort(order, kind="stable")] = np.arange(len(features)) * pieces // len(features)
    size = np.bincount(member)
    for _ in range(iterations):
        sums = np.stack([np.bincount(member, column, pieces) for column in features.T], axis=1)
        nearest = cdist(features, sums / size[:, None], "sqeuclidean").argmin(axis=1)
        size = np.bincount(nearest, minlength=pieces)
        if not size.all() or (nearest == member).all():
            break
        member = nearest
    return member
