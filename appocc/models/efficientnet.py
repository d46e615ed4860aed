"""EfficientNet-B0 as an encoder of pictures, cut off where its features are wanted.

Tan and Le, "EfficientNet: Rethinking Model Scaling for Convolutional Neural Networks", ICML 2019. Parameters are
named as in torchvision, so that its ImageNet weights load with `strict=False`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import pairwise
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor, nn

from appocc.checks import FloatArray
from appocc.errors import ShapeError

IMAGENET_MEAN = (0.485, 0.456, 0.406)
IMAGENET_STD = (0.229, 0.224, 0.225)


class _Stage(NamedTuple):
    """A row of the paper's table 1: blocks of one kind; the first of them has the stride."""

    expansion: int
    kernel: int
    stride: int
    channels_in: int
    channels_out: int
    blocks: int


_STEM_CHANNELS = 32
_STAGES = (
    _Stage(1, 3, 1, 32, 16, 1),
    _Stage(6, 3, 2, 16, 24, 2),
    _Stage(6, 5, 2, 24, 40, 2),
    _Stage(6, 3, 2, 40, 80, 3),
    _Stage(6, 5, 1, 80, 112, 3),
    _Stage(6, 5, 2, 112, 192, 4),
    _Stage(6, 3, 1, 192, 320, 1),
)
# Number of the last stage at each stride, counted as in `features` (0 is the stem).
_LAST_STAGE = MappingProxyType({4: 2, 8: 3, 16: 5, 32: 7})
# Chance that the last block of the whole network is skipped in training; earlier ones in proportion to their depth.
_SKIP_CHANCE = 0.2


class EfficientNetB0(nn.Module):
    """Pictures -> features at strides 4, 8, 16 and 32, as far as it is kept; deeper stages are not made at all.

    Padding is symmetric, (kernel - 1) // 2, so feature i looks at pixel i * stride: see `column_centres_px`.

    Attributes:
        channels: of the features, by stride.
    """

    mean: Tensor
    std: Tensor

    def __init__(self, stride: int = 16) -> None:
        """Make the stages up to a stride, with fresh weights.

        Raises:
            ShapeError: if there are no features at this stride.
        """
        super().__init__()
        if stride not in _LAST_STAGE:
            raise ShapeError(f"encoder: expected a stride of {', '.join(map(str, _LAST_STAGE))}, got {stride}")
        kept = {step: last for step, last in _LAST_STAGE.items() if step <= stride}
        self.channels: Mapping[int, int] = {step: _STAGES[last - 1].channels_out for step, last in kept.items()}
        self._stride_after = {last: step for step, last in kept.items()}
        self.features = nn.Sequential(
            _conv_norm(3, _STEM_CHANNELS, 3, 2), *(_stage(number) for number in range(kept[stride]))
        )
        # Not weights: they are the same in every file.
        self.register_buffer("mean", torch.tensor(IMAGENET_MEAN).view(3, 1, 1), persistent=False)
        self.register_buffer("std", torch.tensor(IMAGENET_STD).view(3, 1, 1), persistent=False)
        _start(self)

    def forward(self, images: Tensor) -> dict[int, Tensor]:
        """Look at pictures.

        Args:
            images: (B, 3, H, W) sRGB, 0..1.

        Returns:
            By stride, (B, channels[stride], ceil(H / stride), ceil(W / stride)).
        """
        x = (images - self.mean) / self.std
        found: dict[int, Tensor] = {}
        for number, stage in enumerate(self.features):
            x = stage(x)
            if number in self._stride_after:
                found[self._stride_after[number]] = x
        return found


