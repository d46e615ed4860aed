"""Registry of the networks by name."""

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
from appocc.models.model_spec import ModelSpec, Parts
from appocc.models.neat import AttentionField
from appocc.models.network import AppoccNet
from appocc.models.paper import PaperNet

DEFAULT = "appocc"


def _paper(spec: ModelSpec, appearance: bool, num_classes: int, parts: Parts) -> BEVModel:
    return PaperNet(spec, appearance=appearance, num_classes=num_classes)


def _lss(spec: ModelSpec, appearance: bool, num_classes: int, parts: Parts) -> BEVModel:
    return LiftSplatShoot(spec)


def _neat(spec: ModelSpec, appearance: bool, num_classes: int, parts: Parts) -> BEVModel:
    return AttentionField(spec)


class Colouring(Protocol):
    """A method that colours a grid without learning or classes; see `ipm.ipm`."""

    def __call__(self, images: Tensor, rig: CameraRig, grid: BEVGrid) -> tuple[Tensor, Tensor]:
        """Return colours (3, X, Y) in 0..1 and where they are known (X, Y), from images (N, 3, H, W)."""
        ...


class Network(NamedTuple):
    """Registry entry of a network.

    Attributes:
        make: (spec, appearance, num_classes, parts) -> network with random weights.
        appearance: whether the network can predict appearance.
        parts: parts that the network can have.
    """

    make: Callable[[ModelSpec, bool, int, Parts], BEVModel]
    appearance: bool
    parts: Parts = Parts()


NETWORKS: Mapping[str, Network] = MappingProxyType(
    {
        "appocc": Network(AppoccNet, True, Parts(depth=True, memory=True, objects=True)),
        "paper": Network(_paper, True),
        "lss": Network(_lss, False),
        "neat": Network(_neat, False),
    }
)
# Separate from NETWORKS: they predict no occupancy, and zeros would be a prediction.
COLOURINGS: Mapping[str, Colouring] = MappingProxyType({"ipm": ipm})


def build(
    name: str, spec: ModelSpec, *, appearance: bool = True, num_classes: int = 0, parts: Parts | None = None
) -> BEVModel:
    """Build a network with random weights from torch's global generator.

    Args:
        name: one of NETWORKS.
        spec: cameras, grid and image size.
        appearance: predict appearance too; ignored by networks that predict occupancy only.
        num_classes: number of classes of the image heads for training; 0 for no image heads.
        parts: optional parts; None for none.

    Raises:
        NotFoundError: if there is no network of this name, or it cannot have one of the parts.
        ShapeError: if `num_classes` is negative.
    """
    if name not in NETWORKS:
        raise NotFoundError(f"no network '{name}'; there are {', '.join(NETWORKS)}")
    if num_classes < 0:
        raise ShapeError(f"num_classes: expected 0 or more classes, got {num_classes}")
    wanted, possible = parts or Parts(), NETWORKS[name].parts
    for part in wanted.names:
        if part not in possible.names:
            raise NotFoundError(f"network {name}: has no part '{part}'")
    return NETWORKS[name].make(spec, appearance, num_classes, wanted)
