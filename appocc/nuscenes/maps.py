"""Maps of the nuScenes schema: the drivable-area mask, and the vector map of the map expansion."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, UnidentifiedImageError

from appocc.checks import BoolArray, ByteArray, FloatArray
from appocc.errors import DataError
from appocc.files import inside, read_json
from appocc.nuscenes.dataset import Dataset
from appocc.nuscenes.records import MapRecord, Scene

PX_PER_M = 10
# nuScenes' largest mask has 1.2 billion pixels; Pillow's own limit guards against far smaller pictures.
_MOST_PIXELS = 4_000_000_000


@dataclass(frozen=True)
class MaskWindow:
    """A cut-out of a mask: grey values (rows, columns), top row = largest y; its lower left corner (x, y)."""

    grey: ByteArray
    origin_m: tuple[float, float]
    unknown_value: int | None
    source: str

    def sample(self, xy_world_m: FloatArray) -> tuple[BoolArray, BoolArray]:
        """For points (..., 2) in the world: whether each is drivable, and whether that is known."""
        x, y = ((xy_world_m[..., axis] - self.origin_m[axis]) * PX_PER_M for axis in (0, 1))
        column, row = np.floor(x).astype(int), np.floor(self.grey.shape[0] - y).astype(int)
        known = (column >= 0) & (row >= 0) & (column < self.grey.shape[1]) & (row < self.grey.shape[0])
        value = self.grey[np.where(known, row, 0), np.where(known, column, 0)]
        if self.unknown_value is not None:
            known &= value != self.unknown_value
        return known & (value > 200), known


def mask_window(dataset: Dataset, scene: Scene, low_m: FloatArray, high_m: FloatArray) -> MaskWindow | None:
    """The mask of a scene between two world points (2,), None where the scene has no mask.

    Raises:
        DataError: if the picture is missing or damaged.
    """
    record = dataset.map_record(scene)
    return None if record is None else _window(inside(dataset.root, record.filename), record, low_m, high_m)


def _window(path: Path, record: MapRecord, low_m: FloatArray, high_m: FloatArray) -> MaskWindow:
    Image.MAX_IMAGE_PIXELS = _MOST_PIXELS
    origin = np.array(record.origin_m)
    try:
        with Image.open(path) as picture:
            size = np.array(picture.size)
            low = np.clip(np.floor((low_m - origin) * PX_PER_M), 0, size).astype(int)
            high = np.clip(np.ceil((high_m - origin) * PX_PER_M), low, size).astype(int)
            area = (int(low[0]), int(size[1] - high[1]), int(high[0]), int(size[1] - low[1]))
            grey = np.asarray(picture.crop(area).convert("L"), dtype=np.uint8)
    except (OSError, UnidentifiedImageError, Image.DecompressionBombError, SyntaxError) as error:
        raise DataError(f"{path}: not a readable map mask ({error})") from error
    corner = origin + low / PX_PER_M
    if not grey.size:
        grey = np.full((1, 1), 0, np.uint8)
    return MaskWindow(grey, (float(corner[0]), float(corner[1])), record.unknown_value, record.source)


@dataclass(frozen=True)
class VectorMap:
    """Polygons and lines of the map expansion, world frame, metres.

    Attributes:
        drivable: polygons as (outline (K, 2), holes); drivable areas and car parks.
        markings: polylines (K, 2): lane dividers, road dividers, outlines of stop lines.
    """

    drivable: tuple[tuple[FloatArray, tuple[FloatArray, ...]], ...]
    markings: tuple[FloatArray, ...]

    def near(self, low_m: FloatArray, high_m: FloatArray) -> VectorMap:
        """Only what overlaps the rectangle between two world points (2,)."""

        def overlaps(points: FloatArray) -> bool:
            return bool((points.max(axis=0) >= low_m).all() and (points.min(axis=0) <= high_m).all())

        return VectorMap(
            tuple(area for area in self.drivable if overlaps(area[0])),
            tuple(line for line in self.markings if overlaps(line)),
        )


def vector_map(dataset: Dataset, scene: Scene) -> VectorMap | None:
    """The map expansion of a scene's location (maps/expansion/LOCATION.json), None where there is none.

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
        DataError: if it is missing, damaged or refers to nodes that it lacks.
    """
    data = read_json(path)
    try:
        nodes = {node["token"]: (float(node["x"]), float(node["y"])) for node in data["node"]}
        lines = {line["token"]: _points(nodes, line["node_tokens"]) for line in data["line"]}
        polygons = {polygon["token"]: _polygon(nodes, polygon) for polygon in data["polygon"]}
        areas = [token for row in data["drivable_area"] for token in row["polygon_tokens"]]
        areas += [row["polygon_token"] for row in data.get("carpark_area", [])]
        markings = [
            lines[row["line_token"]] for name in ("lane_divider", "road_divider") for row in data.get(name, [])
        ]
        stops = [polygons[row["polygon_token"]][0] for row in data.get("stop_line", [])]
        closed = [np.concatenate([outline, outline[:1]]) for outline in stops if len(outline)]
        drivable = [polygons[token] for token in areas if len(polygons[token][0]) >= 3]
        return VectorMap(tuple(drivable), tuple(line for line in [*markings, *closed] if len(line) >= 2))
    except (KeyError, TypeError, ValueError) as error:
        raise DataError(f"{path}: no map expansion ({error!r})") from error


def _points(nodes: dict[str, tuple[float, float]], tokens: list[str]) -> FloatArray:
    return np.array([nodes[token] for token in tokens], dtype=np.float64).reshape(-1, 2)


def _polygon(nodes: dict[str, tuple[float, float]], row: dict[str, Any]) -> tuple[FloatArray, tuple[FloatArray, ...]]:
    holes = tuple(_points(nodes, hole["node_tokens"]) for hole in row.get("holes", []))
    return _points(nodes, row["exterior_node_tokens"]), tuple(hole for hole in holes if len(hole) >= 3)
