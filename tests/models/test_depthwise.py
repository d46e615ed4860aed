"""Gradients of the depthwise convolution are those of `conv2d`."""

from __future__ import annotations

import pytest
import torch
from torch.nn import functional

from appocc.models.depthwise import DepthwiseConv2d


@pytest.mark.parametrize("size", [(7, 9), (8, 10), (5, 5)])
@pytest.mark.parametrize("stride", [1, 2])
@pytest.mark.parametrize("kernel", [3, 5])
def test_gradients_in_bfloat16(kernel: int, stride: int, size: tuple[int, int]) -> None:
    torch.manual_seed(0)
    layer = DepthwiseConv2d(6, kernel, stride)
    x = torch.randn(2, 6, *size).bfloat16().requires_grad_()
    weight = layer.weight.detach().bfloat16().float().requires_grad_()
    exact_x = x.detach().float().requires_grad_()
    exact = functional.conv2d(exact_x, weight, None, stride, kernel // 2, 1, 6)
    upstream = torch.randn_like(exact).bfloat16()
    expected = torch.autograd.grad(exact, (exact_x, weight), upstream.float())
    found = layer(x)
    gradients = torch.autograd.grad(found, (x, layer.weight), upstream)
    # bfloat16 has 8 bits; sums of at most 2 * 9 * 9 terms around 1.
    torch.testing.assert_close(found.float(), exact, rtol=2**-6, atol=2**-6)
    torch.testing.assert_close(gradients[0].float(), expected[0], rtol=2**-6, atol=2**-5)
    torch.testing.assert_close(gradients[1], expected[1], rtol=2**-5, atol=2**-3)


def test_other_types_are_left_to_the_library() -> None:
    layer = DepthwiseConv2d(4, 3)
    x = torch.randn(1, 4, 5, 5)
    assert torch.equal(layer(x), functional.conv2d(x, layer.weight, None, 1, 1, 1, 4))
