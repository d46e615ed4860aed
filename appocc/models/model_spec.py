"""What a network sees and what it answers: which cameras, which grid, which size of picture."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from appocc.grid import BEVGrid


@dataclass(frozen=True)
class Setting:
    """One of the paper's two settings (section V), or one's own.

    Attributes:
        name: as on the command line.
        channels: cameras that are used, in the order of the pictures.
        grid: cells that are answered, ego frame.
        width_px: of the pictures that the network is given.
        height_px: of them.
    """

    name: str
    channels: tuple[str, ...]
    grid: BEVGrid
    width_px: int = 352
    height_px: int = 128


_FRONT = ("CAM_FRONT_LEFT", "CAM_FRONT", "CAM_FRONT_RIGHT")
_BACK = ("CAM_BACK_LEFT", "CAM_BACK", "CAM_BACK_RIGHT")
SETTINGS: Mapping[str, Setting] = MappingProxyType(
    {
        "360": Setting("360", _FRONT + _BACK, BEVGrid.surround()),
        "180": Setting("180", _FRONT, BEVGrid.front()),
    }
)
