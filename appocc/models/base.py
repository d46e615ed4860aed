"""What every network takes and gives."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import NamedTuple, Protocol, Self

import torch
from torch import Tensor, nn

from appocc.camera import CameraRig
from appocc.models.model_spec import Setting

# Depth bins of the paper (section III): centres 4.5 .. 44.5 m.
DEPTH_BINS = 41
FIRST_DEPTH_M, DEPTH_STEP_M = 4.5, 1.0


class Plan(Protocol):
    """Where features of pictures go in the grid, for the rigs of a batch; made once for a rig, kept as long as it is.

    Attributes:
        seen: (B, X, Y) bool, cells that a camera of the rig can see.
    """

    @property
    def seen(self) -> Tensor:
        """(B, X, Y) bool."""
        ...

    def to(self, device: torch.device) -> Self:
        """The same on a device."""
        ...

    def for_export(self) -> Self:
        """The plan with which a network uses only operations that exporters translate rightly; slower."""
        ...


class ViewOutput(NamedTuple):
    """What is said of the pictures themselves, for auxiliary losses; None where a network does not.

    Attributes:
        depth: (B, N, DEPTH_BINS, h, w) logits of the depth at each place of the features.
        kind: (B, N, K, h, w) logits of `ViewClass`.
    """

    depth: Tensor | None
    kind: Tensor | None


class Output(NamedTuple):
    """What a network answers.

    Attributes:
        occupancy: (B, 3, X, Y) logits of road, vehicle, lane.
        appearance: (B, 3, X, Y) sRGB, 0..1; None of a network for occupancy alone.
        views: auxiliary answers; None outside training.
    """

    occupancy: Tensor
    appearance: Tensor | None
    views: ViewOutput | None


class BEVModel(nn.Module, ABC):
    """A network from the pictures of rigs to a grid.

    Pictures are (B, N, 3, H, W) sRGB, 0..1, of the size of the setting, one per camera of a rig in its order; rigs of
    a batch may have fewer than N cameras, the rest of their pictures is not looked at. A dead camera is left out of
    the rig.
    """

    setting: Setting

    @abstractmethod
    def plan(self, rigs: Sequence[CameraRig]) -> Plan:
        """The plan of a batch; each rig's cameras are those of the pictures as the network is given them."""

    @abstractmethod
    def forward(self, images: Tensor, plan: Plan) -> Output:
        """Answer a batch (images: see the class)."""
