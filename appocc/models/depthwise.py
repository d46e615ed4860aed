"""Depthwise convolution with fast bfloat16 gradients on CPUs: the library's take most of a training step."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional
from torch.nn.grad import conv2d_weight

# Weight gradients of larger kernels are several times faster in float32.
_SMALL_KERNEL = 3


class DepthwiseConv2d(nn.Conv2d):
    """Depthwise convolution with an odd kernel, symmetric padding and no bias."""

    def __init__(self, channels: int, kernel: int, stride: int = 1) -> None:
        """Build it with random weights."""
        super().__init__(channels, channels, kernel, stride, padding=kernel // 2, groups=channels, bias=False)

    def forward(self, x: Tensor) -> Tensor:
        """Convolve features (B, C, H, W)."""
        if x.dtype == torch.bfloat16 and x.device.type == "cpu" and torch.is_grad_enabled():
            found: Tensor = _Depthwise.apply(x, self.weight.to(x.dtype), self.stride[0])  # type: ignore[no-untyped-call]
            return found
        return super().forward(x)


class _Depthwise(torch.autograd.Function):
    """The gradients of `conv2d`, by operations that are fast in bfloat16."""

    @staticmethod
    def forward(ctx: Any, x: Tensor, weight: Tensor, stride: int) -> Tensor:
        """Return the convolution of features (B, C, H, W) and kernels (C, 1, k, k)."""
        ctx.save_for_backward(x, weight)
        ctx.stride = stride
        return functional.conv2d(x, weight, None, stride, weight.shape[-1] // 2, 1, len(weight))

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor, Tensor, None]:
        """Return the gradients of features and kernels."""
        x, weight = ctx.saved_tensors
        stride, size = ctx.stride, weight.shape[-1]
        gradient = gradients[0].contiguous(memory_format=torch.channels_last)
        spread = gradient
        if stride > 1:  # the transposed convolution as a convolution of the spread gradient
            spread = torch.zeros_like(x, memory_format=torch.channels_last)
            spread[:, :, ::stride, ::stride] = gradient
        of_x = functional.conv2d(spread, weight.flip(2, 3), None, 1, size // 2, 1, len(weight))
        kind = x.dtype if size <= _SMALL_KERNEL else torch.float32
        of_weight = conv2d_weight(  # type: ignore[no-untyped-call]
            x.to(kind), weight.shape, gradient.to(kind), stride, size // 2, 1, len(weight)
        )
        return of_x, of_weight.to(weight.dtype), None
