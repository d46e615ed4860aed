"""The paper's network: two trunks over one splatted grid, for occupancy and for appearance.

Section III of the paper: EfficientNet-B0 to stride 16, 64 channels of context and a distribution over 41 depths,
splatted into the grid; then for each output the first three stages of ResNet-18 and two upsampling layers.
"""

from __future__ import annotations

import torch
from torch import Tensor

from appocc.bevmap import CLASSES
from appocc.errors import ShapeError
from appocc.models.base import ModelOutput, ViewTransformPlan
from appocc.models.efficientnet import EfficientNetB0
from appocc.models.lss import CONTEXT_CHANNELS, STRIDE, Lift, SplatModel
from appocc.models.memory import Past
from appocc.models.model_spec import ModelSpec
from appocc.models.resnet import BEVTrunk

_COLOURS = 3


class PaperNet(SplatModel):
    """The paper's network; without appearance it is the one-trunk network of the paper's ablation."""

    def __init__(
        self, spec: ModelSpec, encoder: EfficientNetB0 | None = None, appearance: bool = True, num_classes: int = 0
    ) -> None:
        """Build the network with random weights.

        Args:
            spec: cameras, grid and image size.
            encoder: image encoder that ends at stride 16; None: a new one.
            appearance: predict appearance too.
            num_classes: number of classes of the auxiliary image head; 0 for none, as in the paper.

        Raises:
            ShapeError: if the encoder does not end at stride 16.
        """
        super().__init__(spec)
        self.encoder = EfficientNetB0(STRIDE) if encoder is None else encoder
        if max(self.encoder.channels) != STRIDE:
            raise ShapeError(f"encoder: expected one cut at stride {STRIDE}, got {max(self.encoder.channels)}")
        self.lift = Lift(self.encoder.channels[STRIDE], CONTEXT_CHANNELS, num_classes)
        self.occupancy = BEVTrunk(CONTEXT_CHANNELS, len(CLASSES))
        self.appearance = BEVTrunk(CONTEXT_CHANNELS, _COLOURS) if appearance else None

    def encode(self, images: Tensor) -> Tensor:
        """Return features (V, 112, h, w) at stride 16 of images (V, 3, H, W)."""
        features: Tensor = self.encoder(images)[STRIDE]
        return features

    def forward(self, images: Tensor, plan: ViewTransformPlan, past: Past | None = None) -> ModelOutput:
        """Predict occupancy and appearance; a sigmoid keeps colours in 0..1."""
        grid, views = self.lift_and_splat(images, plan)
        colours = None if self.appearance is None else torch.sigmoid(self.appearance(grid))
        return ModelOutput(self.occupancy(grid), colours, views)
