"""Camera views: the image and per-pixel ground truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from appocc.checks import ByteArray, Float32Array


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
