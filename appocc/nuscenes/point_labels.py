"""Semantic labels of LiDAR points: nuScenes-lidarseg, or a finer set of the recording's own beside it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from appocc.checks import BoolArray
from appocc.nuscenes.dataset import Dataset
from appocc.nuscenes.records import SampleData
from appocc.nuscenes.schema import LABEL_TABLES

# Label names that mean drivable road, and painted line markings (stop lines included), in lower case.
_ROAD = ("flat.driveable_surface", "road", "lane line marking", "stop line marking", "other road marking")
_LANE = ("lane line marking", "stop line marking")


@dataclass(frozen=True)
class PointLabels:
    """The label file of a sweep, and which labels mean road and lane.

    Attributes:
        path: file of one uint8 a point.
        is_road: (256,) which labels are road.
        is_lane: (256,) which labels are line markings, None where the set has no such class.
        source: name of the label set.
    """

    path: Path
    is_road: BoolArray
    is_lane: BoolArray | None
    source: str


def point_labels(dataset: Dataset, data: SampleData) -> PointLabels | None:
    """Labels of a LiDAR file, None where it has none that tell the road.

    Raises:
        DataError: if a table is damaged or a file name leads out of the root.
    """
    for table in LABEL_TABLES:
        path = dataset.label_path(data, table)
        if path is not None:
            names = dataset.label_names(table)
            road, lane = _flags(names, _ROAD), _flags(names, _LANE)
            if road.any():  # else the set cannot tell what is road: no source of it
                return PointLabels(path, road, lane if lane.any() else None, table)
    return None


def _flags(names: dict[int, str], wanted: tuple[str, ...]) -> BoolArray:
    flags = np.zeros(256, dtype=np.bool_)
    flags[[index for index, name in names.items() if name.lower() in wanted and 0 <= index < 256]] = True
    return flags
