"""Trunk over the grid that does nearly all computation at half the resolution or less, with an optional memory."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional

from appocc.grid import BEVGrid
from appocc.models.memory import Past, warp
from appocc.models.model_spec import Parts
from appocc.models.resnet import BasicBlock, conv_norm_relu

# Features per height that cells sample at strides 8 and 4, and a colour with its validity.
COARSE_CHANNELS, FINE_CHANNELS, PAINT_CHANNELS = 32, 16, 4
_TRUNK_CHANNELS = 64
_PLACE_CHANNELS = 4
# Of each height: the probability of a surface at the point, and of none nearer.
_SURFACE_CHANNELS = 2
# Remembered features, and a first channel that is 1 where something is remembered.
_MEMORY_CHANNELS, _FUSED_CHANNELS = 32, 48


class TrunkOutput(NamedTuple):
    """Features of the trunk.

    Attributes:
        cells: (B, 24, X, Y) features of the cells.
        last: (B, 48, X/2, Y/2) features of cells of twice the size.
        memory: (B, 33, X/2, Y/2) memory for the next frame of each clip; None without memory.
    """

    cells: Tensor
    last: Tensor
    memory: Tensor | None


class LeanTrunk(nn.Module):
    """ResNet trunk with two downsamplings, from features of cells of twice the size to features of cells."""

    last_channels, cell_channels, memory_channels = 48, 24, 1 + _MEMORY_CHANNELS

    def __init__(self, heights: int, parts: Parts, half_grid: BEVGrid) -> None:
        """Build the trunk for a number of heights, with or without depth and memory."""
        super().__init__()
        wide = _TRUNK_CHANNELS
        self.heights = heights
        read = COARSE_CHANNELS + (COARSE_CHANNELS + _SURFACE_CHANNELS if parts.depth else 0)
        self.stem = conv_norm_relu(heights * read, wide, 1)
        self.place = nn.Conv2d(_PLACE_CHANNELS, wide, 1)
        self.recall = _Recall(wide, half_grid) if parts.memory else None
        self.stage1 = BasicBlock(wide, wide)
        self.stage2 = BasicBlock(wide, 2 * wide, 2)
        self.stage3 = BasicBlock(2 * wide, 4 * wide, 2)
        self.side2 = conv_norm_relu(2 * wide, wide, 1)
        self.side3 = conv_norm_relu(4 * wide, wide, 1)
        self.down2 = conv_norm_relu(wide, wide, 3)
        self.last = conv_norm_relu(wide, self.last_channels, 3)
        # Each cell at half resolution predicts its four cells: sharper than interpolation, and cheap.
        self.four = nn.Conv2d(self.last_channels, 4 * self.cell_channels, 1)
        self.near = nn.Conv2d(heights * (FINE_CHANNELS + PAINT_CHANNELS), self.cell_channels, 1)
        with torch.no_grad():  # equal initial weights avoid a checkerboard pattern
            self.four.weight.copy_(self.four.weight[::4].repeat_interleave(4, dim=0))
            self.four.bias.copy_(self.four.bias[::4].repeat_interleave(4, dim=0))  # type: ignore[union-attr, index]

    def forward(
        self, standing: Tensor, surface: Tensor | None, place: Tensor, near: Tensor, past: Past | None
    ) -> TrunkOutput:
        """Combine the sampled features.

        Args:
            standing: (B, heights * 32, X/2, Y/2) coarse features, of cells of twice the size.
            surface: (B, heights * 2, X/2, Y/2) probabilities of `sample_depth`; None without depth.
            place: (B, 4, X/2, Y/2) coordinates of these cells and the number of cameras that see them.
            near: (B, heights * 20, X, Y) fine features and colours of the cells of the grid.
            past: links of clips; None: single frames.
        """
        if surface is not None:
            at = surface[:, ::2].repeat_interleave(COARSE_CHANNELS, dim=1)
            standing = torch.cat([standing, standing * at, surface], dim=1)
        half, memory = self.stem(standing) + self.place(place), None  # B 64 X/2 Y/2
        if self.recall is None:
            half = self.stage1(half)
        else:
            half, memory = self.recall(half, self.stage1, past)
        quarter = self.stage2(half)  # B 128 X/4 Y/4
        side = self.side2(quarter)
        joined = self.down2(side + upsample_twice(self.side3(self.stage3(quarter)), side))  # B 64 X/4 Y/4
        last = self.last(half + upsample_twice(joined, half))  # B 48 X/2 Y/2
        four = functional.pixel_shuffle(self.four(last), 2)[..., : near.shape[-2], : near.shape[-1]]
        return TrunkOutput(functional.relu(four + self.near(near)), last, memory)


class _Recall(nn.Module):
    """Recurrent fusion of the features of a frame with the memory of the frames before it."""

    def __init__(self, channels: int, grid: BEVGrid) -> None:
        super().__init__()
        self.grid = grid
        # Memory with its mask, elapsed time, features of the frame.
        self.mixed = conv_norm_relu(_MEMORY_CHANNELS + 2 + channels, _FUSED_CHANNELS, 1)
        self.fused = nn.Conv2d(_FUSED_CHANNELS, channels, 3, padding=1, bias=False)
        self.keep = conv_norm_relu(channels, _MEMORY_CHANNELS, 1)
        nn.init.zeros_(self.fused.weight)  # begins as a network without memory

    def forward(self, features: Tensor, stage: nn.Module, past: Past | None) -> tuple[Tensor, Tensor]:
        """Fuse frame after frame.

        Args:
            features: (S, C, X', Y') features of all frames of all clips, time-major.
            stage: layers whose outputs are remembered.
            past: links of the frames; None: single frames.

        Returns:
            (S, C, X', Y') outputs of the stage, and (B, 33, X', Y') memory of the last frames.
        """
        frames, clips = (1, len(features)) if past is None else past.linked.shape
        state = None if past is None else past.state
        if state is None:
            state = features.new_zeros(clips, 1 + _MEMORY_CHANNELS, *features.shape[2:])
        outputs = []
        for t in range(frames):
            now = features[t * clips : (t + 1) * clips]
            if past is not None and (t or past.state is not None):
                linked, elapsed_s = (each[t].to(state)[:, None, None, None] for each in (past.linked, past.elapsed_s))
                state = warp(state, past.past_from_now[t], self.grid) * linked
                elapsed = state[:, :1] * elapsed_s
            else:
                elapsed = state[:, :1]
            outputs.append(stage(now + self.fused(self.mixed(torch.cat([state, elapsed, now], dim=1)))))
            kept = self.keep(outputs[-1])
            state = torch.cat([torch.ones_like(kept[:, :1]), kept], dim=1)
        return torch.cat(outputs) if frames > 1 else outputs[0], state


def upsample_twice(x: Tensor, like: Tensor) -> Tensor:
    """Upsample to twice the size, cropped to that of `like`; bilinear, without a shift.

    A convolution of stride 2 with symmetric padding centres output j on input 2 j. The usual interpolation centres it
    on 2 j + 1/2: a shift of 0.8 m at the coarsest level of the grid.
    """
    high, wide = x.shape[-2:]
    x = functional.interpolate(
        functional.pad(x, (0, 1, 0, 1), mode="replicate"),
        (2 * high + 1, 2 * wide + 1),
        mode="bilinear",
        align_corners=True,
    )
    return x[..., : like.shape[-2], : like.shape[-1]]
