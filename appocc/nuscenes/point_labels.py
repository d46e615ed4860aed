"""Semantic labels of LiDAR points: nuScenes-lidarseg or a finer label set of the recording."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from appocc.checks import BoolArray
from appocc.nuscenes.dataset import Dataset
from appocc.nuscenes.records import SampleData
from appocc.nuscenes.schema import LABEL_TABLES

# Lower-case names of labels of drivable road, and of painted lane markings including stop lines.
_ROAD = ("flat.driveable_surface", "road", "lane line marking", "stop line marking", "other road marking")
_LANE = ("lane line marking", "stop line marking")


@dataclass(frozen=True, eq=False)
class PointLabels:
    """Label file of a sweep with the meaning of its labels.

    Attributes:
        path: file with one uint8 per point.
        is_road: (256,) whether a label is road.
        is_lane: (256,) whether a label is lane marking; None if the label set has no such class.
        source: name of the label set.
    """

    path: Path
    is_road: BoolArray
    is_lane: BoolArray | None
    source: str


def point_labels(dataset: Dataset, data: SampleData) -> PointLabels | None:
    """Return the labels of a LiDAR file; None if it has no labels with a road class.

    Raises:
        DataError: if a table is damaged or a file name leads out of the root.
    """
    for table in LABEL_TABLES:
        path = dataset.label_path(data, table)
        if path is not None:
            names = dataset.label_names(table)
            road, lane = _flags(names, _ROAD), _flags(names, _LANE)
            if road.any():  # a label set without a road class is not a source
                return PointLabels(path, road, lane if lane.any() else None, table)
    return None


def _flags(names: dict[int, str], wanted: tuple[str, ...]) -> BoolArray:
    flags = np.zeros(256, dtype=np.bool_)
    flags[[index for index, name in names.items() if name.lower() in wanted and 0 <= index < 256]] = True
    return flags
