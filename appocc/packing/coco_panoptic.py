"""COCO panoptic files of maps: PNG files of segment ids and one JSON file, as panopticapi reads them.

Format: https://cocodataset.org/#format-data, panoptic segmentation. The id of a pixel is R + 256 G + 256^2 B; 0 is
void.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from scipy import ndimage

from appocc.bevmap import LANE, ROAD, VEHICLE, BEVMap
from appocc.checks import BoolArray, IntArray
from appocc.errors import DataError
from appocc.files import read_file, read_json, write_image, write_json, zip_arrays
from appocc.nuscenes.assembly import Assembly
from appocc.packing.frames import KeyFrame, PackedFrame, PackSource
from appocc.rasterise import vehicle_owner
from appocc.visualization.canvas import CLASS_COLOURS, shown_appearance, to_image_axes
from appocc.workers import Engine, in_order

FORMAT = "coco-panoptic"
SETTINGS_FILE = ".pack.json"
_IMAGES, _PANOPTIC, _JSON, _PART = "images", "panoptic", "panoptic.json", ".annotations.json"
# Stuff has the id of its category as the id of its segment; those of vehicles begin after these.
_ROAD, _VEHICLE, _LANE, _OTHER = 1, 2, 3, 4
_FIRST_VEHICLE = 256
CATEGORIES = [
    {"id": _ROAD, "name": "road", "supercategory": "ground", "isthing": 0, "color": list(CLASS_COLOURS[ROAD])},
    {
        "id": _VEHICLE,
        "name": "vehicle",
        "supercategory": "object",
        "isthing": 1,
        "color": list(CLASS_COLOURS[VEHICLE]),
    },
    {"id": _LANE, "name": "lane", "supercategory": "ground", "isthing": 0, "color": list(CLASS_COLOURS[LANE])},
    {"id": _OTHER, "name": "other", "supercategory": "other", "isthing": 0, "color": [90, 90, 90]},
]


@dataclass(frozen=True, eq=False)
class _SceneWriter:
    """The job of a worker: write the files of a scene; return its number of key frames."""

    assembly: Assembly

    def __call__(self, frames: Sequence[PackedFrame]) -> int:
        def write(folder: Path) -> None:
            parts = [_write_frame(folder, frame) for frame in frames]
            write_json(folder / _PART, parts, indent=None)

        self.assembly.write_files(frames[0].scene, write)
        return len(frames)


def pack_panoptic(
    source: PackSource,
    key_frames: Sequence[KeyFrame],
    out: Path,
    pool: Engine | None,
    advance: Callable[[float], None],
) -> Path:
    """Write the maps of a source as COCO panoptic segmentation, and return the path of the JSON file.

    `images/SCENE-0000.png` shows the colours of a map, `panoptic/SCENE-0000.png` has its segments, in image axes
    (forward up, left to the left). Finished scenes are kept when it is interrupted, and the same call resumes.

    Args:
        source: dataset and maps.
        key_frames: all key frames of the source.
        out: new folder, `resolved`; or one of the same pack, which is kept.
        pool: where the scenes are written; the result does not depend on it.
        advance: progress callback in key frames.

    Raises:
        DataError: if a map is missing or damaged, or `out` holds something else or cannot be written.
    """
    assembly = Assembly(out, "", SETTINGS_FILE, {"format": FORMAT, **source.as_json(key_frames)}, "pack")
    if not assembly.is_finished():
        with assembly.opened():
            scenes = Counter(each.scene.name for each in key_frames)
            advance(sum(count for name, count in scenes.items() if assembly.has(name)))
            for count in in_order(pool, _SceneWriter(assembly), _missing_scenes(source, key_frames, assembly)):
                advance(count)
            shared = assembly.work / "shared"
            parts = [part for scene in scenes for part in read_json(assembly.place(scene) / _PART)]
            write_json(shared / _JSON, _merged(parts), indent=None)
            assembly.finish(list(scenes), shared)
    return out / _JSON


def _missing_scenes(
    source: PackSource, key_frames: Sequence[KeyFrame], assembly: Assembly
) -> Iterator[list[PackedFrame]]:
    for name, members in groupby(key_frames, key=lambda each: each.scene.name):
        if not assembly.has(name):
            yield [source.frame(each) for each in members]


def _merged(parts: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return the contents of the JSON file; images are numbered from 1."""
    images, annotations = [], []
    for number, part in enumerate(parts, start=1):
        images.append({"id": number, **part["image"]})
        annotations.append({"image_id": number, **part["annotation"]})
    info = {"description": "bird's-eye-view maps of appocc: forward up, left to the left", "version": "1.0"}
    return {
        "info": info,
        "licenses": [],
        "images": images,
        "annotations": annotations,
        "categories": CATEGORIES,
    }


