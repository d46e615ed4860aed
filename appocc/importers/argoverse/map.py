"""The vector map of an Argoverse 2 log."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from appocc.checks import FloatArray
from appocc.errors import DataError
from appocc.files import read_json
from appocc.importers.maps import LogMap
from appocc.nuscenes.writer import Writer

_UNPAINTED = ("NONE", "UNKNOWN")
_CITY = re.compile(r"_{2,}([A-Z]{3})_city_")


def map_file(folder: Path) -> Path | None:
    """Return the file of the vector map of a log; None if there is none."""
    return next(iter(sorted(folder.glob("map/log_map_archive_*.json"))), None)


def city_of(folder: Path) -> str:
    """Return the three letters of the city of a log, in small letters; `unknown` if they are not told."""
    path = map_file(folder)
    found = None if path is None else _CITY.search(path.name)
    return "unknown" if found is None else found[1].lower()


def write_map(folder: Path, name: str, writer: Writer, log: str) -> None:
    """Write drivable areas, painted lane boundaries, crossings and junctions; nothing if the log has no map.

    Raises:
        DataError: if the file is damaged, or the map cannot be written.
    """
    path = map_file(folder)
    if path is None:
        return
    data = read_json(path)
    try:
        made = _log_map(data, name)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise DataError(f"{path}: expected a vector map of Argoverse 2 ({error!r})") from error
    if made is not None:
        made.write(writer, log)


def _log_map(data: Mapping[str, Any], name: str) -> LogMap | None:
    drivable = [_line(row["area_boundary"]) for row in data["drivable_areas"].values()]
    drivable = [outline for outline in drivable if len(outline) > 2]
    if not drivable:
        return None
    made = LogMap(name, [(outline, ()) for outline in drivable])
    lanes = data["lane_segments"].values()
    for layer, line in _markings(lanes):
        made.expansion.add_line(layer, line)
    for row in data["pedestrian_crossings"].values():
        made.expansion.add_area("ped_crossing", np.concatenate([_line(row["edge1"]), _line(row["edge2"])[::-1]]))
    sides = ((_line(row["left_lane_boundary"]), _line(row["right_lane_boundary"])) for row in _junction_lanes(lanes))
    for outline in made.merged([np.concatenate([left, right[::-1]]) for left, right in sides]):
        made.expansion.add_area("road_segment", outline, is_intersection=True)
    return made


def _junction_lanes(lanes: Any) -> list[Mapping[str, Any]]:
    return [row for row in lanes if row["is_intersection"] and row["lane_type"] != "BIKE"]


def _markings(lanes: Any) -> list[tuple[str, FloatArray]]:
    """Return layer and points (K, 2) of painted lane boundaries; neighbours share one, which is returned once."""
    found: dict[frozenset[tuple[float, ...]], tuple[str, FloatArray]] = {}
    for row in lanes:
        for side in ("left", "right"):
            paint, line = str(row[f"{side}_lane_mark_type"]), _line(row[f"{side}_lane_boundary"])
            if paint not in _UNPAINTED and len(line) > 1:
                layer = "road_divider" if "YELLOW" in paint else "lane_divider"
                found.setdefault(frozenset(map(tuple, line.tolist())), (layer, line))
    return list(found.values())


def _line(points: Any) -> FloatArray:
    """Return points (K, 2) of the city frame.

    Raises:
        ValueError: if one is not finite.
    """
    line = np.array([(float(point["x"]), float(point["y"])) for point in points]).reshape(-1, 2)
    if not np.isfinite(line).all():
        raise ValueError("a point is not finite")
    return line
