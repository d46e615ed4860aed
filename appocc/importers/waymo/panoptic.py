"""Panoptic labels of pictures (camera_segmentation.proto) as pixel classes."""

from __future__ import annotations

import numpy as np

from appocc.checks import ByteArray
from appocc.errors import DataError
from appocc.files import decoded_labels
from appocc.importers.waymo.segment import PanopticLabel
from appocc.nuscenes.view_targets import UNKNOWN_KIND, ViewClass

# Our classes by CameraSegmentation.Type. Undefined pixels (0) and the own vehicle (1) have none; cyclists and
# motorcyclists are labelled together with what they ride; arrows, crossings and stop lines are one type: road.
_KINDS = {
    ViewClass.SKY: (25,),
    ViewClass.ROAD: (20, 22),
    ViewClass.LANE_MARKING: (21,),
    ViewClass.PAVEMENT: (23,),
    ViewClass.TERRAIN: (26,),
    ViewClass.BUILDING: (19,),
    ViewClass.VEGETATION: (24,),
    ViewClass.POLE_OR_SIGN: (15, 17, 18),
    ViewClass.VEHICLE: (2, 3, 4, 5, 8),
    ViewClass.TWO_WHEELER: (6, 7, 10, 11),
    ViewClass.PERSON: (9,),
    ViewClass.OTHER: (12, 13, 14, 16, 27, 28),
}
_MOST = np.iinfo(np.uint16).max


def kinds_of(name: str, label: PanopticLabel, size_px: tuple[int, int]) -> ByteArray:
    """Return the (H, W) uint8 `ViewClass` of each pixel of a panoptic label, `UNKNOWN_KIND` where not labelled.

    Raises:
        DataError: if the label is damaged, has another size (width, height) or no divisor; `name` names it in the
            message.
    """
    if not 1 <= label.divisor <= _MOST:
        raise DataError(f"{name}: panoptic_label_divisor: expected 1 to {_MOST}, got {label.divisor}")
    table: ByteArray = np.full(_MOST + 1, UNKNOWN_KIND, np.uint8)
    for kind, types in _KINDS.items():
        table[list(types)] = kind
    return np.asarray(table[decoded_labels(name, label.png, size_px) // np.uint16(label.divisor)])
