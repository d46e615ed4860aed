"""Export graph: a network and one rig as a single function from images to probabilities."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from appocc.camera import CameraRig
from appocc.models.base import BEVModel
from appocc.models.batch_norm_folding import fold_batch_norms

INPUT = "images"
OCCUPANCY, APPEARANCE, SEEN = "occupancy", "appearance", "seen"


class ExportGraph(nn.Module):
    """Outputs by name of images (1, N, 3, H, W) of a rig; everything that depends on the rig is a constant.

    Batch norms are folded, and only operations are used that every runtime supports.
    """

    def __init__(self, model: BEVModel, rig: CameraRig) -> None:
        """Copy a network and plan it for a rig, with the cameras after `fit_camera`.

        Raises:
            ShapeError: if the image size of a camera differs from the model spec.
        """
        super().__init__()
        self.model = fold_batch_norms(model)
        self.plan = model.plan([rig]).for_export()
        self.seen = self.plan.seen[0]
        self.eval()

    def forward(self, images: Tensor) -> dict[str, Tensor]:
        """Return probabilities (1, 3, X, Y), and colours (1, 3, X, Y) 0..1 if the network predicts appearance."""
        occupancy, appearance, _ = self.model(images, self.plan)
        return named_outputs(occupancy, appearance)


def named_outputs(occupancy: Tensor, appearance: Tensor | None) -> dict[str, Tensor]:
    """Return the outputs of an exported network by name, from logits and colours."""
    outputs = {OCCUPANCY: torch.sigmoid(occupancy.float())}
    return outputs if appearance is None else {**outputs, APPEARANCE: appearance.float()}
