"""The appocc network: image features sampled into the grid, one light trunk, and heads for cells and objects."""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from appocc.camera import CameraRig
from appocc.errors import ShapeError
from appocc.grid import BEVGrid
from appocc.models.base import DEPTH_BINS, BEVModel, ImageOutput, ModelOutput, ViewTransformPlan
from appocc.models.efficientnet import EfficientNetB0
from appocc.models.heads import GridHeads, ImageHeads
from appocc.models.lean_trunk import COARSE_CHANNELS, FINE_CHANNELS, LeanTrunk, upsample_twice
from appocc.models.memory import Past
from appocc.models.model_spec import ModelSpec, Parts
from appocc.models.object_head import ObjectHead
from appocc.models.resnet import conv_norm_relu
from appocc.models.view_transform.planning import HEIGHTS_M, plan_sampling
from appocc.models.view_transform.sampling import SamplingPlan, sample_depth, sample_features
from appocc.models.view_transform.splatting import pack_cameras, unpack_cameras, visible_cells
from appocc.probability_calibration import Calibration

# Image strides: objects are sampled from the coarse features, colours and edges from the fine ones.
COARSE, FINE, DEEP = 8, 4, 16


@dataclass(frozen=True, eq=False)
class AppoccPlan:
    """Sampling plans at both strides, each at several heights.

    Attributes:
        coarse: features at stride 8, for cells of twice the size.
        fine: features at stride 4, for the cells of the grid.
        depth: depths at stride 8, for cells of twice the size; None for a network without depth.
        rigs: rig of each sample.
        grid: predicted grid.
    """

    coarse: SamplingPlan
    fine: SamplingPlan
    depth: SamplingPlan | None
    rigs: tuple[CameraRig, ...]
    grid: BEVGrid

    @cached_property
    def seen(self) -> Tensor:
        """(B, X, Y) bool, cells that a camera of the rig can see; computed on demand, training does not need it."""
        seen = np.stack([visible_cells(rig, self.grid) for rig in self.rigs])
        return torch.from_numpy(seen).to(self.coarse.count.device)

    def to(self, device: torch.device) -> AppoccPlan:
        """Return the plan on a device."""
        depth = None if self.depth is None else self.depth.to(device)
        return replace(self, coarse=self.coarse.to(device), fine=self.fine.to(device), depth=depth)

    def for_export(self) -> AppoccPlan:
        """Return the plan for export: the network then uses only operations that exporters support; slower."""
        depth = None if self.depth is None else self.depth.for_export()
        return replace(self, coarse=self.coarse.for_export(), fine=self.fine.for_export(), depth=depth)


