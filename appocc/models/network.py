"""The project's own network: features pulled into the grid, one lean trunk over it for occupancy and appearance."""

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
from appocc.models.base import BEVModel, Output, Plan, ViewOutput
from appocc.models.efficientnet import EfficientNetB0
from appocc.models.heads import GridHeads, ViewHeads
from appocc.models.model_spec import Setting
from appocc.models.resnet import BasicBlock, conv_norm_relu
from appocc.models.view_transform.sampling import HEIGHTS_M, PullPlan, plan_pull, pull
from appocc.models.view_transform.splatting import by_camera, cells_seen, pictures_of_rigs

# Strides in the pictures: what stands up is read from the coarse features, paint and edges from the fine.
COARSE, FINE, DEEP = 8, 4, 16
_COARSE_CHANNELS, _FINE_CHANNELS = 32, 16
# Colours, and 1 where there is one.
_PAINT_CHANNELS = 4
_TRUNK_CHANNELS, _LAST_CHANNELS, _CELL_CHANNELS = 64, 48, 24
_PLACE_CHANNELS = 4


@dataclass(frozen=True, eq=False)
class NetworkPlan:
    """Where cells read, at both strides.

    Attributes:
        coarse: at stride 8, for cells of twice the size.
        fine: at stride 4, for the cells themselves; both at several heights.
        rigs: of each sample.
        grid: that is answered.
    """

    coarse: PullPlan
    fine: PullPlan
    rigs: tuple[CameraRig, ...]
    grid: BEVGrid

    @cached_property
    def seen(self) -> Tensor:
        """(B, X, Y) bool, cells that a camera of the rig can see; worked out when asked for, training never does."""
        seen = np.stack([cells_seen(rig, self.grid) for rig in self.rigs])
        return torch.from_numpy(seen).to(self.coarse.count.device)

    def to(self, device: torch.device) -> NetworkPlan:
        """The same on a device."""
        return replace(self, coarse=self.coarse.to(device), fine=self.fine.to(device))

    def for_export(self) -> NetworkPlan:
        """The plan with which a network uses only operations that exporters translate rightly; slower."""
        return replace(self, coarse=self.coarse.for_export(), fine=self.fine.for_export())


