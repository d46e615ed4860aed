"""Interface of the networks: inputs, outputs and view-transform plans."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import NamedTuple, Protocol, Self

import torch
from torch import Tensor, nn

from appocc.camera import CameraRig
from appocc.models.memory import Past
from appocc.models.model_spec import ModelSpec, Parts
from appocc.probability_calibration import Calibration

# Depth bins of the paper (section III): centres 4.5 .. 44.5 m.
DEPTH_BINS = 41
FIRST_DEPTH_M, DEPTH_STEP_M = 4.5, 1.0
# Unit of predicted velocities.
VELOCITY_UNIT_MPS = 10.0


class ViewTransformPlan(Protocol):
    """Precomputed view transform of a batch of rigs: which image features go to which grid cells.

    Attributes:
        seen: (B, X, Y) bool, cells that a camera of the rig can see.
    """

    @property
    def seen(self) -> Tensor:
        """(B, X, Y) bool, cells that a camera of the rig can see."""
        ...

    def to(self, device: torch.device) -> Self:
        """Return the plan on a device."""
        ...

    def for_export(self) -> Self:
        """Return the plan for export: the network then uses only operations that exporters support; slower."""
        ...


class ImageOutput(NamedTuple):
    """Image-space predictions for auxiliary losses; None if a network has none.

    Attributes:
        depth: (B, N, DEPTH_BINS, h, w) logits of the depth of each feature.
        kind: (B, N, K, h, w) logits of the class of each feature, `ViewClass`.
    """

    depth: Tensor | None
    kind: Tensor | None


class ObjectOutput(NamedTuple):
    """Objects at cells of twice the size of the grid, X' = X / 2 and Y' = Y / 2; float32.

    Attributes:
        centre: (B, len(KINDS), X', Y') logits of object centres.
        offset: (B, 2, X', Y') from the centre of the cell to that of the object, x and y, in cells.
        height: (B, 1, X', Y') z of the box centre, metres.
        size: (B, 3, X', Y') logarithms of width, length and height in metres.
        heading: (B, 2, X', Y') sine and cosine of the heading, not normalised.
        velocity: (B, 2, X', Y') velocity over the ground along x and y, in 10 m/s.
        axis: (B, 2, X', Y') sine and cosine of twice the heading, not normalised: the same for both directions.
    """

    centre: Tensor
    offset: Tensor
    height: Tensor
    size: Tensor
    heading: Tensor
    velocity: Tensor
    axis: Tensor


class ModelOutput(NamedTuple):
    """Model output.

    Attributes:
        occupancy: (B, 3, X, Y) logits of road, vehicle, lane.
        appearance: (B, 3, X, Y) sRGB, 0..1; None for networks that predict occupancy only.
        views: image-space predictions; None outside training.
        objects: objects; None for networks without object heads.
        memory: (B, C, X', Y') memory for the next frame of each clip; None for networks without memory.
    """

    occupancy: Tensor
    appearance: Tensor | None
    views: ImageOutput | None
    objects: ObjectOutput | None = None
    memory: Tensor | None = None


class BEVModel(nn.Module, ABC):
    """A network that predicts a bird's-eye-view grid from the images of a camera rig.

    Images are (B, N, 3, H, W) sRGB, 0..1, of the size in the model spec, one per camera in the order of the rig. Rigs
    of a batch may have fewer than N cameras: the remaining images are ignored. Missing cameras are not part of the
    rig.
    """

    spec: ModelSpec
    parts: Parts = Parts()

    @abstractmethod
    def plan(self, rigs: Sequence[CameraRig]) -> ViewTransformPlan:
        """Return the view-transform plan of a batch; the cameras are those of the images after `fit_image`."""

    @abstractmethod
    def forward(self, images: Tensor, plan: ViewTransformPlan, past: Past | None = None) -> ModelOutput:
        """Predict a batch of images (B, N, 3, H, W), as described for the class.

        With `past` the batch holds clips, time-major; a network without memory ignores it.
        """

    def calibrated(self, classes: Sequence[Calibration], objects: Calibration | None) -> Self | None:
        """Return a copy with calibrated probabilities of road, vehicle, lane and objects; None if it cannot be."""
        return None
