"""What a camera sees: the picture, and exactly what is in each of its pixels."""

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


@dataclass(frozen=True)
class View:
    """One camera's picture and its maps; H rows, W columns.

    Attributes:
        image: (H, W, 3) uint8 sRGB.
        depth_m: (H, W) float32 along the optical axis; infinite where the sky is.
        actor: (H, W) int32 number of the actor (its mesh's tag), -1 where there is none.
        kind: (H, W) uint8 `ViewClass`.
    """

    image: ByteArray
    depth_m: Float32Array
    actor: NDArray[np.int32]
    kind: ByteArray
