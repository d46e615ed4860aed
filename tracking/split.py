"""Cutting blobs in which several vehicles touch: by colour, else by place and colour."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
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
MOST_PIECES = 5


def split_touching(labels: NDArray[np.int32], count: int, xy_m: FloatArray, rgb: FloatArray, cell_m: float) -> int:
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
    shapes = shapes_of(xy_m[cells], labels[cells].astype(np.int64) - 1, count, cell_m)
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
    for member in _cuts(mask, xy_m, rgb, cell_m):
        pieces = int(member.max()) + 1
        if pieces > 1 and like_a_vehicle(shapes_of(xy_m[mask], member, pieces, cell_m)).all():
            return member
    return np.zeros(int(mask.sum()), dtype=np.int64)


def _cuts(mask: BoolArray, xy_m: FloatArray, rgb: FloatArray, cell_m: float) -> Iterator[IntArray]:
    """Candidate cuts, the most certain first: where the colour steps, then into two, three ... compact pieces."""
    yield _by_colour(mask, rgb, cell_m)
    places, colours = xy_m[mask], rgb[mask]
    known = np.isfinite(colours).all(axis=1)
    usual = colours[known].mean(axis=0) if known.any() else np.zeros(3)
    features = np.hstack([places, METRES_PER_RGB * np.where(known[:, None], colours, usual)])
    for pieces in range(2, MOST_PIECES + 1):
        yield _k_means(features, pieces)


def _by_colour(mask: BoolArray, rgb: FloatArray, cell_m: float) -> IntArray:
    """Pieces joined by neighbours of like (or unknown) colour; specks go to the piece nearest to them."""
    height, width = mask.shape
    # A lattice with the cells at even places and their links between them, so that plain labelling obeys the links.
    lattice = np.zeros((2 * height - 1, 2 * width - 1), dtype=np.bool_)
    lattice[::2, ::2] = mask
    lattice[1::2, ::2] = mask[1:] & mask[:-1] & _alike(rgb[1:], rgb[:-1])
    lattice[::2, 1::2] = mask[:, 1:] & mask[:, :-1] & _alike(rgb[:, 1:], rgb[:, :-1])
    labels = ndimage.label(lattice)[0][::2, ::2]
    size_m2 = np.bincount(labels.ravel()) * cell_m**2
    large = (size_m2[labels] >= LEAST_PIECE_M2) & mask
    if not large.any():
        return np.zeros(int(mask.sum()), dtype=np.int64)
    nearest = ndimage.distance_transform_edt(~large, return_distances=False, return_indices=True)
    return np.unique(labels[tuple(nearest)][mask], return_inverse=True)[1].astype(np.int64)


def _alike(one: FloatArray, other: FloatArray) -> BoolArray:
    """Whether colours (..., 3) are near each other, or one of them is unknown."""
    return ~(np.linalg.norm(one - other, axis=-1) > COLOUR_STEP_RGB)


def _k_means(features: FloatArray, pieces: int, rounds: int = 30) -> IntArray:
    """Cluster of each row (C, F) by Lloyd's rounds, begun with equal shares along the longest axis."""
    centred = features - features.mean(axis=0)
    axis = np.linalg.eigh(centred.T @ centred)[1][:, -1]
    ranks = np.argsort(np.argsort(centred @ axis, kind="stable"), kind="stable")
    member = ranks * pieces // len(features)
    for _ in range(rounds):
        centres = np.stack([centred[member == piece].mean(axis=0) for piece in range(pieces)])
        nearest = cdist(centred, centres).argmin(axis=1)
        if (nearest == member).all() or len(np.unique(nearest)) < pieces:
            break
        member = nearest
    return member
