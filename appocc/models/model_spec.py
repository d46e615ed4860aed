"""Model specification: cameras, grid and image size of a network."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from types import MappingProxyType

from appocc.errors import NotFoundError
from appocc.grid import BEVGrid


@dataclass(frozen=True)
class ModelSpec:
    """Cameras, grid and image size of a network: one of the paper's two settings (section V), or a custom one.

    Attributes:
        name: name on the command line.
        channels: cameras that are used, in the order of the images.
        grid: predicted cells, ego frame.
        width_px: width of the input images.
        height_px: height of the input images.
    """

    name: str
    channels: tuple[str, ...]
    grid: BEVGrid
    width_px: int = 352
    height_px: int = 128


@dataclass(frozen=True)
class Parts:
    """Optional parts of the network `appocc`.

    Attributes:
        depth: predicted depths weight what a cell reads from the images.
        memory: features of earlier frames are fused with those of the present one.
        objects: heads for boxes of vehicles, cyclists and pedestrians.
    """

    depth: bool = False
    memory: bool = False
    objects: bool = False

    @classmethod
    def of(cls, names: Sequence[str]) -> Parts:
        """Return the parts with these names.

        Raises:
            NotFoundError: if there is no part of a name.
        """
        known = tuple(field.name for field in fields(cls))
        for name in names:
            if name not in known:
                raise NotFoundError(f"no part '{name}' of a network; there are {', '.join(known)}")
        return cls(**dict.fromkeys(names, True))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parts that are present."""
        return tuple(field.name for field in fields(self) if getattr(self, field.name))


_FRONT = ("CAM_FRONT_LEFT", "CAM_FRONT", "CAM_FRONT_RIGHT")
_BACK = ("CAM_BACK_LEFT", "CAM_BACK", "CAM_BACK_RIGHT")
MODEL_SPECS: Mapping[str, ModelSpec] = MappingProxyType(
    {
        "360": ModelSpec("360", _FRONT + _BACK, BEVGrid.surround()),
        "180": ModelSpec("180", _FRONT, BEVGrid.front()),
    }
)
