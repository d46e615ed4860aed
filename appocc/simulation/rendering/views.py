"""Camera views: the image and per-pixel ground truth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from appocc.checks import ByteArray, Float32Array


class PixelMaps(NamedTuple):
    """Maps of pixels: of a camera, (H, W), or of some of its pixels, (N,).

    Attributes:
        depth_m: float32 along the optical axis; infinite for the sky.
        actor: int32 index of the actor (the tag of its mesh), -1 for none.
        kind: uint8 `ViewClass`.
    """

    depth_m: Float32Array
    actor: NDArray[np.int32]
    kind: ByteArray

    @classmethod
    def empty(cls, shape: tuple[int, int]) -> PixelMaps:
        """Return flat maps of a picture (H, W), to be written."""
        size = shape[0] * shape[1]
        return cls(np.empty(size, np.float32), np.empty(size, np.int32), np.empty(size, np.uint8))

    def rows(self, rows: slice) -> PixelMaps:
        """Return a part of flat maps, which shares their memory."""
        return PixelMaps(self.depth_m[rows], self.actor[rows], self.kind[rows])

    def shaped(self, shape: tuple[int, int]) -> PixelMaps:
        """Return flat maps as (H, W)."""
        return PixelMaps(self.depth_m.reshape(shape), self.actor.reshape(shape), self.kind.reshape(shape))


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
