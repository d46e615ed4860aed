"""The first three stages of ResNet-18 with two up-sampling layers: the trunk over the grid of Lift-Splat-Shoot.

He et al., "Deep Residual Learning for Image Recognition", CVPR 2016; Philion and Fidler, "Lift, Splat, Shoot",
ECCV 2020, section 4.1.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional


class BasicBlock(nn.Module):
    """Two 3x3 convolutions beside a short cut."""

    def __init__(self, channels_in: int, channels_out: int, stride: int = 1) -> None:
        """Make it; the last batch norm starts at zero, so that a fresh block passes its input on."""
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
        """(B, channels_in, X, Y) -> (B, channels_out, X / stride, Y / stride), rounded up."""
        return functional.relu(self.second(self.first(x)) + self.short_cut(x))


class BEVTrunk(nn.Module):
    """A grid of features -> a grid of answers, at the same size.

    The stem halves the grid (no pooling after it), the stages have 64, 128 and 256 channels at 1/2, 1/4 and 1/8; what
    was seen at 1/8 is scaled up to 1/2, joined with the first stage, and scaled up to the whole grid.
    """

    def __init__(self, channels_in: int, channels_out: int) -> None:
        """Make it with fresh weights."""
        super().__init__()
        self.stem = conv_norm_relu(channels_in, 64, 7, 2)
        self.stage1 = nn.Sequential(BasicBlock(64, 64), BasicBlock(64, 64))
        self.stage2 = nn.Sequential(BasicBlock(64, 128, 2), BasicBlock(128, 128))
        self.stage3 = nn.Sequential(BasicBlock(128, 256, 2), BasicBlock(256, 256))
        self.join = nn.Sequential(conv_norm_relu(64 + 256, 256, 3), conv_norm_relu(256, 256, 3))
        self.head = nn.Sequential(conv_norm_relu(256, 128, 3), nn.Conv2d(128, channels_out, 1))

    def forward(self, grid: Tensor) -> Tensor:
        """(B, channels_in, X, Y) -> (B, channels_out, X, Y)."""
        half: Tensor = self.stage1(self.stem(grid))  # B 64 X/2 Y/2
        deep: Tensor = self.stage3(self.stage2(half))  # B 256 X/8 Y/8
        joined: Tensor = self.join(joined_at(half, deep))  # B 256 X/2 Y/2
        answer: Tensor = self.head(scaled_up(joined, grid))
        return answer


def joined_at(fine: Tensor, coarse: Tensor) -> Tensor:
    """(B, C1 + C2, H, W): coarse features scaled up to the size of the fine ones, and both together."""
    return torch.cat([fine, scaled_up(coarse, fine)], dim=1)


def scaled_up(x: Tensor, like: Tensor) -> Tensor:
    """Bilinear, to the height and width of another tensor.

    Corners stay corners: a feature at stride s looks at pixel i * s, so the first lies on the first.
    """
    return functional.interpolate(x, size=like.shape[-2:], mode="bilinear", align_corners=True)


def conv_norm_relu(channels_in: int, channels_out: int, kernel: int, stride: int = 1) -> nn.Sequential:
    """Convolution, batch norm, ReLU; padding keeps the size, rounded up at a stride."""
    conv = nn.Conv2d(channels_in, channels_out, kernel, stride, padding=(kernel - 1) // 2, bias=False)
    nn.init.kaiming_normal_(conv.weight, mode="fan_out", nonlinearity="relu")
    return nn.Sequential(conv, nn.BatchNorm2d(channels_out), nn.ReLU(inplace=True))