class AppoccNet(BEVModel):
    """EfficientNet-B0 to stride 16, merged to stride 8; planned pull; ResNet trunk at half resolution; light heads.

    Any number of cameras; images of cameras that a rig does not have are never looked at.
    """

    place: Tensor

    def __init__(self, setting: Setting, appearance: bool = True, kinds: int = 0) -> None:
        """Make it with fresh weights; `kinds` > 0 adds the view heads for training, with so many classes."""
        super().__init__()
        self.setting = setting
        self.encoder = EfficientNetB0(DEEP)
        self.merge = _Merge(self.encoder)
        self.trunk = _LeanTrunk(len(HEIGHTS_M))
        self.heads = GridHeads(_CELL_CHANNELS, appearance, len(HEIGHTS_M))
        self.views = ViewHeads(_Merge.width, kinds) if kinds else None
        # Not a weight: it follows from the setting.
        self.register_buffer("place", place_of_cells(setting.grid.halved()), persistent=False)

    def plan(self, rigs: Sequence[CameraRig]) -> NetworkPlan:
        """The plan of a batch; see `BEVModel`.

        Raises:
            ShapeError: if a camera's picture has not the size of the setting.
        """
        high, wide = self.setting.height_px, self.setting.width_px
        size = {stride: (-(-high // stride), -(-wide // stride)) for stride in (COARSE, FINE)}
        grid = self.setting.grid
        coarse = plan_pull(rigs, grid.halved(), HEIGHTS_M, *size[COARSE], COARSE)
        return NetworkPlan(coarse, plan_pull(rigs, grid, HEIGHTS_M, *size[FINE], FINE), tuple(rigs), grid)

    def forward(self, images: Tensor, plan: Plan) -> Output:
        """Answer a batch; images (B, N, 3, H, W) sRGB, 0..1.

        Raises:
            ShapeError: if the plan is another network's, or there are fewer images than it has cameras.
        """
        if not isinstance(plan, NetworkPlan):
            raise ShapeError(f"plan: expected one of this network, got {type(plan).__name__}")
        cameras = plan.coarse.cameras
        pictures = pictures_of_rigs(images, cameras).contiguous(memory_format=torch.channels_last)
        merged, coarse, fine = self.merge(self.encoder(pictures))
        standing = pull(coarse.permute(0, 2, 3, 1), plan.coarse)  # B 3*32 X/2 Y/2
        shown = torch.cat([each.permute(0, 2, 3, 1) for each in (fine, paint_of(pictures))], dim=-1)
        near = pull(shown, plan.fine)  # B 3*20 X Y
        count = plan.coarse.count
        place = torch.cat([self.place.expand(len(count), -1, -1, -1), count], dim=1)  # B 4 X/2 Y/2
        cells = self.trunk(standing, place, near)  # B 24 X Y
        batch, channels, x, y = near.shape
        offered = near.reshape(batch, len(HEIGHTS_M), channels // len(HEIGHTS_M), x, y)[:, :, _FINE_CHANNELS:]
        occupancy, appearance = self.heads(cells, offered)
        if self.views is None or not self.training:
            return Output(occupancy, appearance, None)
        views = (by_camera(each, cameras, images.shape[1]) for each in self.views(merged))
        return Output(occupancy, appearance, ViewOutput(*views))


def place_of_cells(grid: BEVGrid) -> Tensor:
    """(1, 3, X, Y) where the cells of a grid lie: x, y and range from the ego, in units of 40 m."""
    centres = torch.from_numpy(grid.centres()).float() / 40.0  # X Y 2
    return torch.cat([centres, centres.norm(dim=-1, keepdim=True)], dim=-1).permute(2, 0, 1)[None]


def paint_of(pictures: Tensor) -> Tensor:
    """(V, 4, ceil(H / 4), ceil(W / 4)) colours of pictures (V, 3, H, W), each the mean around pixel i * 4, and 1."""
    colours = functional.avg_pool2d(pictures, FINE + 1, FINE, padding=FINE // 2, count_include_pad=False)
    return torch.cat([colours, torch.ones_like(colours[:, :1])], dim=1)


def doubled(x: Tensor, like: Tensor) -> Tensor:
    """Twice the size, cut to that of `like`; bilinear, and true to place.

    A convolution of stride 2 with symmetric padding puts output j at input 2 j. The usual interpolation would put it
    at 2 j + 1/2: from the coarsest level of the grid, 0.8 m beside its place.
    """
    high, wide = x.shape[-2:]
    x = functional.interpolate(
        functional.pad(x, (0, 1, 0, 1), mode="replicate"),
        (2 * high + 1, 2 * wide + 1),
        mode="bilinear",
        align_corners=True,
    )
    return x[..., : like.shape[-2], : like.shape[-1]]


class _Merge(nn.Module):
    """Features at strides 16, 8 and 4 -> what is pulled."""

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
        """Merged (V, 96, h/8, w/8); of it what is pulled (V, 32, h/8, w/8); and (V, 16, h/4, w/4)."""
        side = self.side(features[COARSE])
        merged = self.mixed(side + doubled(self.deep(features[DEEP]), side))
        return merged, self.coarse(merged), self.fine(features[FINE])


class _LeanTrunk(nn.Module):
    """A grid of features -> a grid of features, with nearly all of the work at half its resolution or less."""

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
        # Each cell of half the resolution says what its four cells hold: sharper than interpolation, and cheap.
        self.four = nn.Conv2d(_LAST_CHANNELS, 4 * _CELL_CHANNELS, 1)
        self.near = nn.Conv2d(heights * (_FINE_CHANNELS + _PAINT_CHANNELS), _CELL_CHANNELS, 1)
        with torch.no_grad():  # the four begin as one, else a chequered pattern has to be unlearnt
            self.four.weight.copy_(self.four.weight[::4].repeat_interleave(4, dim=0))
            self.four.bias.copy_(self.four.bias[::4].repeat_interleave(4, dim=0))  # type: ignore[union-attr, index]

    def forward(self, standing: Tensor, place: Tensor, near: Tensor) -> Tensor:
        """Mix what was pulled.

        Args:
            standing: (B, heights * 32, X/2, Y/2) of cells of twice the size.
            place: (B, 4, X/2, Y/2) where those are, and how many cameras see them.
            near: (B, heights * 20, X, Y) of the cells themselves.

        Returns:
            (B, 24, X, Y).
        """
        half = self.stage1(self.stem(standing) + self.place(place))  # B 64 X/2 Y/2
        quarter = self.stage2(half)  # B 128 X/4 Y/4
        side = self.side2(quarter)
        joined = self.down2(side + doubled(self.side3(self.stage3(quarter)), side))  # B 64 X/4 Y/4
        last = self.last(half + doubled(joined, half))  # B 48 X/2 Y/2
        four = functional.pixel_shuffle(self.four(last), 2)[..., : near.shape[-2], : near.shape[-1]]
        return functional.relu(four + self.near(near))
