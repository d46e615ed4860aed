"""What a network says at the end: classes and colours of cells, and in training depth and classes of the pictures."""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn

from appocc.models.base import DEPTH_BINS

# Shares of cells that are road, vehicle and lane: a network that starts there has no need to learn them first.
PRIORS = (0.2, 0.02, 0.015)


def log_odds(shares: tuple[float, ...]) -> Tensor:
    """Logits (K,) of probabilities."""
    return torch.tensor([math.log(share / (1 - share)) for share in shares])


class GridHeads(nn.Module):
    """Occupancy and, if wanted, appearance of each cell, from features at the grid's own resolution."""

    def __init__(self, channels: int, appearance: bool) -> None:
        """Make it with fresh weights; occupancy starts at `PRIORS`, appearance at grey."""
        super().__init__()
        # One convolution for both: the features have few channels, and a second pass over the grid costs more.
        self.answer = nn.Conv2d(channels, 6 if appearance else 3, 3, padding=1)
        nn.init.normal_(self.answer.weight, std=0.01)
        nn.init.zeros_(self.answer.bias)  # type: ignore[arg-type]
        with torch.no_grad():
            self.answer.bias[:3] = log_odds(PRIORS)  # type: ignore[index]

    def forward(self, cells: Tensor) -> tuple[Tensor, Tensor | None]:
        """Cells (B, C, X, Y) -> logits (B, 3, X, Y), colours (B, 3, X, Y) 0..1; both float32."""
        answer = self.answer(cells).float()
        return answer[:, :3], torch.sigmoid(answer[:, 3:]) if answer.shape[1] > 3 else None


class ViewHeads(nn.Module):
    """Depth and class at each place of the pictures: extra lessons for training, nothing of it runs afterwards."""

    def __init__(self, channels: int, kinds: int) -> None:
        """Make it for a number of classes of `ViewClass`."""
        super().__init__()
        self.depth = nn.Conv2d(channels, DEPTH_BINS, 1)
        self.kind = nn.Conv2d(channels, kinds, 1)

    def forward(self, features: Tensor) -> tuple[Tensor, Tensor]:
        """Features (V, C, h, w) -> logits (V, DEPTH_BINS, h, w) and (V, kinds, h, w), float32."""
        return self.depth(features).float(), self.kind(features).float()