def column_centres_px(stride: int, count: int) -> FloatArray:
    """The pixel (count,) that each feature column (or row) looks at; pixel centres lie at whole numbers.

    Follows the padding of every convolution; edges of the picture do not matter. Because padding is symmetric, column
    i looks at i * stride: not at the middle of a patch, nor at evenly spread places from edge to edge.

    Raises:
        ShapeError: if there are no features at this stride.
    """
    if stride not in _LAST_STAGE:
        raise ShapeError(f"encoder: expected a stride of {', '.join(map(str, _LAST_STAGE))}, got {stride}")
    centre, step = 0.0, 1
    for kernel, stride_here in _convolutions(_LAST_STAGE[stride]):
        # Output 0 covers inputs -padding .. kernel - 1 - padding.
        centre += step * ((kernel - 1) / 2 - (kernel - 1) // 2)
        step *= stride_here
    return np.asarray(centre + step * np.arange(count, dtype=np.float64))


def _convolutions(last_stage: int) -> Iterator[tuple[int, int]]:
    """(kernel, stride) of every spatial convolution up to a stage."""
    yield 3, 2
    for stage in _STAGES[:last_stage]:
        yield stage.kernel, stage.stride
        yield from ((stage.kernel, 1) for _ in range(stage.blocks - 1))


def _conv_norm(
    channels_in: int, channels_out: int, kernel: int, stride: int = 1, groups: int = 1, act: bool = True
) -> nn.Sequential:
    conv = nn.Conv2d(channels_in, channels_out, kernel, stride, padding=(kernel - 1) // 2, groups=groups, bias=False)
    # The usual momentum of 0.01 leaves statistics wrong after a few hundred steps.
    layers: list[nn.Module] = [conv, nn.BatchNorm2d(channels_out, momentum=0.1)]
    return nn.Sequential(*layers, *([nn.SiLU(inplace=True)] if act else []))


def _stage(number: int) -> nn.Sequential:
    """All blocks of a stage, each with its chance of being skipped."""
    stage = _STAGES[number]
    before = sum(earlier.blocks for earlier in _STAGES[:number])
    total = sum(each.blocks for each in _STAGES)
    widths = [stage.channels_in] + [stage.channels_out] * stage.blocks
    return nn.Sequential(
        *(
            _MBConv(stage, width_in, stage.stride if i == 0 else 1, _SKIP_CHANCE * (before + i) / total)
            for i, (width_in, _) in enumerate(pairwise(widths))
        )
    )


class _SqueezeExcitation(nn.Module):
    """Channels weighted by what the whole picture holds."""

    def __init__(self, channels: int, squeezed: int) -> None:
        super().__init__()
        self.fc1 = nn.Conv2d(channels, squeezed, 1)
        self.fc2 = nn.Conv2d(squeezed, channels, 1)

    def forward(self, x: Tensor) -> Tensor:
        scale = x.mean(dim=(2, 3), keepdim=True)  # B C 1 1
        weighted: Tensor = x * torch.sigmoid(self.fc2(nn.functional.silu(self.fc1(scale))))
        return weighted


class _MBConv(nn.Module):
    """Inverted bottleneck: wider, convolution per channel, squeeze-excite, narrower."""

    def __init__(self, stage: _Stage, channels_in: int, stride: int, skip_chance: float) -> None:
        super().__init__()
        wide = channels_in * stage.expansion
        layers: list[nn.Module] = [] if wide == channels_in else [_conv_norm(channels_in, wide, 1)]
        layers += [
            _conv_norm(wide, wide, stage.kernel, stride, groups=wide),
            _SqueezeExcitation(wide, max(1, channels_in // 4)),
            _conv_norm(wide, stage.channels_out, 1, act=False),
        ]
        self.block = nn.Sequential(*layers)
        self.residual = stride == 1 and channels_in == stage.channels_out
        self.skip_chance = skip_chance

    def forward(self, x: Tensor) -> Tensor:
        y: Tensor = self.block(x)
        return x + self._sometimes(y) if self.residual else y

    def _sometimes(self, y: Tensor) -> Tensor:
        """Stochastic depth, picture by picture (Huang et al., ECCV 2016)."""
        if not self.training or self.skip_chance == 0:
            return y
        stays = 1 - self.skip_chance
        kept = torch.empty(len(y), 1, 1, 1, dtype=y.dtype, device=y.device).bernoulli_(stays)
        return y * (kept / stays)


def _start(module: nn.Module) -> None:
    """Fresh weights: He's, by the number of outputs, as torchvision's EfficientNet starts."""
    for part in module.modules():
        if isinstance(part, nn.Conv2d):
            nn.init.kaiming_normal_(part.weight, mode="fan_out")
            if part.bias is not None:
                nn.init.zeros_(part.bias)
