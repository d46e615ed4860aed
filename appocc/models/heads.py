"""Output heads: occupancy and appearance of grid cells; in training also depth and class of image features."""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn

from appocc.models.base import DEPTH_BINS

# Shares of cells that are road, vehicle and lane: initial predictions, so that training need not learn them.
PRIORS = (0.2, 0.02, 0.015)
# Added to the support of a candidate colour, so that its weight stays positive.
_LEAST_SUPPORT = 0.01


def log_odds(shares: tuple[float, ...]) -> Tensor:
    """Return logits (K,) of probabilities."""
    return torch.tensor([math.log(share / (1 - share)) for share in shares])


class GridHeads(nn.Module):
    """Occupancy and optionally appearance of each cell, from features at the resolution of the grid.

    The colour of a cell is a weighted mean of a predicted colour and of candidate colours sampled from the images;
    the head predicts the weights. Copying colours is learnt faster than predicting them, and generalises to paint
    that is not in the training data.
    """

    def __init__(self, channels: int, appearance: bool, offers: int) -> None:
        """Build the heads with random weights; occupancy starts at `PRIORS`, appearance as a mean of all candidates.

        Args:
            channels: number of input features.
            appearance: predict appearance too.
            offers: number of candidate colours per cell.
        """
        super().__init__()
        self.appearance = appearance
        # One convolution for all outputs: a second pass over the grid costs more than the extra channels.
        self.answer = nn.Conv2d(channels, 3 + 3 + 1 + offers if appearance else 3, 3, padding=1)
        nn.init.normal_(self.answer.weight, std=0.01)
        nn.init.zeros_(self.answer.bias)  # type: ignore[arg-type]
        with torch.no_grad():
            self.answer.bias[:3] = log_odds(PRIORS)  # type: ignore[index]

    def forward(self, cells: Tensor, offered: Tensor, support: Tensor | None = None) -> tuple[Tensor, Tensor | None]:
        """Predict occupancy and appearance.

        Args:
            cells: (B, C, X, Y) features.
            offered: (B, offers, 4, X, Y) candidate colours, 0..1, and a validity of 1 or 0.
            support: (B, offers, X, Y) probability that each candidate is the colour of a surface in the cell; a
                factor of its weight.

        Returns:
            Logits (B, 3, X, Y), and colours (B, 3, X, Y) 0..1; both float32.
        """
        answer = self.answer(cells).float()
        if not self.appearance:
            return answer, None
        own, score = torch.sigmoid(answer[:, None, 3:6]), answer[:, 6:]  # B 1 3 X Y, B 1+offers X Y
        valid = torch.cat([torch.ones_like(score[:, :1]), offered[:, :, 3]], dim=1) > 0.5
        if support is not None:
            score = torch.cat([score[:, :1], score[:, 1:] + torch.log(support.float() + _LEAST_SUPPORT)], dim=1)
        weight = torch.where(valid, score, -1e4).softmax(dim=1)
        return answer[:, :3], (weight[:, :, None] * torch.cat([own, offered[:, :, :3]], dim=1)).sum(dim=1)


class ImageHeads(nn.Module):
    """Class and optionally depth of image features, for auxiliary losses; not used after training."""

    def __init__(self, channels: int, num_classes: int, depth: bool = True) -> None:
        """Build the heads for a number of classes of `ViewClass`, with or without depth."""
        super().__init__()
        self.depth = nn.Conv2d(channels, DEPTH_BINS, 1) if depth else None
        self.kind = nn.Conv2d(channels, num_classes, 1)

    def forward(self, features: Tensor) -> tuple[Tensor | None, Tensor]:
        """Return logits (V, DEPTH_BINS, h, w) and (V, num_classes, h, w), float32, of features (V, C, h, w)."""
        return None if self.depth is None else self.depth(features).float(), self.kind(features).float()
