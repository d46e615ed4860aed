"""Cutting blobs in which several vehicles touch: by colour, else by place and colour."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy import ndimage
from scipy.spatial.distance import cdist

from appocc.checks import BoolArray, FloatArray, IntArray
from tracking.shapes import like_a_vehicle, shapes_of

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
# Length and width of a usual car, to choose between cuts.
CAR_M = (4.6, 1.9)


def split_touching(labels: IntArray, count: int, xy_m: FloatArray, rgb: FloatArray, cell_m: float) -> int:
    """Cut those of the blobs 1..count that do not look like one vehicle into pieces that all do.

    Labels (X, Y) are changed in place: the first piece keeps its number, the others follow after the last. A blob
    for which no such cut is found stays whole.

    Args:
        labels: (X, Y), 0 outside blobs.
        count: number of blobs.
        xy_m: (X, Y, 2) centres of the cells, ego frame.
        rgb: (X, Y, 3) colours 0..255, NaN where unknown.
        cell_m: size of a cell.

    Returns:
        The number of blobs afterwards.
    """
    cells = labels > 0
    shapes = shapes_of(xy_m[cells], labels[cells] - 1, count, cell_m)
    windows = ndimage.find_objects(labels)
    for blob in np.flatnonzero(~like_a_vehicle(shapes) & (shapes.area_m2 >= LEAST_CUT_M2)):
        window = windows[blob]
        mask = labels[window] == blob + 1
        member = _best_cut(mask, xy_m[window], rgb[window], cell_m)
        labels[window][mask] = np.where(member == 0, blob + 1, count + member)
        count += int(member.max())
    return count


def _best_cut(mask: BoolArray, xy_m: FloatArray, rgb: FloatArray, cell_m: float) -> IntArray:
    """Piece of each of the C cells of a mask (H, W); all 0 where no cut leaves only vehicles."""
    places, colours = xy_m[mask], rgb[mask]
    if len(places) < 2:  # of a grid whose cells are larger than cars
        return np.zeros(len(places), dtype=np.int64)
    by_colour = _by_colour(mask, places, colours, cell_m)
    if _oddness(places, by_colour, cell_m) < np.inf:
        return by_colour
    cuts = list(_cuts(places, colours))
    odd = [_oddness(places, member, cell_m) for member in cuts]
    return cuts[int(np.argmin(odd))] if min(odd) < np.inf else np.zeros(len(places), dtype=np.int64)


def _cuts(xy_m: FloatArray, rgb: FloatArray) -> Iterator[IntArray]:
    """Cuts of C cells into two, three ... compact pieces of like colour, begun lengthwise and across."""
    known = np.asarray(np.isfinite(rgb).all(axis=1))
    usual = rgb[known].mean(axis=0) if known.any() else np.zeros(3)
    features = np.hstack([xy_m, METRES_PER_RGB * np.where(known[:, None], rgb, usual)])
    axes = np.linalg.eigh(np.cov(xy_m.T))[1].T
    for pieces in range(2, min(MOST_PIECES, len(features)) + 1):
        for axis in axes:
            yield _k_means(features, xy_m @ axis, pieces)


def _oddness(xy_m: FloatArray, member: IntArray, cell_m: float) -> float:
    """How far the pieces are from a usual car; infinite if one cannot be a vehicle or there is only one."""
    pieces = int(member.max()) + 1
    shapes = shapes_of(xy_m, member, pieces, cell_m)
    if pieces == 1 or not like_a_vehicle(shapes).all():
        return float("inf")
    size = np.stack([shapes.length_m, shapes.width_m], axis=1)
    return float(np.abs(np.log(size / CAR_M)).sum(axis=1).mean())


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
    member = np.argsort(np.argsort(order, kind="stable"), kind="stable") * pieces // len(features)
    for _ in range(rounds):
        centres = np.stack([features[member == piece].mean(axis=0) for piece in range(pieces)])
        nearest = cdist(features, centres).argmin(axis=1)
        if (nearest == member).all() or len(np.unique(nearest)) < pieces:
            break
        member = nearest
    return member
