"""A network and one rig as a single function from pictures to probabilities: what exporters are given."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from appocc.camera import CameraRig
from appocc.models.base import BEVModel
from appocc.models.batch_norm_folding import fold_batch_norms

INPUT = "images"
OCCUPANCY, APPEARANCE, SEEN = "occupancy", "appearance", "seen"


class Graph(nn.Module):
    """Pictures (1, N, 3, H, W) of a rig -> its answers by name; all that depends on the rig is a constant.

    Batch norms are folded, and only operations are used that every runtime computes right.
    """

    def __init__(self, model: BEVModel, rig: CameraRig) -> None:
        """Take a network, which is copied, and the cameras of its pictures, as `fitted` makes them.

        Raises:
            ShapeError: if a camera's picture has not the size of the setting.
        """
        super().__init__()
        self.model = fold_batch_norms(model)
        self.plan = model.plan([rig]).for_export()
        self.seen = self.plan.seen[0]
        self.eval()

    def forward(self, images: Tensor) -> dict[str, Tensor]:
        """Probabilities (1, 3, X, Y), and colours (1, 3, X, Y) 0..1 of a network that has them."""
        occupancy, appearance, _ = self.model(images, self.plan)
        return answers(occupancy, appearance)


def answers(occupancy: Tensor, appearance: Tensor | None) -> dict[str, Tensor]:
    """What an exported network answers, by name, from logits and colours."""
    told = {OCCUPANCY: torch.sigmoid(occupancy.float())}
    return told if appearance is None else {**told, APPEARANCE: appearance.float()}