def _write_frame(folder: Path, frame: PackedFrame) -> dict[str, Any]:
    """Write both pictures of a map; return its entries of the JSON file."""
    bev = BEVMap.load(frame.bev)
    ids, names = panoptic_ids(bev, *_instances(frame, bev))
    pixels = to_image_axes(np.stack([ids >> shift & 255 for shift in (0, 8, 16)], axis=-1).astype(np.uint8))
    file = f"{frame.title}.png"
    write_image(folder / _PANOPTIC / file, pixels)
    write_image(folder / _IMAGES / file, to_image_axes(shown_appearance(bev)))
    height, width = pixels.shape[:2]
    image = {"file_name": file, "width": width, "height": height, "sample_token": frame.token, "scene": frame.scene}
    segments = segments_info(pixels @ np.array([1, 256, 256**2]), names)
    return {"image": image, "annotation": {"file_name": file, "segments_info": segments}}


def panoptic_ids(bev: BEVMap, instance: IntArray, names: Sequence[str]) -> tuple[IntArray, dict[int, str]]:
    """Return the (X, Y) id of the segment of each cell, and the instance token of each segment that has one.

    A vehicle hides a lane marking, which hides the road. Cells of which nothing is known, or too little to say that
    they are none of the classes, are void.

    Args:
        bev: the map.
        instance: (X, Y) index of the vehicle of each cell, -1 for none.
        names: token of each vehicle; empty if unknown.
    """
    road, vehicle, lane = bev.on
    ids = np.where(bev.occupancy_valid.all(axis=0), _OTHER, 0)
    ids[road], ids[lane] = _ROAD, _LANE
    owner = _completed(vehicle, instance)
    present, number = np.unique(owner[vehicle], return_inverse=True)
    ids[vehicle] = _FIRST_VEHICLE + number
    return ids, {_FIRST_VEHICLE + i: names[k] for i, k in enumerate(present) if k < len(names)}


def _completed(vehicle: BoolArray, instance: IntArray) -> IntArray:
    """Return the vehicle of each vehicle cell.

    Cells without one belong to the nearest in the same connected region; a region without any is one vehicle.
    """
    owned = vehicle & (instance >= 0)
    owner = np.where(owned, instance, -1)
    regions, count = ndimage.label(vehicle, np.ones((3, 3)))
    following = int(instance.max(initial=-1)) + 1
    for number in range(1, count + 1):
        region = regions == number
        left = region & ~owned
        if not left.any():
            continue
        if not (region & owned).any():
            owner[region], following = following, following + 1
            continue
        nearest = ndimage.distance_transform_edt(~(region & owned), return_distances=False, return_indices=True)
        owner[left] = owner[tuple(axis[left] for axis in nearest)]
    return owner


def _instances(frame: PackedFrame, bev: BEVMap) -> tuple[IntArray, Sequence[str]]:
    """Return the vehicle of each cell, -1 for none, and their tokens: of the map, or of the boxes in it."""
    with zip_arrays(read_file(frame.bev)) as arrays:
        instance = arrays["instance"].astype(np.int64) if "instance" in arrays else None
    if instance is not None:
        if instance.shape != bev.grid.shape:
            raise DataError(f"{frame.bev}: instance: expected shape {bev.grid.shape}, got {instance.shape}")
        tokens = bev.meta.get("instances", [])
        return instance, [str(token) for token in tokens] if bev.objects is None else []
    if bev.is_truth and frame.boxes_ego is not None:
        vehicles = frame.boxes_ego.vehicles()
        return vehicle_owner(bev.grid, vehicles), vehicles.instance
    return np.full(bev.grid.shape, -1, np.int64), []


def segments_info(ids: IntArray, names: dict[int, str]) -> list[dict[str, Any]]:
    """Return the segments of a picture of ids (H, W): id, category, area, box (x, y, width, height) in pixels."""
    segments = []
    for segment in np.unique(ids[ids > 0]).tolist():
        rows, columns = np.nonzero(ids == segment)
        x, y = int(columns.min()), int(rows.min())
        more = {"instance_token": names[segment]} if segment in names else {}
        segments.append(
            {
                "id": segment,
                "category_id": _VEHICLE if segment >= _FIRST_VEHICLE else segment,
                "area": len(rows),
                "bbox": [x, y, int(columns.max()) - x + 1, int(rows.max()) - y + 1],
                "iscrowd": 0,
                **more,
            }
        )
    return segments
