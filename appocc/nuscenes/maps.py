"""Maps of the nuScenes schema: drivable-area masks and vector maps (map expansion)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, UnidentifiedImageError

from appocc.checks import BoolArray, ByteArray, FloatArray
from appocc.errors import DataError
from appocc.files import inside, open_picture, read_json
from appocc.nuscenes.dataset import Dataset
from appocc.nuscenes.lyft import LYFT_MAP, LYFT_SOURCE, drivable_grey
from appocc.nuscenes.records import MapRecord, Scene

PX_PER_M = 10
_LINE_LAYERS, _STOP_LAYER = ("lane_divider", "road_divider"), "stop_line"
# Landmarks: kind, layer of polygons, and the field and value that a row needs, if any.
_LANDMARKS: tuple[tuple[str, str, tuple[str, object] | None], ...] = (
    ("crossing", "ped_crossing", None),
    ("stop line", _STOP_LAYER, None),
    ("traffic light", _STOP_LAYER, ("stop_line_type", "TRAFFIC_LIGHT")),
    ("stop sign", _STOP_LAYER, ("stop_line_type", "STOP_SIGN")),
    ("junction", "road_segment", ("is_intersection", True)),
    ("car park", "carpark_area", None),
)
# Outline (K, 2) and holes of a polygon.
Area = tuple[FloatArray, tuple[FloatArray, ...]]


@dataclass(frozen=True, eq=False)
class MaskWindow:
    """A crop of a mask: grey values (rows, columns), top row = largest y; world (x, y) of its lower left corner."""

    grey: ByteArray
    origin_m: tuple[float, float]
    unknown_value: int | None
    source: str

    def sample(self, xy_world_m: FloatArray) -> tuple[BoolArray, BoolArray]:
        """Return for world points (..., 2) whether each is drivable and whether that is known."""
        x, y = ((xy_world_m[..., axis] - self.origin_m[axis]) * PX_PER_M for axis in (0, 1))
        column, row = np.floor(x).astype(int), np.floor(self.grey.shape[0] - y).astype(int)
        known = (column >= 0) & (row >= 0) & (column < self.grey.shape[1]) & (row < self.grey.shape[0])
        value = self.grey[np.where(known, row, 0), np.where(known, column, 0)]
        if self.unknown_value is not None:
            known &= value != self.unknown_value
        return known & (value > 200), known


def mask_window(dataset: Dataset, scene: Scene, low_m: FloatArray, high_m: FloatArray) -> MaskWindow | None:
    """Return the mask of a scene between two world points (2,); None if there is no mask in this area.

    Raises:
        DataError: if the image is missing or damaged.
    """
    record = dataset.map_record(scene)
    return None if record is None else _window(inside(dataset.root, record.filename), record, low_m, high_m)


def _window(path: Path, record: MapRecord, low_m: FloatArray, high_m: FloatArray) -> MaskWindow | None:
    origin, source = np.array(record.origin_m), record.source
    try:
        with open_picture(path) as picture:
            coloured = picture.mode not in ("1", "L")
            if coloured and path.name != LYFT_MAP:
                return None  # a picture of the map, not a mask
            size = np.array(picture.size)
            low = np.clip(np.floor((low_m - origin) * PX_PER_M), 0, size).astype(int)
            high = np.clip(np.ceil((high_m - origin) * PX_PER_M), low, size).astype(int)
            area = (int(low[0]), int(size[1] - high[1]), int(high[0]), int(size[1] - low[1]))
            if area[0] >= area[2] or area[1] >= area[3]:
                return None
            if coloured:
                grey, source = drivable_grey(path, area), LYFT_SOURCE
            else:
                grey = np.asarray(picture.crop(area).convert("L"), dtype=np.uint8)
    except UnidentifiedImageError as error:
        raise DataError(f"{path}: not a readable map mask (no image)") from error
    except (OSError, Image.DecompressionBombError, SyntaxError) as error:
        reason = (error.strerror if isinstance(error, OSError) else None) or error
        raise DataError(f"{path}: not a readable map mask ({reason})") from error
    corner = origin + low / PX_PER_M
    return MaskWindow(grey, (float(corner[0]), float(corner[1])), record.unknown_value, source)


@dataclass(frozen=True, eq=False)
class VectorMap:
    """Polygons and lines of the map expansion, world frame, metres.

    Attributes:
        drivable: polygons as (outline (K, 2), holes) of drivable areas and car parks; None without such a layer.
        markings: polylines (K, 2) of lane dividers, road dividers and outlines of stop lines; None without such
            layers.
        landmarks: outlines (K, 2) of crossings, stop lines (those at traffic lights and stop signs also under these
            names), junctions and car parks, by kind; a kind without a layer is missing.
    """

    drivable: tuple[Area, ...] | None
    markings: tuple[FloatArray, ...] | None
    landmarks: Mapping[str, tuple[FloatArray, ...]] = field(default_factory=dict)

    def near(self, low_m: FloatArray, high_m: FloatArray) -> VectorMap:
        """Return the elements that overlap the rectangle between two world points (2,)."""

        def overlaps(points: FloatArray) -> bool:
            return bool((points.max(axis=0) >= low_m).all() and (points.min(axis=0) <= high_m).all())

        return VectorMap(
            None if self.drivable is None else tuple(area for area in self.drivable if overlaps(area[0])),
            None if self.markings is None else tuple(line for line in self.markings if overlaps(line)),
            {kind: tuple(one for one in found if overlaps(one)) for kind, found in self.landmarks.items()},
        )


def vector_map(dataset: Dataset, scene: Scene) -> VectorMap | None:
    """Return the map expansion of the location of a scene (maps/expansion/LOCATION.json); None if there is none.

    Raises:
        DataError: if the file is damaged.
    """
    location = dataset.location(scene)
    for name in (f"maps/expansion/{location}.json", f"maps/{location}.json"):
        if location and inside(dataset.root, name).is_file():
            return read_vector_map(dataset.root / name)
    return None


def read_vector_map(path: Path) -> VectorMap:
    """Read a map expansion file.

    Raises:
        DataError: if it is missing or damaged, refers to missing nodes, or has neither roads nor markings.
    """
    data = read_json(path)
    try:
        nodes = {node["token"]: (float(node["x"]), float(node["y"])) for node in data["node"]}
        lines = {line["token"]: _points(nodes, line["node_tokens"]) for line in data["line"]}
        polygons = {polygon["token"]: _polygon(nodes, polygon) for polygon in data["polygon"]}
        found = VectorMap(_drivable(data, polygons), _markings(data, lines, polygons), _landmarks(data, polygons))
    except (KeyError, TypeError, ValueError, OverflowError, AttributeError) as error:
        raise DataError(f"{path}: no map expansion ({error!r})") from error
    if found.drivable is None and found.markings is None:
        raise DataError(f"{path}: no map expansion (it has neither drivable_area nor a layer of line markings)")
    return found


def _drivable(data: dict[str, Any], polygons: dict[str, Area]) -> tuple[Area, ...] | None:
    if "drivable_area" not in data:
        return None
    tokens = [token for row in data["drivable_area"] for token in row["polygon_tokens"]]
    tokens += [row["polygon_token"] for row in data.get("carpark_area", [])]
    return tuple(polygons[token] for token in tokens if len(polygons[token][0]) >= 3)


def _markings(
    data: dict[str, Any], lines: dict[str, FloatArray], polygons: dict[str, Area]
) -> tuple[FloatArray, ...] | None:
    if not any(name in data for name in (*_LINE_LAYERS, _STOP_LAYER)):
        return None
    found = [lines[row["line_token"]] for name in _LINE_LAYERS for row in data.get(name, [])]
    stops = [polygons[row["polygon_token"]][0] for row in data.get(_STOP_LAYER, [])]
    found += [np.concatenate([outline, outline[:1]]) for outline in stops]
    return tuple(line for line in found if len(line) >= 2)


def _landmarks(data: dict[str, Any], polygons: dict[str, Area]) -> dict[str, tuple[FloatArray, ...]]:
    """Return the landmarks by kind; a kind is known if its layer is there, and its rows have the field."""
    found = {}
    for kind, layer, needed in _LANDMARKS:
        rows = data.get(layer)
        if rows is None or (needed and rows and not any(needed[0] in row for row in rows)):
            continue
        fits = [row for row in rows if needed is None or row.get(needed[0]) == needed[1]]
        outlines = [polygons[row["polygon_token"]][0] for row in fits]
        found[kind] = tuple(outline for outline in outlines if len(outline) > 2)
    return found


def _points(nodes: dict[str, tuple[float, float]], tokens: list[str]) -> FloatArray:
    """Return the positions (K, 2) of nodes.

    Raises:
        ValueError: if a position is not finite.
    """
    points = np.array([nodes[token] for token in tokens], dtype=np.float64).reshape(-1, 2)
    if not np.isfinite(points).all():
        raise ValueError("a node has no finite position")
    return points


def _polygon(nodes: dict[str, tuple[float, float]], row: dict[str, Any]) -> Area:
    holes = tuple(_points(nodes, hole["node_tokens"]) for hole in row.get("holes", []))
    return _points(nodes, row["exterior_node_tokens"]), tuple(hole for hole in holes if len(hole) >= 3)
