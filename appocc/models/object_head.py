"""Object head: centres and boxes of objects on the grid, after CenterPoint (Yin, Zhou and Krähenbühl, CVPR 2021)."""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn

from appocc.models.base import ObjectOutput
from appocc.models.resnet import conv_norm_relu
from appocc.objects import KINDS

# Initial probability of a centre.
_PRIOR = 0.01
# Offset x, y; height of the centre; log width, length, height; sine and cosine of the heading; velocity x, y.
_SPLIT = [2, 1, 3, 2, 2]
_AXIS = 2  # sine and cosine of twice the heading


class ObjectHead(nn.Module):
    """Heads at the resolution of the trunk: the kinds' centre heatmaps and a box at every cell."""

    def __init__(self, channels: int) -> None:
        """Build the head for features of this number of channels."""
        super().__init__()
        self.mixed = conv_norm_relu(channels, channels, 3)
        self.centre = nn.Conv2d(channels, len(KINDS), 1)
        self.box = nn.Conv2d(channels, sum(_SPLIT), 1)
        self.axis = nn.Conv2d(channels, _AXIS, 1)
        nn.init.normal_(self.centre.weight, std=0.01)
        nn.init.constant_(self.centre.bias, -math.log(1 / _PRIOR - 1))  # type: ignore[arg-type]

    def forward(self, features: Tensor) -> ObjectOutput:
        """Predict from features (B, C, X', Y')."""
        mixed = self.mixed(features)
        offset, height, size, heading, velocity = torch.split(self.box(mixed).float(), _SPLIT, dim=1)
        centre, axis = self.centre(mixed).float(), self.axis(mixed).float()
        return ObjectOutput(centre, offset, height, size, heading, velocity, axis)
