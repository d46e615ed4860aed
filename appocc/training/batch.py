"""What the loop is given: pictures with the rigs that took them, and what is true."""

from __future__ import annotations

from typing import NamedTuple

from torch import Tensor

from appocc.camera import CameraRig


class Truth(NamedTuple):
    """What is true of a batch; sRGB and shares are 0..1, all arrays float32 unless said.

    Attributes:
        occupancy: (B, 3, X, Y) road, vehicle, lane, 0 or 1.
        occupancy_valid: (B, 3, X, Y) bool.
        appearance: (B, 3, X, Y) sRGB, 0..1.
        appearance_valid: (B, X, Y) bool.
        depth_m: (B, N, h, w) along the optical axis, infinite in the sky, 0 where unknown; at an eighth of the size.
        kind: (B, N, h, w) int64 `ViewClass`, -1 where unknown.
    """

    occupancy: Tensor
    occupancy_valid: Tensor
    appearance: Tensor
    appearance_valid: Tensor
    depth_m: Tensor
    kind: Tensor


class Batch(NamedTuple):
    """Samples together.

    Attributes:
        images: (B, N, 3, H, W) float32 sRGB, 0..1; zeros where a rig has fewer than N cameras.
        rigs: of each sample, the cameras of its pictures in their order.
        truth: see `Truth`.
        number: of each sample in its pack.
    """

    images: Tensor
    rigs: tuple[CameraRig, ...]
    truth: Truth
    number: tuple[int, ...]
