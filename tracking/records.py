"""Records of detections, tracks and predictions: structured arrays, which a compiled loop takes as one argument.

A call with many small arrays takes longer than the loop over a few vehicles.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from appocc.checks import BoolArray

Records = NDArray[np.void]

# Columns of the attributes of a detection whose medians are kept.
SIZE, RGB, LAB = slice(0, 3), slice(3, 6), slice(6, 9)

# A detection in the world frame.
DETECTION = np.dtype(
    [
        ("position_world_m", np.float64, 3),  # point on the ground below the centre
        ("yaw_world_rad", np.float64),
        ("heading_known", np.bool_),  # whether the heading distinguishes front and rear
        ("size_m", np.float64, 3),  # width, length, height
        ("rgb", np.float64, 3),
        ("lab", np.float64, 3),  # CIELAB, NaN where unknown
        ("colour_density", np.float64),  # of the colour among vehicles, see `association.paint.paint_density`
        ("noise_m2", np.float64, (2, 2)),  # configured covariance of the position, for association
        ("surplus_noise_m2", np.float64, (2, 2)),  # what it exceeds the learnt covariance by
        ("velocity_world_mps", np.float64, 2),  # measured velocity; 0 where unknown
        ("velocity_m2ps2", np.float64, (2, 2)),  # covariance of it, with which a track starts
        ("axis", np.float64, 2),  # unit vector at twice the heading, weighted by how elongated the shape is
        ("log_odds", np.float64),  # of being a vehicle, for thresholds
        ("evidence", np.float64),  # the same for the score, lower if the object is detected as another category, too
        ("truncated", np.bool_),  # whether a part may be missing
        ("kind", np.int64),  # number of the category
        ("noise_level", np.int64),  # interval of the log-odds with a noise of its own, see `ClassTable`
    ],
    align=True,
)

# The state of a track but for its filter and medians.
TRACK = np.dtype(
    [
        ("id", np.int64),
        ("kind", np.int64),  # number of the category
        ("detection", np.int64),  # index of the detection matched in this frame; -1 if none
        ("confirmed", np.bool_),
        ("lost", np.bool_),  # whether the track was lost before this frame
        ("stationary", np.bool_),
        ("moving", np.bool_),  # whether the velocity differs from zero
        ("yaw_rad", np.float64),  # heading in the world frame
        ("unseen_s", np.float64),  # time since the last detection
        ("missed_s", np.float64),  # the same without the time in blind spots
        ("moved_s", np.float64),  # the same without the time a stationary track keeps its position
        ("tracked_s", np.float64),  # time from the first to the last detection
        ("ground_m", np.float64),  # height of the ground
        ("front_votes", np.float64),  # evidence for the end that is taken as front
        ("front_known", np.bool_),  # whether detections or motion tell it
        ("hidden", np.float64),  # share that nearer boxes hid in the last frame with a miss
        ("axis", np.float64, 2),  # smoothed vector at twice the heading
        ("earlier_axis", np.float64, 2),  # the same, smoothed twice
        ("innovation_m", np.float64, 2),  # of the last detection; NaN for a new track
        ("detected", np.float64, 2),  # sum and weight of the evidence of detections
        ("with_misses", np.float64, 2),  # the same with misses
    ],
    align=True,
)

# What association needs to know of a track: its prediction.
PREDICTION = np.dtype(
    [
        ("xy_m", np.float64, 2),
        ("cov_m2", np.float64, (2, 2)),  # covariance of the position
        ("yaw_rad", np.float64),
        ("size_m", np.float64, 2),  # width and length
        ("lab", np.float64, 3),  # CIELAB, NaN where unknown
        ("lab_variance", np.float64, 3),  # variance of a detection's colour about it
        ("kind", np.int64),  # number of the category
        ("unseen_s", np.float64),  # time since the last detection
        ("displacement_m", np.float64, 2),  # since the last detection, for straight motion
        ("gate_scale", np.float64),  # factor on gates in metres
        ("heading_weight", np.float64),  # factor on the heading cost; tracks with 0 do not turn along arcs
    ],
    align=True,
)


def compress(records: Records, mask: BoolArray) -> Records:
    """Return the records of a mask (N,)."""
    return _as_bytes(records).compress(mask).view(records.dtype)


def append(records: Records, more: Records) -> Records:
    """Return records and more of them."""
    return np.concatenate([_as_bytes(records), _as_bytes(more)]).view(records.dtype)


def _as_bytes(records: Records) -> Records:
    """Return a view without fields: numpy copies fields one by one."""
    return records.view((np.void, records.dtype.itemsize))
