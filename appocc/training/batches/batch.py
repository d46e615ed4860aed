"""Batches of training samples or clips: images, camera rigs and ground truth."""

from __future__ import annotations

from typing import NamedTuple

from torch import Tensor

from appocc.camera import CameraRig
from appocc.models.memory import Past


class Truth(NamedTuple):
    """Ground truth of a batch; float32 where no type is given.

    Attributes:
        occupancy: (B, 3, X, Y) road, vehicle, lane; 0 or 1.
        occupancy_valid: (B, 3, X, Y) bool.
        appearance: (B, 3, X, Y) sRGB, 0..1.
        appearance_valid: (B, X, Y) bool.
        depth_m: (B, N, h, w) depth along the optical axis at 1/8 of the image size; infinite in the sky, 0 where
            unknown.
        kind: (B, N, h, w) int64 `ViewClass`, -1 where unknown.
        objects: (B, K, 13) objects, as packed by `packed_objects`; rows of NaN after the last one of a sample.
        owner: (B, X, Y) int64, 1 + index of the vehicle that covers the cell, 0 for none.
    """

    occupancy: Tensor
    occupancy_valid: Tensor
    appearance: Tensor
    appearance_valid: Tensor
    depth_m: Tensor
    kind: Tensor
    objects: Tensor
    owner: Tensor


class Batch(NamedTuple):
    """A batch of samples.

    Attributes:
        images: (B, N, 3, H, W) uint8 sRGB, float32 0..1 once prepared for a network; zeros where a rig has fewer than
            N cameras.
        rigs: camera rig of each sample, in the order of its images.
        truth: ground truth.
        number: index of each sample in its packed dataset.
        past: links of the frames of clips, which are then time-major; None for single frames.
    """

    images: Tensor
    rigs: tuple[CameraRig, ...]
    truth: Truth
    number: tuple[int, ...]
    past: Past | None = None