class AppoccNet(BEVModel):
    """EfficientNet-B0 to stride 16, merged to stride 8; BEV sampling; ResNet trunk at half resolution; light heads.

    Any number of cameras; images beyond the cameras of a rig are ignored.
    """

    place: Tensor

    def __init__(
        self, spec: ModelSpec, appearance: bool = True, num_classes: int = 0, parts: Parts | None = None
    ) -> None:
        """Build the network with random weights; `num_classes` > 0 adds the image heads for training."""
        super().__init__()
        self.spec, self.parts = spec, parts or Parts()
        self.encoder = EfficientNetB0(DEEP)
        self.merge = _FeatureMerge(self.encoder)
        self.trunk = LeanTrunk(len(HEIGHTS_M), self.parts, spec.grid.halved())
        self.heads = GridHeads(LeanTrunk.cell_channels, appearance, len(HEIGHTS_M))
        self.depth = nn.Conv2d(_FeatureMerge.width, DEPTH_BINS, 1) if self.parts.depth else None
        self.objects = ObjectHead(LeanTrunk.last_channels) if self.parts.objects else None
        self.views = None
        if num_classes:
            self.views = ImageHeads(_FeatureMerge.width, num_classes, depth=not self.parts.depth)
        # Not a weight: it follows from the model spec.
        self.register_buffer("place", cell_coordinates(spec.grid.halved()), persistent=False)

    def plan(self, rigs: Sequence[CameraRig]) -> AppoccPlan:
        """Return the plan of a batch; see `BEVModel`.

        Raises:
            ShapeError: if the image size of a camera differs from the model spec.
        """
        high, wide = self.spec.height_px, self.spec.width_px
        size = {stride: (-(-high // stride), -(-wide // stride)) for stride in (COARSE, FINE)}
        grid, device = self.spec.grid, self.place.device
        coarse = plan_sampling(rigs, grid.halved(), HEIGHTS_M, *size[COARSE], COARSE, device=device)
        fine = plan_sampling(rigs, grid, HEIGHTS_M, *size[FINE], FINE, device=device)
        depth = None
        if self.parts.depth:
            depth = plan_sampling(rigs, grid.halved(), HEIGHTS_M, *size[COARSE], COARSE, depths=True, device=device)
        return AppoccPlan(coarse, fine, depth, tuple(rigs), grid)

    def forward(self, images: Tensor, plan: ViewTransformPlan, past: Past | None = None) -> ModelOutput:
        """Predict a batch of images (B, N, 3, H, W) sRGB, 0..1; with `past`, of clips.

        Raises:
            ShapeError: if the plan belongs to another network or has more cameras than there are images.
        """
        if not isinstance(plan, AppoccPlan):
            raise ShapeError(f"plan: expected one of this network, got {type(plan).__name__}")
        cameras = plan.coarse.cameras
        packed = pack_cameras(images, cameras).contiguous(memory_format=torch.channels_last)
        own = slice(len(packed))
        if packed.is_cuda and self.training:
            packed = repeat_to(packed, images.shape[0] * images.shape[1])
        merged, coarse, fine = self.merge(self.encoder(packed))
        standing = sample_features(coarse[own].permute(0, 2, 3, 1), plan.coarse)  # B 3*32 X/2 Y/2
        shown = torch.cat([each[own].permute(0, 2, 3, 1) for each in (fine, mean_colours(packed))], dim=-1)
        near = sample_features(shown, plan.fine)  # B 3*20 X Y
        depth = None if self.depth is None else self.depth(merged)[own].float()  # V D h/8 w/8
        surface = None if depth is None or plan.depth is None else sample_depth(depth, plan.depth)  # B 3*2 X/2 Y/2
        count = plan.coarse.count
        place = torch.cat([self.place.expand(len(count), -1, -1, -1), count], dim=1)  # B 4 X/2 Y/2
        trunk = self.trunk(standing, surface, place, near, past)
        occupancy, appearance = self.heads(trunk.cells, _offered(near), _support(surface, near))
        objects = None if self.objects is None else self.objects(trunk.last)
        views = None
        if self.views is not None and self.training:
            own_depth, kind = self.views(merged)
            found = (
                unpack_cameras(each[own], cameras, images.shape[1])
                for each in (own_depth if depth is None else depth, kind)
            )
            views = ImageOutput(*found)
        return ModelOutput(occupancy, appearance, views, objects, trunk.memory)

    def calibrated(self, classes: Sequence[Calibration], objects: Calibration | None) -> AppoccNet:
        """Return a copy with temperature and bias in the weights of the last layers."""
        copy = deepcopy(self)
        for number, calibration in enumerate(classes):
            _calibrate(copy.heads.answer, slice(number, number + 1), calibration)
        if copy.objects is not None and objects is not None:
            _calibrate(copy.objects.centre, slice(None), objects)
        return copy


@torch.no_grad()
def _calibrate(layer: nn.Conv2d, outputs: slice, calibration: Calibration) -> None:
    """Divide output logits of a layer by the temperature and add the bias, in its weights."""
    assert layer.bias is not None
    layer.weight[outputs] /= calibration.temperature
    layer.bias[outputs] = layer.bias[outputs] / calibration.temperature + calibration.bias


def _offered(near: Tensor) -> Tensor:
    """Return the colours and validities (B, heights, 4, X, Y) of fine features (B, heights * 20, X, Y)."""
    batch, channels, x, y = near.shape
    return near.reshape(batch, len(HEIGHTS_M), channels // len(HEIGHTS_M), x, y)[:, :, FINE_CHANNELS:]


def _support(surface: Tensor | None, near: Tensor) -> Tensor | None:
    """Return the probability of a surface at each point (B, heights, X, Y), from cells of twice the size."""
    if surface is None:
        return None
    at = surface[:, ::2].repeat_interleave(2, dim=2).repeat_interleave(2, dim=3)
    return at[..., : near.shape[-2], : near.shape[-1]]


def repeat_to(images: Tensor, count: int) -> Tensor:
    """Repeat the first of some images (V, ...) until there are `count`, so that batches have the same shape.

    On a GPU, the first batch of each shape takes seconds, because the convolutions of this shape are prepared.
    """
    return images[torch.arange(count, device=images.device) % len(images)] if len(images) < count else images


def cell_coordinates(grid: BEVGrid) -> Tensor:
    """Return (1, 3, X, Y) coordinates of cell centres: x, y and range from the ego, in units of 40 m."""
    centres = torch.from_numpy(grid.centres()).float() / 40.0  # X Y 2
    return torch.cat([centres, centres.norm(dim=-1, keepdim=True)], dim=-1).permute(2, 0, 1)[None]


def mean_colours(packed: Tensor) -> Tensor:
    """Return (V, 4, ceil(H / 4), ceil(W / 4)): mean colours around pixels i * 4 of images (V, 3, H, W), and ones."""
    colours = functional.avg_pool2d(packed, FINE + 1, FINE, padding=FINE // 2, count_include_pad=False)
    return torch.cat([colours, torch.ones_like(colours[:, :1])], dim=1)


class _FeatureMerge(nn.Module):
    """Merge features at strides 16, 8 and 4 into those that are sampled."""

    width = 96

    def __init__(self, encoder: EfficientNetB0) -> None:
        super().__init__()
        channels = encoder.channels
        self.deep = conv_norm_relu(channels[DEEP], self.width, 1)
        self.side = conv_norm_relu(channels[COARSE], self.width, 1)
        self.mixed = conv_norm_relu(self.width, self.width, 3)
        self.coarse = nn.Conv2d(self.width, COARSE_CHANNELS, 1)
        self.fine = conv_norm_relu(channels[FINE], FINE_CHANNELS, 1)

    def forward(self, features: dict[int, Tensor]) -> tuple[Tensor, Tensor, Tensor]:
        """Return merged features (V, 96, h/8, w/8), and those to sample: (V, 32, h/8, w/8) and (V, 16, h/4, w/4)."""
        side = self.side(features[COARSE])
        merged = self.mixed(side + upsample_twice(self.deep(features[DEEP]), side))
        return merged, self.coarse(merged), self.fine(features[FINE])
