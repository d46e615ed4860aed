"""What a camera sees: the picture, and exactly what is in each of its pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from appocc.checks import ByteArray, Float32Array


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
