"""Semantic labels of LiDAR points: nuScenes-lidarseg, or a finer set of the recording's own beside it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from appocc.checks import BoolArray
from appocc.errors import DataError
from appocc.files import inside, read_json
from appocc.nuscenes.dataset import Dataset
from appocc.nuscenes.records import SampleData

# Label names that mean drivable road, and painted line markings (stop lines included), in lower case.
_ROAD = ("flat.driveable_surface", "road", "lane line marking", "stop line marking", "other road marking")
_LANE = ("lane line marking", "stop line marking")
# The finer set comes first: nuScenes-lidarseg has no class for lane markings.
_LAYOUTS = (("pointlabels", "pointlabels_category"), ("lidarseg", "category"))


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
    for table, categories in _LAYOUTS:
        files = _files(dataset, table)
        if data.token in files:
            names = _names(dataset, categories)
            road, lane = _flags(names, _ROAD), _flags(names, _LANE)
            if road.any():  # else the set cannot tell what is road: no source of it
                return PointLabels(inside(dataset.root, files[data.token]), road, lane if lane.any() else None, table)
    return None


def _files(dataset: Dataset, table: str) -> dict[str, str]:
    """sample_data token -> file name of a label table; empty where there is no such table."""
    cache = dataset.__dict__.setdefault("_point_label_files", {})
    if table not in cache:
        path = dataset.tables.folder / f"{table}.json"
        try:
            rows = read_json(path) if path.is_file() else []
            cache[table] = {row["sample_data_token"]: str(row["filename"]) for row in rows}
        except (KeyError, TypeError) as error:
            raise DataError(f"{path}: expected rows with sample_data_token and filename ({error!r})") from error
    found: dict[str, str] = cache[table]
    return found


def _names(dataset: Dataset, table: str) -> dict[int, str]:
    """Label -> name of a category table whose rows have an index.

    Raises:
        DataError: if the table is missing or damaged.
    """
    path = dataset.tables.folder / f"{table}.json"
    rows = read_json(path)
    try:
        return {int(row["index"]): str(row["name"]) for row in rows if row.get("index") is not None}
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise DataError(f"{path}: expected rows with index and name ({error!r})") from error


def _flags(names: dict[int, str], wanted: tuple[str, ...]) -> BoolArray:
    flags = np.zeros(256, dtype=np.bool_)
    flags[[index for index, name in names.items() if name.lower() in wanted and 0 <= index < 256]] = True
    return flags
