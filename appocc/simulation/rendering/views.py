"""Camera views: the image and per-pixel ground truth."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from appocc.checks import ByteArray, Float32Array


class ViewClass(IntEnum):
    """What a pixel's centre shows."""

    SKY = 0
    ROAD = 1
    LANE_MARKING = 2
    PAVEMENT = 3
    TERRAIN = 4
    BUILDING = 5
    VEGETATION = 6
    POLE_OR_SIGN = 7
    VEHICLE = 8
    TWO_WHEELER = 9
    PERSON = 10
    OTHER = 11


@dataclass(frozen=True, eq=False)
class CameraView:
    """Image and pixel maps of one camera; H rows, W columns.

    Attributes:
        image: (H, W, 3) uint8 sRGB.
        depth_m: (H, W) float32 along the optical axis; infinite for the sky.
        actor: (H, W) int32 index of the actor (the tag of its mesh), -1 for none.
        kind: (H, W) uint8 `ViewClass`.
    """

    image: ByteArray
    depth_m: Float32Array
    actor: NDArray[np.int32]
    kind: ByteArray
