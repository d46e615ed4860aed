"""Lift-Splat-Shoot: the network that others are compared with; occupancy only.

Philion and Fidler, "Lift, Splat, Shoot: Encoding Images from Arbitrary Camera Rigs by Implicitly Unprojecting to 3D",
ECCV 2020. Written from the paper: its layers and their widths are the paper's. Kept right where its public code is
not: features look where the encoder's padding makes them look, and points outside the grid stay outside. Cells are
summed by plan, which takes a few hundredths of the time off the original's forward pass.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import NamedTuple

from torch import Tensor, nn

from appocc.bevmap import CLASSES
from appocc.camera import CameraRig
from appocc.errors import ShapeError
from appocc.models.base import DEPTH_BINS, BEVModel, Output, Plan, ViewOutput
from appocc.models.efficientnet import EfficientNetB0
from appocc.models.model_spec import Setting
from appocc.models.resnet import BEVTrunk, conv_norm_relu, joined_at
from appocc.models.view_transform.splatting import SplatPlan, by_camera, pictures_of_rigs, plan_splat, pool

STRIDE = 16
CONTEXT_CHANNELS = 64
_NECK_CHANNELS = 512


class Lifted(NamedTuple):
    """What is said of the features of V pictures.

    Attributes:
        context: (V, h, w, C) what is there.
        depth: (V, DEPTH_BINS, h, w) logits of how far.
        kind: (V, K, h, w) logits of `ViewClass`, None if not asked for.
    """

    context: Tensor
    depth: Tensor
    kind: Tensor | None


class Lift(nn.Module):
    """Features of pictures -> context and depth, by one 1x1 convolution (paper, section III)."""

    def __init__(self, channels_in: int, channels_out: int = CONTEXT_CHANNELS, kinds: int = 0) -> None:
        """Make it with fresh weights; `kinds` is the number of classes of the pictures' own auxiliary answer."""
        super().__init__()
        self.sizes = [DEPTH_BINS, channels_out]
        self.conv = nn.Conv2d(channels_in, sum(self.sizes), 1)
        # Apart, so that the weights that are kept are those of a network without it.
        self.kind = nn.Conv2d(channels_in, kinds, 1) if kinds else None

    def forward(self, features: Tensor) -> Lifted:
        """Features (V, channels_in, h, w)."""
        depth, context = self.conv(features).split(self.sizes, dim=1)
        return Lifted(context.permute(0, 2, 3, 1), depth, None if self.kind is None else self.kind(features))


class SplatModel(BEVModel):
    """What networks that lift and splat at stride 16 share: the plan, and the way from pictures to the grid.

    Attributes:
        setting: cameras, grid, size of the pictures.
        lift: what is made of features; a network makes features by `look`.
    """

    lift: Lift

    def __init__(self, setting: Setting) -> None:
        """For the pictures and the grid of a setting."""
        super().__init__()
        self.setting = setting

    def plan(self, rigs: Sequence[CameraRig]) -> SplatPlan:
        """Where depth sends features, every point to the cell it falls into.

        Raises:
            ShapeError: if a camera's picture has not the setting's size.
        """
        h, w = -(-self.setting.height_px // STRIDE), -(-self.setting.width_px // STRIDE)
        return plan_splat(rigs, self.setting.grid, h, w, STRIDE)

    @abstractmethod
    def look(self, pictures: Tensor) -> Tensor:
        """Features (V, C, h, w) at stride 16 of pictures (V, 3, H, W)."""

    def splatted(self, images: Tensor, plan: Plan) -> tuple[Tensor, ViewOutput | None]:
        """The grid (B, CONTEXT_CHANNELS, X, Y) of pictures (B, N, 3, H, W), and in training what is said of these.

        Raises:
            ShapeError: if the plan is another network's, or for other pictures.
        """
        if not isinstance(plan, SplatPlan):
            raise ShapeError(f"plan: expected one of this network, got {type(plan).__name__}")
        # Pictures that no camera took would spoil the batch norms' statistics.
        lifted: Lifted = self.lift(self.look(pictures_of_rigs(images, plan.cameras)))
        grid = pool(lifted.context, lifted.depth.float().softmax(dim=1), plan)
        if not self.training:
            return grid, None
        count = images.shape[1]
        kind = None if lifted.kind is None else by_camera(lifted.kind, plan.cameras, count)
        return grid, ViewOutput(by_camera(lifted.depth, plan.cameras, count), kind)


class LiftSplatShoot(SplatModel):
    """EfficientNet-B0 to 1/32, a neck of 432 -> 512 channels at 1/16, splat, one ResNet-18 trunk."""

    def __init__(self, setting: Setting) -> None:
        """Make it with fresh weights."""
        super().__init__(setting)
        self.encoder = EfficientNetB0(32)
        joined = self.encoder.channels[16] + self.encoder.channels[32]
        self.neck = nn.Sequential(
            conv_norm_relu(joined, _NECK_CHANNELS, 3), conv_norm_relu(_NECK_CHANNELS, _NECK_CHANNELS, 3)
        )
        self.lift = Lift(_NECK_CHANNELS)
        self.trunk = BEVTrunk(CONTEXT_CHANNELS, len(CLASSES))

    def look(self, pictures: Tensor) -> Tensor:
        """Features (V, 512, h, w) at stride 16 of pictures (V, 3, H, W)."""
        features = self.encoder(pictures)
        joined: Tensor = self.neck(joined_at(features[16], features[32]))
        return joined

    def forward(self, images: Tensor, plan: Plan) -> Output:
        """Answer a batch: occupancy, no appearance."""
        grid, views = self.splatted(images, plan)
        return Output(self.trunk(grid), None, views)
