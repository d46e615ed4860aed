"""Where probability tells vehicles apart: cells well below the peak of their group, and valleys between peaks."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from appocc.checks import BoolArray, Float32Array, IntArray
from tracking.instances.oriented_boxes import like_a_vehicle, oddness, shapes_of

# Smaller groups are one vehicle, whatever their peaks.
LEAST_CUT_M2 = 8.0
# A peak counts if it rises this far, in log-odds, above the way to any higher one, in a probability smoothed by this.
RISE = 0.2
SMOOTH_CELLS = 0.7
# Log-odds beyond this (a probability of 0.9975) are saturated: their differences say nothing.
MOST_LOG_ODDS = 6.0
# A piece that cannot be a vehicle by itself (the cab of a lorry) is this much odder than its size.
NOT_ALONE = 0.3


def above_peaks(labels: IntArray, count: int, probability: Float32Array, share: float) -> int:
    """Leave of the groups 1..count only cells with at least a share of their group's peak; what falls apart is cut.

    A network's answer goes down gently beside a vehicle it is sure of, and what lies between two is often still
    above the threshold. Labels (X, Y) are changed in place.

    Returns:
        The number of groups afterwards.
    """
    cells, here, peak = _cells(labels, count, probability)
    below = here < np.float32(share) * peak
    if not below.any():
        return count
    labels.reshape(-1)[cells[below]] = 0
    found, count = ndimage.label(labels)
    labels[:] = found
    return count


def split_at_valleys(labels: IntArray, count: int, probability: Float32Array, cell_m: float) -> int:
    """Cut the large ones of the groups 1..count where their probability has valleys; a flat one stays whole.

    Labels (X, Y) are changed in place: the first piece keeps its number, the others follow after the last.

    Returns:
        The number of groups afterwards.
    """
    cells, here, peak = _cells(labels, count, probability)
    group = labels.reshape(-1)[cells]
    large = np.bincount(group, minlength=count + 1)[1:] * cell_m**2 >= LEAST_CUT_M2
    uneven = np.bincount(group[here < peak], minlength=count + 1)[1:] > 0
    if not (large & uneven).any():
        return count
    windows = ndimage.find_objects(labels)
    for blob in np.flatnonzero(large & uneven):
        window = windows[blob]
        mask = labels[window] == blob + 1
        member = _joined(_basins(mask, probability[window]), mask, cell_m)
        labels[window][mask] = np.where(member == 0, blob + 1, count + member)
        count += int(member.max())
    return count


def _cells(labels: IntArray, count: int, probability: Float32Array) -> tuple[IntArray, Float32Array, Float32Array]:
    """The C cells of groups 1..count by place in the flat image, their probabilities, and their groups' peaks."""
    cells = np.flatnonzero(labels)
    group, here = labels.reshape(-1)[cells], probability.reshape(-1)[cells]
    peaks = np.zeros(count + 1, np.float32)
    np.maximum.at(peaks, group, here)
    return cells, here, peaks[group]


def _basins(mask: BoolArray, probability: Float32Array) -> IntArray:
    """Piece 1.. of each cell of a mask (H, W), one for each peak that rises far enough; 0 outside the mask."""
    from skimage.morphology import local_maxima, reconstruction
    from skimage.segmentation import watershed

    # Smoothed over the cells of the mask alone, so that a flat probability stays flat.
    weight = ndimage.gaussian_filter(mask.astype(np.float64), SMOOTH_CELLS, mode="constant")
    smooth = ndimage.gaussian_filter(np.where(mask, probability, 0.0), SMOOTH_CELLS, mode="constant")
    share = np.clip(smooth / np.maximum(weight, 1e-9), 1e-9, 1 - 1e-9)
    height = np.where(mask, np.clip(np.log(share / (1 - share)), -MOST_LOG_ODDS, MOST_LOG_ODDS), -2 * MOST_LOG_ODDS)
    # Peaks of what is left when every hill is cut off by RISE: of hills that rise less above a pass, one flat top.
    tops = np.pad(reconstruction(height - RISE, height), 1, constant_values=-3 * MOST_LOG_ODDS)
    marks = ndimage.label(local_maxima(tops)[1:-1, 1:-1], np.ones((3, 3)))[0]
    return np.asarray(watershed(-height, marks, mask=mask)).astype(np.int64)


def _joined(pieces: IntArray, mask: BoolArray, cell_m: float) -> IntArray:
    """Number 0.. of each of the C cells of a mask, after neighbours were joined that are rather one vehicle than two.

    Of all such neighbours, those that gain most are joined first.
    """
    xy_m = np.argwhere(mask).astype(np.float64) * cell_m
    member = np.unique(pieces[mask], return_inverse=True)[1].astype(np.int64)
    image = np.full(mask.shape, -1)
    while True:
        image[mask] = member
        pairs = _neighbours(image)
        if not len(pairs):
            return member
        shapes = shapes_of(xy_m, member, int(member.max()) + 1, cell_m)
        odd = (oddness(shapes) + NOT_ALONE * ~like_a_vehicle(shapes))[pairs]
        area_m2 = shapes.area_m2[pairs]
        cells = [np.flatnonzero((member == one) | (member == other)) for one, other in pairs]
        owner = np.repeat(np.arange(len(pairs)), [len(some) for some in cells])
        unions = shapes_of(xy_m[np.concatenate(cells)], owner, len(pairs), cell_m)
        gain = (odd * area_m2).sum(axis=1) / area_m2.sum(axis=1) - oddness(unions)
        gain[~like_a_vehicle(unions)] = -np.inf
        best = int(gain.argmax())
        if gain[best] <= 0:
            return member
        one, other = pairs[best]
        member[member == other] = one
        member[member > other] -= 1


def _neighbours(image: IntArray) -> IntArray:
    """(P, 2) pairs of numbers, the lower one first, whose cells share a side in an image with -1 outside."""
    sides = [(image[1:], image[:-1]), (image[:, 1:], image[:, :-1])]
    pairs = np.concatenate([np.stack([one.ravel(), other.ravel()], axis=1) for one, other in sides])
    pairs = pairs[(pairs[:, 0] != pairs[:, 1]) & (pairs.min(axis=1) >= 0)]
    return np.asarray(np.unique(np.sort(pairs, axis=1), axis=0))
