"""Batch-norm folding: merge batch norms into the convolutions before them, for inference."""

from __future__ import annotations

from copy import deepcopy
from typing import TypeVar

from torch import nn
from torch.nn.utils.fusion import fuse_conv_bn_eval

Model = TypeVar("Model", bound=nn.Module)


def fold_batch_norms(model: Model) -> Model:
    """Return a copy in eval mode with folded batch norms: same outputs up to rounding, faster, not trainable.

    Only a convolution directly followed by a batch norm in a `Sequential` is folded.
    """
    copy = deepcopy(model).eval()
    for part in list(copy.modules()):
        if isinstance(part, nn.Sequential):
            _fold(part)
    return copy


def _fold(layers: nn.Sequential) -> None:
    for i in range(len(layers) - 1):
        conv, norm = layers[i], layers[i + 1]
        if isinstance(conv, nn.Conv2d) and isinstance(norm, nn.BatchNorm2d):
            layers[i], layers[i + 1] = fuse_conv_bn_eval(conv, norm), nn.Identity()
