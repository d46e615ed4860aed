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
    """Occupancy and, if wanted, appearance of each cell, from features at the grid's own resolution.

    A cell's colour is a mean of its own answer and of the colours that pictures offer for it, weighted by what the
    cell thinks of each: copying is learnt sooner than naming, and holds for paint that no training showed.
    """

    def __init__(self, channels: int, appearance: bool, offers: int) -> None:
        """Make it with fresh weights; occupancy starts at `PRIORS`, appearance between grey and what is offered."""
        super().__init__()
        self.appearance = appearance
        # One convolution for all: the features have few channels, and a second pass over the grid costs more.
        self.answer = nn.Conv2d(channels, 3 + 3 + 1 + offers if appearance else 3, 3, padding=1)
        nn.init.normal_(self.answer.weight, std=0.01)
        nn.init.zeros_(self.answer.bias)  # type: ignore[arg-type]
        with torch.no_grad():
            self.answer.bias[:3] = log_odds(PRIORS)  # type: ignore[index]

    def forward(self, cells: Tensor, offered: Tensor) -> tuple[Tensor, Tensor | None]:
        """Say what cells hold.

        Args:
            cells: (B, C, X, Y) features.
            offered: (B, offers, 4, X, Y) colours, 0..1, and 1 where there is one, else 0.

        Returns:
            Logits (B, 3, X, Y), and colours (B, 3, X, Y) 0..1; both float32.
        """
        answer = self.answer(cells).float()
        if not self.appearance:
            return answer, None
        own, liking = torch.sigmoid(answer[:, None, 3:6]), answer[:, 6:]  # B 1 3 X Y, B 1+offers X Y
        there = torch.cat([torch.ones_like(liking[:, :1]), offered[:, :, 3]], dim=1) > 0.5
        share = torch.where(there, liking, -1e4).softmax(dim=1)
        return answer[:, :3], (share[:, :, None] * torch.cat([own, offered[:, :, :3]], dim=1)).sum(dim=1)


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
