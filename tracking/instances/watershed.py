"""Separation of vehicles by probability: suppression below the peak of a component, and watershed splits."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from appocc.checks import BoolArray, Float32Array, IntArray
from tracking.instances.oriented_boxes import fit_oriented_boxes, is_vehicle_shaped, size_deviation

# Smaller components are not split.
MIN_SPLIT_AREA_M2 = 8.0
# Minimum prominence of a peak in log-odds, and the standard deviation of the smoothing before.
MIN_PROMINENCE = 0.2
SMOOTHING_SIGMA_CELLS = 0.7
# Log-odds are clipped here (a probability of 0.9975); larger ones are saturated.
MAX_LOG_ODDS = 6.0
# Extra size deviation of a piece that is not vehicle-shaped, such as the cab of a truck.
NON_VEHICLE_PENALTY = 0.3


def suppress_below_peak(labels: IntArray, count: int, probability: Float32Array, share: float) -> int:
    """Remove cells below a fraction of the peak of their component 1..count, and relabel what remains.

    Predicted probabilities decrease slowly around a vehicle, and are often above the threshold between two vehicles.
    Labels (X, Y) are changed in place.

    Returns:
        The number of components afterwards.
    """
    cells, here, peak = _cells(labels, count, probability)
    below = here < np.float32(share) * peak
    if not below.any():
        return count
    labels.reshape(-1)[cells[below]] = 0
    found, count = ndimage.label(labels)
    labels[:] = found
    return count


def split_by_watershed(labels: IntArray, count: int, probability: Float32Array, cell_m: float) -> int:
    """Split large components of 1..count by a watershed of their probability; flat ones are not changed.

    Labels (X, Y) are changed in place: the first piece keeps its label, the others are appended.

    Returns:
        The number of components afterwards.
    """
    cells, here, peak = _cells(labels, count, probability)
    group = labels.reshape(-1)[cells]
    large = np.bincount(group, minlength=count + 1)[1:] * cell_m**2 >= MIN_SPLIT_AREA_M2
    uneven = np.bincount(group[here < peak], minlength=count + 1)[1:] > 0
    if not (large & uneven).any():
        return count
    windows = ndimage.find_objects(labels)
    for index in np.flatnonzero(large & uneven):
        window = windows[index]
        mask = labels[window] == index + 1
        member = _merge_pieces(_basins(mask, probability[window]), mask, cell_m)
        labels[window][mask] = np.where(member == 0, index + 1, count + member)
        count += int(member.max())
    return count


def _cells(labels: IntArray, count: int, probability: Float32Array) -> tuple[IntArray, Float32Array, Float32Array]:
    """Return flat indices of the C labelled cells, their probabilities, and the peaks of their components."""
    cells = np.flatnonzero(labels)
    group, here = labels.reshape(-1)[cells], probability.reshape(-1)[cells]
    peaks = np.zeros(count + 1, np.float32)
    np.maximum.at(peaks, group, here)
    return cells, here, peaks[group]


def _basins(mask: BoolArray, probability: Float32Array) -> IntArray:
    """Return the basin 1.. of each cell of a mask (H, W), one per prominent peak; 0 outside the mask."""
    from skimage.morphology import local_maxima, reconstruction
    from skimage.segmentation import watershed

    # Normalised smoothing over the mask, so that a flat probability stays flat.
    weight = ndimage.gaussian_filter(mask.astype(np.float64), SMOOTHING_SIGMA_CELLS, mode="constant")
    smooth = ndimage.gaussian_filter(np.where(mask, probability, 0.0), SMOOTHING_SIGMA_CELLS, mode="constant")
    share = np.clip(smooth / np.maximum(weight, 1e-9), 1e-9, 1 - 1e-9)
    height = np.where(mask, np.clip(np.log(share / (1 - share)), -MAX_LOG_ODDS, MAX_LOG_ODDS), -2 * MAX_LOG_ODDS)
    # h-maxima: the reconstruction flattens peaks below the minimum prominence.
    tops = np.pad(reconstruction(height - MIN_PROMINENCE, height), 1, constant_values=-3 * MAX_LOG_ODDS)
    marks = ndimage.label(local_maxima(tops)[1:-1, 1:-1], np.ones((3, 3)))[0]
    return np.asarray(watershed(-height, marks, mask=mask)).astype(np.int64)


def _merge_pieces(pieces: IntArray, mask: BoolArray, cell_m: float) -> IntArray:
    """Return the piece 0.. of each of the C cells of a mask, after merging neighbours that form one vehicle.

    The merge with the largest gain is made first.
    """
    xy_m = np.argwhere(mask).astype(np.float64) * cell_m
    member = np.unique(pieces[mask], return_inverse=True)[1].astype(np.int64)
    image = np.full(mask.shape, -1)
    while True:
        image[mask] = member
        pairs = _adjacent_pairs(image)
        if not len(pairs):
            return member
        shapes = fit_oriented_boxes(xy_m, member, int(member.max()) + 1, cell_m)
        odd = (size_deviation(shapes) + NON_VEHICLE_PENALTY * ~is_vehicle_shaped(shapes))[pairs]
        area_m2 = shapes.area_m2[pairs]
        cells = [np.flatnonzero((member == one) | (member == other)) for one, other in pairs]
        owner = np.repeat(np.arange(len(pairs)), [len(some) for some in cells])
        unions = fit_oriented_boxes(xy_m[np.concatenate(cells)], owner, len(pairs), cell_m)
        gain = (odd * area_m2).sum(axis=1) / area_m2.sum(axis=1) - size_deviation(unions)
        gain[~is_vehicle_shaped(unions)] = -np.inf
        best = int(gain.argmax())
        if gain[best] <= 0:
            return member
        one, other = pairs[best]
        member[member == other] = one
        member[member > other] -= 1


def _adjacent_pairs(image: IntArray) -> IntArray:
    """Return pairs (P, 2) of labels, the lower one first, whose cells share a side; -1 is background."""
    sides = [(image[1:], image[:-1]), (image[:, 1:], image[:, :-1])]
    pairs = np.concatenate([np.stack([one.ravel(), other.ravel()], axis=1) for one, other in sides])
    pairs = pairs[(pairs[:, 0] != pairs[:, 1]) & (pairs.min(axis=1) >= 0)]
    return np.asarray(np.unique(np.sort(pairs, axis=1), axis=0))
