"""The networks by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import NamedTuple, Protocol

from torch import Tensor

from appocc.camera import CameraRig
from appocc.errors import NotFoundError, ShapeError
from appocc.grid import BEVGrid
from appocc.models.base import BEVModel
from appocc.models.ipm import ipm
from appocc.models.lss import LiftSplatShoot
from appocc.models.model_spec import Setting
from appocc.models.neat import AttentionField
from appocc.models.network import AppoccNet
from appocc.models.paper import PaperNet

DEFAULT = "appocc"


def _paper(setting: Setting, appearance: bool, kinds: int) -> BEVModel:
    return PaperNet(setting, appearance=appearance, kinds=kinds)


def _lss(setting: Setting, appearance: bool, kinds: int) -> BEVModel:
    return LiftSplatShoot(setting)


def _neat(setting: Setting, appearance: bool, kinds: int) -> BEVModel:
    return AttentionField(setting)


class Colouring(Protocol):
    """A way to colour a grid that learns nothing and knows no classes; see `ipm.ipm`."""

    def __call__(self, images: Tensor, rig: CameraRig, grid: BEVGrid) -> tuple[Tensor, Tensor]:
        """Images (N, 3, H, W) -> colours (3, X, Y), 0..1, and where they are known (X, Y)."""
        ...


class Network(NamedTuple):
    """How a network is made.

    Attributes:
        make: (setting, appearance, kinds) -> network with fresh weights.
        appearance: whether it can answer colours.
    """

    make: Callable[[Setting, bool, int], BEVModel]
    appearance: bool


NETWORKS: Mapping[str, Network] = MappingProxyType(
    {
        "appocc": Network(AppoccNet, True),
        "paper": Network(_paper, True),
        "lss": Network(_lss, False),
        "neat": Network(_neat, False),
    }
)
# Kept apart: it has no occupancy to answer, and zeros would be a claim.
COLOURINGS: Mapping[str, Colouring] = MappingProxyType({"ipm": ipm})


def build(name: str, setting: Setting, *, appearance: bool = True, kinds: int = 0) -> BEVModel:
    """A network with fresh weights, from torch's own random numbers.

    Args:
        name: one of NETWORKS.
        setting: what it sees and answers.
        appearance: answer colours as well; networks for occupancy alone never do.
        kinds: number of classes of the view heads, for training; 0 leaves these heads out.

    Raises:
        NotFoundError: if there is no network of this name.
        ShapeError: if `kinds` is negative.
    """
    if name not in NETWORKS:
        raise NotFoundError(f"no network '{name}'; there are {', '.join(NETWORKS)}")
    if kinds < 0:
        raise ShapeError(f"kinds: expected 0 or more classes, got {kinds}")
    return NETWORKS[name].make(setting, appearance, kinds)
