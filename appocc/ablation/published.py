"""The figures of the paper (section V), to stand beside ours; IoU as shares, in the order road, vehicle, lane.

Sharma et al., "Estimation of Appearance and Occupancy Information in Bird's Eye View from Surround Monocular
Images". Measured on CARLA recordings that are not public, with test scenes from the towns of training: the
differences between its rows can be compared with ours, the levels cannot.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple


class Published(NamedTuple):
    """A row of table I or II.

    Attributes:
        name: of the method.
        iou: road, vehicle, lane; None where the paper has no figure.
    """

    name: str
    iou: tuple[float | None, float | None, float | None]


_NEAT = Published("NEAT", (0.581, 0.763, None))
# The paper's "occupancy" rows of its ablation (table III) are its Lift-Splat-Shoot rows, digit for digit.
TABLES: Mapping[str, tuple[Published, ...]] = MappingProxyType(
    {
        "360": (
            Published("Lift-Splat-Shoot", (0.834, 0.3767, 0.1129)),
            Published("the paper's own network", (0.8677, 0.3899, 0.1805)),
        ),
        "180": (
            _NEAT,
            Published("Lift-Splat-Shoot", (0.6353, 0.2857, 0.1227)),
            Published("the paper's own network", (0.6848, 0.3249, 0.1723)),
        ),
    }
)
# What appearance added to occupancy, as the paper's text says.
DIFFERENCES: Mapping[str, tuple[float, float, float]] = MappingProxyType(
    {"360": (0.0337, 0.0132, 0.0676), "180": (0.0495, 0.0392, 0.0496)}
)
# Mean absolute error of colours, 0..255; the paper does not say over which cells.
APPEARANCE_L1: Mapping[str, float] = MappingProxyType({"360": 3.046, "180": 2.89})
