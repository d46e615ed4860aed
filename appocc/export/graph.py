"""A network and one rig as a single function from pictures to probabilities: what exporters are given."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from appocc.camera import CameraRig
from appocc.models.base import BEVModel, Plan
from appocc.models.fused import fused
from appocc.models.lss import LiftSplatShoot, SplatModel
from appocc.models.network import NetworkPlan
from appocc.models.paper import PaperNet
from appocc.models.splat import SplatPlan, pool

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
        self.model = fused(model)
        plan = model.plan([rig])
        self.plan: Plan = plan.for_export() if isinstance(plan, NetworkPlan) else plan
        self.seen = plan.seen[0]
        self.eval()

    def forward(self, images: Tensor) -> dict[str, Tensor]:
        """Probabilities (1, 3, X, Y), and colours (1, 3, X, Y) 0..1 of a network that has them."""
        if isinstance(self.model, SplatModel) and isinstance(self.plan, SplatPlan):
            occupancy, appearance = _splatted(self.model, images[0], self.plan)
        else:
            occupancy, appearance, _ = self.model(images, self.plan)
        return answers(occupancy, appearance)


def answers(occupancy: Tensor, appearance: Tensor | None) -> dict[str, Tensor]:
    """What an exported network answers, by name, from logits and colours."""
    told = {OCCUPANCY: torch.sigmoid(occupancy.float())}
    return told if appearance is None else {**told, APPEARANCE: appearance.float()}


def _splatted(model: SplatModel, pictures: Tensor, plan: SplatPlan) -> tuple[Tensor, Tensor | None]:
    """As the model's own forward, but pooled by operations that exporters translate rightly."""
    lifted = model.lift(model.look(pictures))
    grid = pool(lifted.context, lifted.depth.softmax(dim=1), plan, export=True)
    if isinstance(model, PaperNet):
        return model.occupancy(grid), None if model.appearance is None else torch.sigmoid(model.appearance(grid))
    if isinstance(model, LiftSplatShoot):
        return model.trunk(grid), None
    raise TypeError(f"no way to export {type(model).__name__}")
