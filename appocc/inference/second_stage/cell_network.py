"""Network that corrects road and lane of a map by the image colours of parts of its cells.

Lane lines are narrower than a cell and than a pixel of image features: whether a cell is a line shows in the images
at their full size.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional

from appocc.bevmap import CLASSES, LANE, ROAD
from appocc.models.lean_trunk import upsample_twice
from appocc.models.resnet import conv_norm_relu

# Parts of a cell along each of its sides, and their number.
PARTS = 3
CELL_PARTS = PARTS * PARTS
# Classes that are corrected.
CORRECTED = (ROAD, LANE)
_FINE, _MIDDLE, _DEEP = 32, 48, 64
# Colours are relative to the mean colour around: cells on each side, and scale.
_AROUND_CELLS, _CONTRAST = 10, 4.0
_LOGIT_SCALE = 3.0


class CellInputs(NamedTuple):
    """Network inputs of B maps.

    Attributes:
        logits: (B, 3, X, Y) predicted logits of the classes.
        rgb: (B, 27, X, Y) sRGB colours, 0..1, at the parts of each cell: part (i, j) of the red channel first.
        seen: (B, 1, X, Y) share of the parts that a camera sees.
        distance: (1 or B, 1, X, Y) distance of the cell from the ego, as the last of `cell_coordinates`.
    """

    logits: Tensor
    rgb: Tensor
    seen: Tensor
    distance: Tensor


class CellNetwork(nn.Module):
    """U-Net of three scales over the grid, from the logits of a map and the colours of its cells to better logits."""

    def __init__(self) -> None:
        """Build the network with random weights; it begins by leaving the logits as they are."""
        super().__init__()
        self.stem = conv_norm_relu(len(CLASSES) + 3 * CELL_PARTS + 2, _FINE, 1)
        self.fine = conv_norm_relu(_FINE, _FINE, 3)
        self.middle = nn.Sequential(conv_norm_relu(_FINE, _MIDDLE, 3, 2), conv_norm_relu(_MIDDLE, _MIDDLE, 3))
        self.deep = nn.Sequential(conv_norm_relu(_MIDDLE, _DEEP, 3, 2), conv_norm_relu(_DEEP, _DEEP, 3))
        self.to_middle, self.to_fine = conv_norm_relu(_DEEP, _MIDDLE, 1), conv_norm_relu(_MIDDLE, _FINE, 1)
        self.mixed_middle, self.mixed_fine = conv_norm_relu(_MIDDLE, _MIDDLE, 3), conv_norm_relu(_FINE, _FINE, 3)
        self.answer = nn.Conv2d(_FINE, len(CORRECTED), 3, padding=1)
        nn.init.zeros_(self.answer.weight)
        nn.init.zeros_(self.answer.bias)  # type: ignore[arg-type]

    def forward(self, inputs: CellInputs) -> Tensor:
        """Return the corrected logits (B, 2, X, Y) of road and lane."""
        distance = inputs.distance.expand_as(inputs.seen)
        channels = [inputs.logits / _LOGIT_SCALE, _contrast(inputs.rgb, inputs.seen), inputs.seen, distance]
        fine = self.fine(self.stem(torch.cat(channels, dim=1).contiguous(memory_format=torch.channels_last)))
        middle = self.middle(fine)
        middle = self.mixed_middle(middle + upsample_twice(self.to_middle(self.deep(middle)), middle))
        fine = self.mixed_fine(fine + upsample_twice(self.to_fine(middle), fine))
        corrected: Tensor = inputs.logits[:, CORRECTED] + self.answer(fine)
        return corrected


def _contrast(rgb: Tensor, seen: Tensor) -> Tensor:
    """Return colours (B, 27, X, Y) as differences from the mean around: the light matters less; 0 if unseen."""
    batch, _, x, y = rgb.shape
    channels = rgb.reshape(batch, 3, CELL_PARTS, x, y)
    around = _mean_around(torch.cat([channels.mean(2) * seen, seen], dim=1))
    mean = around[:, :3] / around[:, 3:].clamp(min=1e-3)
    return ((channels - mean[:, :, None]) * seen[:, None] * _CONTRAST).reshape(batch, -1, x, y)


def _mean_around(values: Tensor) -> Tensor:
    """Return the mean of values (B, C, X, Y) over a square of cells, in two passes."""
    wide = 2 * _AROUND_CELLS + 1
    rows = functional.avg_pool2d(values, (wide, 1), 1, (_AROUND_CELLS, 0))
    return functional.avg_pool2d(rows, (1, wide), 1, (0, _AROUND_CELLS))
