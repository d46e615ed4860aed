"""Lift-Splat-Shoot: the baseline network; occupancy only.

Philion and Fidler, "Lift, Splat, Shoot: Encoding Images from Arbitrary Camera Rigs by Implicitly Unprojecting to 3D",
ECCV 2020. Written from the paper, with its layers and widths. Unlike the public code, feature positions follow the
padding of the encoder, and points outside the grid are dropped. Points are summed by a precomputed plan, which is
slightly faster than the original.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import NamedTuple

from torch import Tensor, nn

from appocc.bevmap import CLASSES
from appocc.camera import CameraRig
from appocc.errors import ShapeError
from appocc.models.base import DEPTH_BINS, BEVModel, ImageOutput, ModelOutput, ViewTransformPlan
from appocc.models.efficientnet import EfficientNetB0
from appocc.models.memory import Past
from appocc.models.model_spec import ModelSpec
from appocc.models.resnet import BEVTrunk, concat_upscaled, conv_norm_relu
from appocc.models.view_transform.splatting import SplattingPlan, pack_cameras, plan_splatting, splat, unpack_cameras

STRIDE = 16
CONTEXT_CHANNELS = 64
_NECK_CHANNELS = 512


class LiftOutput(NamedTuple):
    """Context and depth of the features of V images.

    Attributes:
        context: (V, h, w, C) context vectors.
        depth: (V, DEPTH_BINS, h, w) logits of the depth.
        kind: (V, K, h, w) logits of `ViewClass`; None without an auxiliary head.
    """

    context: Tensor
    depth: Tensor
    kind: Tensor | None


class Lift(nn.Module):
    """Context and depth of image features, by one 1x1 convolution (paper, section III)."""

    def __init__(self, channels_in: int, channels_out: int = CONTEXT_CHANNELS, num_classes: int = 0) -> None:
        """Build the layers with random weights; `num_classes` > 0 adds an auxiliary head for image classes."""
        super().__init__()
        self.sizes = [DEPTH_BINS, channels_out]
        self.conv = nn.Conv2d(channels_in, sum(self.sizes), 1)
        # A layer of its own, so that weights files do not depend on the auxiliary head.
        self.kind = nn.Conv2d(channels_in, num_classes, 1) if num_classes else None

    def forward(self, features: Tensor) -> LiftOutput:
        """Return context and depth of features (V, channels_in, h, w)."""
        depth, context = self.conv(features).split(self.sizes, dim=1)
        return LiftOutput(context.permute(0, 2, 3, 1), depth, None if self.kind is None else self.kind(features))


class SplatModel(BEVModel):
    """Base class of networks that lift and splat features at stride 16.

    Attributes:
        spec: cameras, grid and image size.
        lift: layers for context and depth; subclasses compute features in `encode`.
    """

    lift: Lift

    def __init__(self, spec: ModelSpec) -> None:
        """Store the model spec."""
        super().__init__()
        self.spec = spec

    def plan(self, rigs: Sequence[CameraRig]) -> SplattingPlan:
        """Return the plan that sums every frustum point into its cell.

        Raises:
            ShapeError: if the image size of a camera differs from the model spec.
        """
        h, w = -(-self.spec.height_px // STRIDE), -(-self.spec.width_px // STRIDE)
        return plan_splatting(rigs, self.spec.grid, h, w, STRIDE)

    @abstractmethod
    def encode(self, images: Tensor) -> Tensor:
        """Return features (V, C, h, w) at stride 16 of images (V, 3, H, W)."""

    def lift_and_splat(self, images: Tensor, plan: ViewTransformPlan) -> tuple[Tensor, ImageOutput | None]:
        """Return grid features (B, CONTEXT_CHANNELS, X, Y) of images (B, N, 3, H, W), and image outputs in training.

        Raises:
            ShapeError: if the plan belongs to another network or other images.
        """
        if not isinstance(plan, SplattingPlan):
            raise ShapeError(f"plan: expected one of this network, got {type(plan).__name__}")
        # Padding images would distort the statistics of the batch norms.
        lifted: LiftOutput = self.lift(self.encode(pack_cameras(images, plan.cameras)))
        grid = splat(lifted.context, lifted.depth.float().softmax(dim=1), plan)
        if not self.training:
            return grid, None
        count = images.shape[1]
        kind = None if lifted.kind is None else unpack_cameras(lifted.kind, plan.cameras, count)
        return grid, ImageOutput(unpack_cameras(lifted.depth, plan.cameras, count), kind)


class LiftSplatShoot(SplatModel):
    """EfficientNet-B0 to stride 32, neck of 432 -> 512 channels at stride 16, splatting, one ResNet-18 trunk."""

    def __init__(self, spec: ModelSpec) -> None:
        """Build the network with random weights."""
        super().__init__(spec)
        self.encoder = EfficientNetB0(32)
        joined = self.encoder.channels[16] + self.encoder.channels[32]
        self.neck = nn.Sequential(
            conv_norm_relu(joined, _NECK_CHANNELS, 3), conv_norm_relu(_NECK_CHANNELS, _NECK_CHANNELS, 3)
        )
        self.lift = Lift(_NECK_CHANNELS)
        self.trunk = BEVTrunk(CONTEXT_CHANNELS, len(CLASSES))

    def encode(self, images: Tensor) -> Tensor:
        """Return features (V, 512, h, w) at stride 16 of images (V, 3, H, W)."""
        features = self.encoder(images)
        joined: Tensor = self.neck(concat_upscaled(features[16], features[32]))
        return joined

    def forward(self, images: Tensor, plan: ViewTransformPlan, past: Past | None = None) -> ModelOutput:
        """Predict occupancy, no appearance."""
        grid, views = self.lift_and_splat(images, plan)
        return ModelOutput(self.trunk(grid), None, views)
