"""Results of the paper (section V) for comparison; IoU 0..1 in the order road, vehicle, lane.

Sharma et al., "Estimation of Appearance and Occupancy Information in Bird's Eye View from Surround Monocular
Images". Its CARLA recordings are not public and its test scenes are from the training towns: differences between its
rows are comparable with ours, absolute values are not.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple


class PaperRow(NamedTuple):
    """Row of table I or II.

    Attributes:
        name: name of the method.
        iou: road, vehicle, lane; None where the paper has no figure.
    """

    name: str
    iou: tuple[float | None, float | None, float | None]


_NEAT = PaperRow("NEAT", (0.581, 0.763, None))
# The paper's "occupancy" rows of its ablation (table III) are its Lift-Splat-Shoot rows, digit for digit.
TABLES: Mapping[str, tuple[PaperRow, ...]] = MappingProxyType(
    {
        "360": (
            PaperRow("Lift-Splat-Shoot", (0.834, 0.3767, 0.1129)),
            PaperRow("the paper's own network", (0.8677, 0.3899, 0.1805)),
        ),
        "180": (
            _NEAT,
            PaperRow("Lift-Splat-Shoot", (0.6353, 0.2857, 0.1227)),
            PaperRow("the paper's own network", (0.6848, 0.3249, 0.1723)),
        ),
    }
)
# Gain of IoU from appearance, from the text of the paper.
DIFFERENCES: Mapping[str, tuple[float, float, float]] = MappingProxyType(
    {"360": (0.0337, 0.0132, 0.0676), "180": (0.0495, 0.0392, 0.0496)}
)
# Mean absolute colour error, 0..255; the paper does not specify the cells.
APPEARANCE_L1: Mapping[str, float] = MappingProxyType({"360": 3.046, "180": 2.89})
