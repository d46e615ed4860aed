"""The first three stages of ResNet-18 with two upsampling layers: the grid trunk of Lift-Splat-Shoot.

He et al., "Deep Residual Learning for Image Recognition", CVPR 2016; Philion and Fidler, "Lift, Splat, Shoot",
ECCV 2020, section 4.1.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional


class BasicBlock(nn.Module):
    """Residual block of two 3x3 convolutions."""

    def __init__(self, channels_in: int, channels_out: int, stride: int = 1) -> None:
        """Build the block; the last batch norm starts at zero, so that a new block is the identity."""
        super().__init__()
        self.first = conv_norm_relu(channels_in, channels_out, 3, stride)
        self.second = nn.Sequential(
            nn.Conv2d(channels_out, channels_out, 3, padding=1, bias=False), nn.BatchNorm2d(channels_out)
        )
        self.short_cut: nn.Module = nn.Identity()
        if stride != 1 or channels_in != channels_out:
            self.short_cut = nn.Sequential(
                nn.Conv2d(channels_in, channels_out, 1, stride, bias=False), nn.BatchNorm2d(channels_out)
            )
        for norm in self.second.children():
            if isinstance(norm, nn.BatchNorm2d):
                nn.init.zeros_(norm.weight)

    def forward(self, x: Tensor) -> Tensor:
        """Return (B, channels_out, X / stride, Y / stride), rounded up, of features (B, channels_in, X, Y)."""
        return functional.relu(self.second(self.first(x)) + self.short_cut(x))


class BEVTrunk(nn.Module):
    """Convolutional trunk from grid features to grid outputs of the same size.

    The stem halves the grid (no pooling after it); the stages have 64, 128 and 256 channels at strides 2, 4 and 8.
    The features at stride 8 are upsampled to stride 2, concatenated with those of the first stage, and upsampled to
    the whole grid.
    """

    def __init__(self, channels_in: int, channels_out: int) -> None:
        """Build the trunk with random weights."""
        super().__init__()
        self.stem = conv_norm_relu(channels_in, 64, 7, 2)
        self.stage1 = nn.Sequential(BasicBlock(64, 64), BasicBlock(64, 64))
        self.stage2 = nn.Sequential(BasicBlock(64, 128, 2), BasicBlock(128, 128))
        self.stage3 = nn.Sequential(BasicBlock(128, 256, 2), BasicBlock(256, 256))
        self.join = nn.Sequential(conv_norm_relu(64 + 256, 256, 3), conv_norm_relu(256, 256, 3))
        self.head = nn.Sequential(conv_norm_relu(256, 128, 3), nn.Conv2d(128, channels_out, 1))

    def forward(self, grid: Tensor) -> Tensor:
        """Return (B, channels_out, X, Y) of features (B, channels_in, X, Y)."""
        half: Tensor = self.stage1(self.stem(grid))  # B 64 X/2 Y/2
        deep: Tensor = self.stage3(self.stage2(half))  # B 256 X/8 Y/8
        joined: Tensor = self.join(concat_upscaled(half, deep))  # B 256 X/2 Y/2
        answer: Tensor = self.head(resize_like(joined, grid))
        return answer


def concat_upscaled(fine: Tensor, coarse: Tensor) -> Tensor:
    """Upsample coarse features to the size of the fine ones and concatenate: (B, C1 + C2, H, W)."""
    return torch.cat([fine, resize_like(coarse, fine)], dim=1)


def resize_like(x: Tensor, like: Tensor) -> Tensor:
    """Resize to the height and width of another tensor, bilinear with aligned corners.

    Feature i at stride s is centred on pixel i * s, so the first features of both tensors are at the same position.
    """
    return functional.interpolate(x, size=like.shape[-2:], mode="bilinear", align_corners=True)


def conv_norm_relu(channels_in: int, channels_out: int, kernel: int, stride: int = 1) -> nn.Sequential:
    """Return convolution, batch norm and ReLU; padding keeps the size, divided by the stride and rounded up."""
    conv = nn.Conv2d(channels_in, channels_out, kernel, stride, padding=(kernel - 1) // 2, bias=False)
    nn.init.kaiming_normal_(conv.weight, mode="fan_out", nonlinearity="relu")
    return nn.Sequential(conv, nn.BatchNorm2d(channels_out), nn.ReLU(inplace=True))
