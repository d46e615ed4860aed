"""Cutting blobs in which several vehicles touch: by colour, else by place and colour."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy import ndimage
from scipy.spatial.distance import cdist

from appocc.bevmap import BEVMap
from appocc.checks import BoolArray, FloatArray, IntArray
from tracking.instances.oriented_boxes import like_a_vehicle, oddness, shapes_of

# Two usual cars cover more than this; anything smaller is taken as one vehicle, however ragged.
LEAST_CUT_M2 = 14.0
# Pieces of one colour that are smaller than this are parts of a vehicle (windows, lamps), not vehicles.
LEAST_PIECE_M2 = 3.5
# Neighbouring cells farther apart in RGB belong to different vehicles; 50 RGB steps weigh as much as a metre.
COLOUR_STEP_RGB = 40.0
METRES_PER_RGB = 0.02
MOST_PIECES = 8
# A part of a vehicle may be of any colour: no difference weighs more than this when it looks for its vehicle.
MOST_COLOUR_M = 2.0


def split_touching(labels: IntArray, count: int, bev: BEVMap) -> int:
    """Cut those of the blobs 1..count of a map that do not look like one vehicle into pieces that all do.

    Labels (X, Y), 0 outside blobs, are changed in place: the first piece keeps its number, the others follow after
    the last. A blob for which no such cut is found stays whole.

    Returns:
        The number of blobs afterwards.
    """
    cell_m = bev.grid.cell_m
    cells = np.flatnonzero(labels)
    member = labels.reshape(-1)[cells] - 1
    large = np.bincount(member, minlength=count) * cell_m**2 >= LEAST_CUT_M2
    if not large.any():
        return count
    places = np.stack(np.divmod(cells, labels.shape[1]), axis=1)
    shapes = shapes_of(bev.grid.centre_of(places), member, count, cell_m)
    windows = ndimage.find_objects(labels)
    for blob in np.flatnonzero(~like_a_vehicle(shapes) & large):
        window = windows[blob]
        mask = labels[window] == blob + 1
        known = bev.appearance_valid[window][mask][:, None]
        rgb = np.where(known, bev.appearance[:, *window][:, mask].T, np.nan)
        piece = _best_cut(mask, np.argwhere(mask).astype(np.float64) * cell_m, rgb, cell_m)
        labels[window][mask] = np.where(piece == 0, blob + 1, count + piece)
        count += int(piece.max())
    return count


def _best_cut(mask: BoolArray, xy_m: FloatArray, rgb: FloatArray, cell_m: float) -> IntArray:
    """Piece of each of the C cells of a mask (H, W), at (C, 2) and of (C, 3); 0 where no cut leaves only vehicles."""
    whole = np.zeros(len(xy_m), dtype=np.int64)
    if len(xy_m) < 2:  # of a grid whose cells are larger than cars
        return whole
    by_colour = _by_colour(mask, xy_m, rgb, cell_m)
    if _oddness(xy_m, by_colour, cell_m) < np.inf:
        return by_colour
    # Whole is as odd as a cut that leaves no vehicles: infinitely, and it comes first.
    cuts = [whole, *_cuts(xy_m, rgb, cell_m)]
    return cuts[int(np.argmin([_oddness(xy_m, member, cell_m) for member in cuts]))]


def _cuts(xy_m: FloatArray, rgb: FloatArray, cell_m: float) -> Iterator[IntArray]:
    """Cuts of C cells into two, three ... compact pieces of like colour, begun lengthwise and across."""
    known = np.asarray(np.isfinite(rgb).all(axis=1))
    usual = rgb[known].mean(axis=0) if known.any() else np.zeros(3)
    features = np.hstack([xy_m, METRES_PER_RGB * np.where(known[:, None], rgb, usual)])
    axes = np.linalg.eigh(np.cov(xy_m.T))[1].T
    most = min(MOST_PIECES, int(len(features) * cell_m**2 / LEAST_PIECE_M2), len(features))
    for pieces in range(2, most + 1):
        for axis in axes:
            yield _k_means(features, xy_m @ axis, pieces)


def _oddness(xy_m: FloatArray, member: IntArray, cell_m: float) -> float:
    """How far the pieces are from a usual car; infinite if one cannot be a vehicle or there is only one."""
    pieces = int(member.max()) + 1
    shapes = shapes_of(xy_m, member, pieces, cell_m)
    if pieces == 1 or not like_a_vehicle(shapes).all():
        return float("inf")
    return float(oddness(shapes).mean())


def _by_colour(mask: BoolArray, xy_m: FloatArray, rgb: FloatArray, cell_m: float) -> IntArray:
    """Pieces of the C cells of a mask, joined by neighbours of like (or unknown) colour."""
    image = np.full((*mask.shape, 3), np.nan)
    image[mask] = rgb
    # A lattice with the cells at even places and their links between them, so that plain labelling obeys the links.
    lattice = np.zeros((2 * mask.shape[0] - 1, 2 * mask.shape[1] - 1), dtype=np.bool_)
    lattice[::2, ::2] = mask
    lattice[1::2, ::2] = mask[1:] & mask[:-1] & _alike(image[1:], image[:-1])
    lattice[::2, 1::2] = mask[:, 1:] & mask[:, :-1] & _alike(image[:, 1:], image[:, :-1])
    label = ndimage.label(lattice)[0][::2, ::2][mask]
    large = (np.bincount(label) * cell_m**2 >= LEAST_PIECE_M2)[label]
    if large.any():
        colour_m = METRES_PER_RGB * np.nan_to_num(cdist(rgb[~large], rgb[large]))
        apart_m = cdist(xy_m[~large], xy_m[large]) + np.minimum(colour_m, MOST_COLOUR_M)
        label[~large] = label[large][apart_m.argmin(axis=1)]
    return np.unique(label, return_inverse=True)[1].astype(np.int64)


def _alike(one: FloatArray, other: FloatArray) -> BoolArray:
    """Whether colours (..., 3) are near each other, or one of them is unknown."""
    return np.asarray(~(np.linalg.norm(one - other, axis=-1) > COLOUR_STEP_RGB))


def _k_means(features: FloatArray, order: FloatArray, pieces: int, rounds: int = 30) -> IntArray:
    """Cluster of each row (C, F) by Lloyd's rounds, begun with equal shares in the order of (C,) values."""
    member = np.empty(len(features), np.int64)
    member[np.argsort(order, kind="stable")] = np.arange(len(features)) * pieces // len(features)
    size = np.bincount(member)
    for _ in range(rounds):
        sums = np.stack([np.bincount(member, column, pieces) for column in features.T], axis=1)
        nearest = cdist(features, sums / size[:, None], "sqeuclidean").argmin(axis=1)
        size = np.bincount(nearest, minlength=pieces)
        if not size.all() or (nearest == member).all():
            break
        member = nearest
    return member
