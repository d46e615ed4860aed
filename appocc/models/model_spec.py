"""Model specification: cameras, grid and image size of a network."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

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


_FRONT = ("CAM_FRONT_LEFT", "CAM_FRONT", "CAM_FRONT_RIGHT")
_BACK = ("CAM_BACK_LEFT", "CAM_BACK", "CAM_BACK_RIGHT")
MODEL_SPECS: Mapping[str, ModelSpec] = MappingProxyType(
    {
        "360": ModelSpec("360", _FRONT + _BACK, BEVGrid.surround()),
        "180": ModelSpec("180", _FRONT, BEVGrid.front()),
    }
)
