"""The appocc network: image features sampled into the grid, and one light trunk for occupancy and appearance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from appocc.camera import CameraRig
from appocc.errors import ShapeError
from appocc.grid import BEVGrid
from appocc.models.base import BEVModel, ImageOutput, ModelOutput, ViewTransformPlan
from appocc.models.efficientnet import EfficientNetB0
from appocc.models.heads import GridHeads, ImageHeads
from appocc.models.model_spec import ModelSpec
from appocc.models.resnet import BasicBlock, conv_norm_relu
from appocc.models.view_transform.sampling import HEIGHTS_M, SamplingPlan, plan_sampling, sample_features
from appocc.models.view_transform.splatting import pack_cameras, unpack_cameras, visible_cells

# Image strides: objects are sampled from the coarse features, colours and edges from the fine ones.
COARSE, FINE, DEEP = 8, 4, 16
_COARSE_CHANNELS, _FINE_CHANNELS = 32, 16
# Colour and a validity of 1.
_PAINT_CHANNELS = 4
_TRUNK_CHANNELS, _LAST_CHANNELS, _CELL_CHANNELS = 64, 48, 24
_PLACE_CHANNELS = 4


@dataclass(frozen=True, eq=False)
class AppoccPlan:
    """Sampling plans at both strides, each at several heights.

    Attributes:
        coarse: features at stride 8, for cells of twice the size.
        fine: features at stride 4, for the cells of the grid.
        rigs: rig of each sample.
        grid: predicted grid.
    """

    coarse: SamplingPlan
    fine: SamplingPlan
    rigs: tuple[CameraRig, ...]
    grid: BEVGrid

    @cached_property
    def seen(self) -> Tensor:
        """(B, X, Y) bool, cells that a camera of the rig can see; computed on demand, training does not need it."""
        seen = np.stack([visible_cells(rig, self.grid) for rig in self.rigs])
        return torch.from_numpy(seen).to(self.coarse.count.device)

    def to(self, device: torch.device) -> AppoccPlan:
        """Return the plan on a device."""
        return replace(self, coarse=self.coarse.to(device), fine=self.fine.to(device))

    def for_export(self) -> AppoccPlan:
        """Return the plan for export: the network then uses only operations that exporters support; slower."""
        return replace(self, coarse=self.coarse.for_export(), fine=self.fine.for_export())


class AppoccNet(BEVModel):
    """EfficientNet-B0 to stride 16, merged to stride 8; BEV sampling; ResNet trunk at half resolution; light heads.

    Any number of cameras; images beyond the cameras of a rig are ignored.
    """

    place: Tensor

    def __init__(self, spec: ModelSpec, appearance: bool = True, num_classes: int = 0) -> None:
        """Build the network with random weights; `num_classes` > 0 adds the image heads for training."""
        super().__init__()
        self.spec = spec
        self.encoder = EfficientNetB0(DEEP)
        self.merge = _FeatureMerge(self.encoder)
        self.trunk = _LeanTrunk(len(HEIGHTS_M))
        self.heads = GridHeads(_CELL_CHANNELS, appearance, len(HEIGHTS_M))
        self.views = ImageHeads(_FeatureMerge.width, num_classes) if num_classes else None
        # Not a weight: it follows from the model spec.
        self.register_buffer("place", cell_coordinates(spec.grid.halved()), persistent=False)

    def plan(self, rigs: Sequence[CameraRig]) -> AppoccPlan:
        """Return the plan of a batch; see `BEVModel`.

        Raises:
            ShapeError: if the image size of a camera differs from the model spec.
        """
        high, wide = self.spec.height_px, self.spec.width_px
        size = {stride: (-(-high // stride), -(-wide // stride)) for stride in (COARSE, FINE)}
        grid = self.spec.grid
        coarse = plan_sampling(rigs, grid.halved(), HEIGHTS_M, *size[COARSE], COARSE)
        return AppoccPlan(coarse, plan_sampling(rigs, grid, HEIGHTS_M, *size[FINE], FINE), tuple(rigs), grid)

    def forward(self, images: Tensor, plan: ViewTransformPlan) -> ModelOutput:
        """Predict a batch of images (B, N, 3, H, W) sRGB, 0..1.

        Raises:
            ShapeError: if the plan belongs to another network or has more cameras than there are images.
        """
        if not isinstance(plan, AppoccPlan):
            raise ShapeError(f"plan: expected one of this network, got {type(plan).__name__}")
        cameras = plan.coarse.cameras
        packed = pack_cameras(images, cameras).contiguous(memory_format=torch.channels_last)
        merged, coarse, fine = self.merge(self.encoder(packed))
        standing = sample_features(coarse.permute(0, 2, 3, 1), plan.coarse)  # B 3*32 X/2 Y/2
        shown = torch.cat([each.permute(0, 2, 3, 1) for each in (fine, mean_colours(packed))], dim=-1)
        near = sample_features(shown, plan.fine)  # B 3*20 X Y
        count = plan.coarse.count
        place = torch.cat([self.place.expand(len(count), -1, -1, -1), count], dim=1)  # B 4 X/2 Y/2
        cells = self.trunk(standing, place, near)  # B 24 X Y
        batch, channels, x, y = near.shape
        offered = near.reshape(batch, len(HEIGHTS_M), channels // len(HEIGHTS_M), x, y)[:, :, _FINE_CHANNELS:]
        occupancy, appearance = self.heads(cells, offered)
        if self.views is None or not self.training:
            return ModelOutput(occupancy, appearance, None)
        views = (unpack_cameras(each, cameras, images.shape[1]) for each in self.views(merged))
        return ModelOutput(occupancy, appearance, ImageOutput(*views))


def cell_coordinates(grid: BEVGrid) -> Tensor:
    """Return (1, 3, X, Y) coordinates of cell centres: x, y and range from the ego, in units of 40 m."""
    centres = torch.from_numpy(grid.centres()).float() / 40.0  # X Y 2
    return torch.cat([centres, centres.norm(dim=-1, keepdim=True)], dim=-1).permute(2, 0, 1)[None]


def mean_colours(packed: Tensor) -> Tensor:
    """Return (V, 4, ceil(H / 4), ceil(W / 4)): mean colours around pixels i * 4 of images (V, 3, H, W), and ones."""
    colours = functional.avg_pool2d(packed, FINE + 1, FINE, padding=FINE // 2, count_include_pad=False)
    return torch.cat([colours, torch.ones_like(colours[:, :1])], dim=1)


def upsample_twice(x: Tensor, like: Tensor) -> Tensor:
    """Upsample to twice the size, cropped to that of `like`; bilinear, without a shift.

    A convolution of stride 2 with symmetric padding centres output j on input 2 j. The usual interpolation centres it
    on 2 j + 1/2: a shift of 0.8 m at the coarsest level of the grid.
    """
    high, wide = x.shape[-2:]
    x = functional.interpolate(
        functional.pad(x, (0, 1, 0, 1), mode="replicate"),
        (2 * high + 1, 2 * wide + 1),
        mode="bilinear",
        align_corners=True,
    )
    return x[..., : like.shape[-2], : like.shape[-1]]


class _FeatureMerge(nn.Module):
    """Merge features at strides 16, 8 and 4 into those that are sampled."""

    width = 96

    def __init__(self, encoder: EfficientNetB0) -> None:
        super().__init__()
        channels = encoder.channels
        self.deep = conv_norm_relu(channels[DEEP], self.width, 1)
        self.side = conv_norm_relu(channels[COARSE], self.width, 1)
        self.mixed = conv_norm_relu(self.width, self.width, 3)
        self.coarse = nn.Conv2d(self.width, _COARSE_CHANNELS, 1)
        self.fine = conv_norm_relu(channels[FINE], _FINE_CHANNELS, 1)

    def forward(self, features: dict[int, Tensor]) -> tuple[Tensor, Tensor, Tensor]:
        """Return merged features (V, 96, h/8, w/8), and those to sample: (V, 32, h/8, w/8) and (V, 16, h/4, w/4)."""
        side = self.side(features[COARSE])
        merged = self.mixed(side + upsample_twice(self.deep(features[DEEP]), side))
        return merged, self.coarse(merged), self.fine(features[FINE])


class _LeanTrunk(nn.Module):
    """Trunk over the grid that does nearly all computation at half the resolution or less."""

    def __init__(self, heights: int) -> None:
        super().__init__()
        wide = _TRUNK_CHANNELS
        self.stem = conv_norm_relu(heights * _COARSE_CHANNELS, wide, 1)
        self.place = nn.Conv2d(_PLACE_CHANNELS, wide, 1)
        self.stage1 = BasicBlock(wide, wide)
        self.stage2 = BasicBlock(wide, 2 * wide, 2)
        self.stage3 = BasicBlock(2 * wide, 4 * wide, 2)
        self.side2 = conv_norm_relu(2 * wide, wide, 1)
        self.side3 = conv_norm_relu(4 * wide, wide, 1)
        self.down2 = conv_norm_relu(wide, wide, 3)
        self.last = conv_norm_relu(wide, _LAST_CHANNELS, 3)
        # Each cell at half resolution predicts its four cells: sharper than interpolation, and cheap.
        self.four = nn.Conv2d(_LAST_CHANNELS, 4 * _CELL_CHANNELS, 1)
        self.near = nn.Conv2d(heights * (_FINE_CHANNELS + _PAINT_CHANNELS), _CELL_CHANNELS, 1)
        with torch.no_grad():  # equal initial weights avoid a checkerboard pattern
            self.four.weight.copy_(self.four.weight[::4].repeat_interleave(4, dim=0))
            self.four.bias.copy_(self.four.bias[::4].repeat_interleave(4, dim=0))  # type: ignore[union-attr, index]

    def forward(self, standing: Tensor, place: Tensor, near: Tensor) -> Tensor:
        """Combine the sampled features.

        Args:
            standing: (B, heights * 32, X/2, Y/2) coarse features, of cells of twice the size.
            place: (B, 4, X/2, Y/2) coordinates of these cells and the number of cameras that see them.
            near: (B, heights * 20, X, Y) fine features and colours of the cells of the grid.

        Returns:
            (B, 24, X, Y).
        """
        half = self.stage1(self.stem(standing) + self.place(place))  # B 64 X/2 Y/2
        quarter = self.stage2(half)  # B 128 X/4 Y/4
        side = self.side2(quarter)
        joined = self.down2(side + upsample_twice(self.side3(self.stage3(quarter)), side))  # B 64 X/4 Y/4
        last = self.last(half + upsample_twice(joined, half))  # B 48 X/2 Y/2
        four = functional.pixel_shuffle(self.four(last), 2)[..., : near.shape[-2], : near.shape[-1]]
        return functional.relu(four + self.near(near))
