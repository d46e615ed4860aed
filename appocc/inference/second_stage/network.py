"""Network of the second stage: from the image crop of a predicted vehicle to corrections of its box.

One crop for each box as in two-stage detection: Ren et al., "Faster R-CNN", NeurIPS 2015.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional

from appocc.models.resnet import BasicBlock, conv_norm_relu
from appocc.objects import KINDS

_CHANNELS, _HIDDEN, _DROPOUT = 24, 128, 0.1
# Logits of a vehicle and of a near front, logits of the kinds, CIELAB, sizes.
_SPLIT = [1, 1, len(KINDS), 3, 3]
# Scales of the outputs: CIELAB, logarithm of sizes.
_LAB_SPREAD, _SIZE_SPREAD = (30.0, 25.0, 25.0), 0.1


class CropInputs(NamedTuple):
    """Network inputs of K boxes, whose headings point away from the ego.

    Attributes:
        pixels: (K, 7, H, W) colours, places on the box, and whether it is visible; each in -1..1.
        numbers: (K, 18) numbers of the box, see `box_numbers`.
        body_lab: (K, 3) mean CIELAB of the pixels that show its bodywork.
    """

    pixels: Tensor
    numbers: Tensor
    body_lab: Tensor


class Corrections(NamedTuple):
    """Network outputs of K boxes.

    Attributes:
        found: (K,) logit of a vehicle within 2 m.
        near_front: (K,) logit that the front of the vehicle is at the end of the box that is nearer to the ego.
        kind: (K, kinds) logits of its kind.
        lab: (K, 3) CIELAB of its paint as seen from above, in the light of the scene.
        size: (K, 3) logarithm of the factors of width, length and height.
    """

    found: Tensor
    near_front: Tensor
    kind: Tensor
    lab: Tensor
    size: Tensor


class CropNetwork(nn.Module):
    """Convolutions over a crop, pooled by attention and by the mean, and two layers with the numbers of the box."""

    PIXEL_CHANNELS, NUMBERS = 7, 18

    def __init__(self) -> None:
        """Build the network with random weights."""
        super().__init__()
        wide = _CHANNELS
        self.trunk = nn.Sequential(
            conv_norm_relu(4 * self.PIXEL_CHANNELS, wide, 3),
            BasicBlock(wide, wide),
            conv_norm_relu(wide, 2 * wide, 3, 2),
            BasicBlock(2 * wide, 2 * wide),
            conv_norm_relu(2 * wide, 3 * wide, 3, 2),
            BasicBlock(3 * wide, 3 * wide),
        )
        self.attention = nn.Conv2d(3 * wide, 1, 1)
        self.mixed = nn.Sequential(
            nn.Linear(6 * wide + self.NUMBERS + 3, _HIDDEN),
            nn.ReLU(),
            nn.Dropout(_DROPOUT),
            nn.Linear(_HIDDEN, _HIDDEN),
            nn.ReLU(),
        )
        self.answer = nn.Linear(_HIDDEN, sum(_SPLIT))

    def forward(self, inputs: CropInputs) -> Corrections:
        """Predict the corrections of K boxes."""
        features = self.trunk(functional.pixel_unshuffle(inputs.pixels, 2))
        weight = self.attention(features).flatten(2).softmax(-1)
        pooled = (features.flatten(2) * weight).sum(-1)
        known = torch.cat([pooled, features.mean((2, 3)), inputs.numbers, inputs.body_lab / 50], dim=1)
        found, near_front, kind, lab, size = torch.split(self.answer(self.mixed(known)), _SPLIT, dim=1)
        paint = inputs.body_lab + lab * lab.new_tensor(_LAB_SPREAD)
        return Corrections(found[:, 0], near_front[:, 0], kind, paint, _SIZE_SPREAD * size)
