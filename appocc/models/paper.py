"""The paper's own network: two trunks over one splatted grid, one for occupancy and one for appearance.

paper.tex, section III: EfficientNet-B0 to 1/16, 64 channels of context and a distribution over 41 depths, summed into
the grid; then for either answer the first three stages of ResNet-18 and two up-sampling layers.
"""

from __future__ import annotations

import torch
from torch import Tensor

from appocc.bevmap import CLASSES
from appocc.errors import ShapeError
from appocc.models.base import Output, Plan
from appocc.models.efficientnet import EfficientNetB0
from appocc.models.lss import CONTEXT_CHANNELS, STRIDE, Lift, SplatModel
from appocc.models.model_spec import Setting
from appocc.models.resnet import BEVTrunk

_COLOURS = 3


class PaperNet(SplatModel):
    """The paper's network; without appearance it is the paper's ablation, one trunk."""

    def __init__(
        self, setting: Setting, encoder: EfficientNetB0 | None = None, appearance: bool = True, kinds: int = 0
    ) -> None:
        """Make it with fresh weights.

        Args:
            setting: cameras, grid, size of the pictures.
            encoder: cut at stride 16; a fresh one if there is none.
            appearance: whether it answers that.
            kinds: classes of the pictures' own auxiliary answer; 0 for none, as in the paper.

        Raises:
            ShapeError: if the encoder is not cut at stride 16.
        """
        super().__init__(setting)
        self.encoder = EfficientNetB0(STRIDE) if encoder is None else encoder
        if max(self.encoder.channels) != STRIDE:
            raise ShapeError(f"encoder: expected one cut at stride {STRIDE}, got {max(self.encoder.channels)}")
        self.lift = Lift(self.encoder.channels[STRIDE], CONTEXT_CHANNELS, kinds)
        self.occupancy = BEVTrunk(CONTEXT_CHANNELS, len(CLASSES))
        self.appearance = BEVTrunk(CONTEXT_CHANNELS, _COLOURS) if appearance else None

    def look(self, pictures: Tensor) -> Tensor:
        """Features (V, 112, h, w) at stride 16 of pictures (V, 3, H, W)."""
        features: Tensor = self.encoder(pictures)[STRIDE]
        return features

    def forward(self, images: Tensor, plan: Plan) -> Output:
        """Answer a batch; colours pass a sigmoid, so that they are colours."""
        grid, views = self.splatted(images, plan)
        colours = None if self.appearance is None else torch.sigmoid(self.appearance(grid))
        return Output(self.occupancy(grid), colours, views)
