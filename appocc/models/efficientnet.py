"""EfficientNet-B0 as an image encoder, truncated after the required stride.

Tan and Le, "EfficientNet: Rethinking Model Scaling for Convolutional Neural Networks", ICML 2019. Parameters are
named as in torchvision, whose ImageNet weights load with `strict=False`.
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
from appocc.models.depthwise import DepthwiseConv2d

IMAGENET_MEAN = (0.485, 0.456, 0.406)
IMAGENET_STD = (0.229, 0.224, 0.225)


class _Stage(NamedTuple):
    """A row of the paper's table 1: equal blocks, the first of which has the stride."""

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
# Index in `features` of the last stage at each stride (0 is the stem).
_LAST_STAGE = MappingProxyType({4: 2, 8: 3, 16: 5, 32: 7})
# Drop probability of the last block in training; earlier blocks in proportion to their depth.
_SKIP_CHANCE = 0.2


class EfficientNetB0(nn.Module):
    """Image features at strides 4, 8, 16 and 32, up to a given stride; deeper stages are omitted.

    Padding is symmetric, (kernel - 1) // 2, so feature i is centred on pixel i * stride: see `column_centres_px`.

    Attributes:
        channels: number of features by stride.
    """

    mean: Tensor
    std: Tensor

    def __init__(self, stride: int = 16) -> None:
        """Build the stages up to a stride, with random weights.

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
        # Constants, not weights.
        self.register_buffer("mean", torch.tensor(IMAGENET_MEAN).view(3, 1, 1), persistent=False)
        self.register_buffer("std", torch.tensor(IMAGENET_STD).view(3, 1, 1), persistent=False)
        _initialise(self)

    def forward(self, images: Tensor) -> dict[int, Tensor]:
        """Encode images.

        Args:
            images: (B, 3, H, W) sRGB, 0..1.

        Returns:
            Features by stride: (B, channels[stride], ceil(H / stride), ceil(W / stride)).
        """
        x = (images - self.mean) / self.std
        found: dict[int, Tensor] = {}
        for number, stage in enumerate(self.features):
            x = stage(x)
            if number in self._stride_after:
                found[self._stride_after[number]] = x
        return found


def column_centres_px(stride: int, count: int) -> FloatArray:
    """Return the pixel (count,) at the centre of the receptive field of each feature column (or row).

    Pixel centres are at whole numbers. The centres follow from the padding of every convolution; image borders are
    ignored. Because padding is symmetric, column i is centred on pixel i * stride and not on the middle of a patch.

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
    """Yield (kernel, stride) of every spatial convolution up to a stage."""
    yield 3, 2
    for stage in _STAGES[:last_stage]:
        yield stage.kernel, stage.stride
        yield from ((stage.kernel, 1) for _ in range(stage.blocks - 1))


def _conv_norm(
    channels_in: int, channels_out: int, kernel: int, stride: int = 1, groups: int = 1, act: bool = True
) -> nn.Sequential:
    conv: nn.Module = DepthwiseConv2d(channels_in, kernel, stride)
    if groups == 1:
        conv = nn.Conv2d(channels_in, channels_out, kernel, stride, padding=(kernel - 1) // 2, bias=False)
    # With the usual momentum of 0.01 the statistics are not converged after a few hundred steps.
    layers: list[nn.Module] = [conv, nn.BatchNorm2d(channels_out, momentum=0.1)]
    return nn.Sequential(*layers, *([nn.SiLU(inplace=True)] if act else []))


def _stage(number: int) -> nn.Sequential:
    """Return all blocks of a stage with their drop probabilities."""
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
    """Squeeze-and-excitation: channel weights from the global mean of the features."""

    def __init__(self, channels: int, squeezed: int) -> None:
        super().__init__()
        self.fc1 = nn.Conv2d(channels, squeezed, 1)
        self.fc2 = nn.Conv2d(squeezed, channels, 1)

    def forward(self, x: Tensor) -> Tensor:
        scale = x.mean(dim=(2, 3), keepdim=True)  # B C 1 1
        weighted: Tensor = x * torch.sigmoid(self.fc2(nn.functional.silu(self.fc1(scale))))
        return weighted


class _MBConv(nn.Module):
    """Inverted bottleneck: expansion, depthwise convolution, squeeze-and-excitation, projection."""

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
        return x + self._drop(y) if self.residual else y

    def _drop(self, y: Tensor) -> Tensor:
        """Drop the block per image: stochastic depth (Huang et al., ECCV 2016)."""
        if not self.training or self.skip_chance == 0:
            return y
        keep_chance = 1 - self.skip_chance
        kept = torch.empty(len(y), 1, 1, 1, dtype=y.dtype, device=y.device).bernoulli_(keep_chance)
        return y * (kept / keep_chance)


def _initialise(module: nn.Module) -> None:
    """Initialise convolutions with He's method (fan-out), as torchvision's EfficientNet."""
    for part in module.modules():
        if isinstance(part, nn.Conv2d):
            nn.init.kaiming_normal_(part.weight, mode="fan_out")
            if part.bias is not None:
                nn.init.zeros_(part.bias)
