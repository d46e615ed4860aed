"""The 3D boxes of KITTI-360: an XML file of a drive, in the world frame."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import NamedTuple

import numpy as np

from appocc.checks import FloatArray
from appocc.errors import DataError
from appocc.files import MOST_TEXT_BYTES, read_text
from appocc.geometry import nearest_rigid
from appocc.importers.kitti.categories import CATEGORIES, LABEL_IDS
from appocc.nuscenes.writer import Annotation
from appocc.xml_file import parse_xml

STANDING = -1
# A standing object is annotated in windows of about 200 m; it is there from about 80 m before its window on.
_NEAR_M, _MARGIN_FRAMES = 80.0, 100


class Box360(NamedTuple):
    """A box in the world frame.

    Attributes:
        instance: name of the object.
        kind: label.
        world_from_box: (4, 4) pose, x along the length.
        size_wlh_m: width, length, height.
        frame: number of its frame; -1: it stands.
        window: first and last frame of the window in which a standing object is annotated.
    """

    instance: str
    kind: str
    world_from_box: FloatArray
    size_wlh_m: tuple[float, float, float]
    frame: int
    window: tuple[int, int]


def read_boxes(path: Path) -> tuple[Box360, ...]:
    """Read the boxes of a drive; those without a category have only their kind.

    Raises:
        DataError: if it is no such file, or a box is damaged.
    """
    root = parse_xml(path, read_text(path, MOST_TEXT_BYTES))
    boxes = []
    for number, item in enumerate(root):
        if item.find("transform") is not None:
            try:
                boxes.append(_box(item))
            except (ValueError, TypeError, IndexError) as error:
                raise DataError(
                    f"{path}: object {number}: expected transform, vertices, timestamp ({error})"
                ) from error
    if not boxes:
        raise DataError(f"{path}: expected objects with a transform, got none")
    return tuple(boxes)


def boxes_near(boxes: tuple[Box360, ...], number: int, world_from_ego: FloatArray) -> tuple[Annotation, ...]:
    """Return the boxes of a frame: moving ones of the frame, standing ones of its surroundings."""
    found = []
    for box in boxes:
        category = CATEGORIES.get(box.kind)
        begin, end = box.window
        standing = box.frame == STANDING and begin - _MARGIN_FRAMES <= number <= end + _MARGIN_FRAMES
        if category is None or not (standing or box.frame == number):
            continue
        if np.linalg.norm(box.world_from_box[:3, 3] - world_from_ego[:3, 3]) <= _NEAR_M:
            found.append(
                Annotation(
                    instance=box.instance,
                    category=category,
                    world_from_box=box.world_from_box,
                    size_wlh_m=box.size_wlh_m,
                )
            )
    return tuple(found)


def _box(item: ElementTree.Element) -> Box360:
    """Return the box of an element.

    Raises:
        ValueError: if a number is missing, or the box is flat.
    """
    number = item.findtext("semanticId")
    kind = (LABEL_IDS.get(int(number)) if number else None) or item.findtext("label", "").strip()
    world_from_template, vertices = _matrix(item, "transform"), _matrix(item, "vertices")
    low, high = vertices[:, :3].min(axis=0), vertices[:, :3].max(axis=0)
    stretched = world_from_template[:3, :3]
    lengths = np.linalg.norm(stretched, axis=0)
    size = lengths * (high - low)
    if not (size > 0).all():
        raise ValueError(f"expected a box with a volume, got sides of {size.round(3).tolist()} m")
    pose = np.eye(4)
    axes = stretched / lengths
    pose[:3, :3] = axes * [1, np.sign(np.linalg.det(axes)), 1]  # a mirrored template is the same box
    pose[:3, 3] = stretched @ (low + high) / 2 + world_from_template[:3, 3]
    instance = item.findtext("instanceId") or item.findtext("dynamicSeq") or item.findtext("index")
    window = int(item.findtext("start_frame", "0")), int(item.findtext("end_frame", str(np.iinfo(np.int32).max)))
    length, width, height = size.tolist()
    frame = int(item.findtext("timestamp", ""))
    return Box360(f"{kind}-{instance}", kind, nearest_rigid(pose), (width, length, height), frame, window)


def _matrix(item: ElementTree.Element, name: str) -> FloatArray:
    """Return an OpenCV matrix.

    Raises:
        ValueError: if it is missing, or has other than as many finite numbers.
    """
    rows, columns = (int(item.findtext(f"{name}/{side}", "")) for side in ("rows", "cols"))
    numbers = np.array(item.findtext(f"{name}/data", "").split(), np.float64)
    if columns < 3 or not np.isfinite(numbers).all():
        raise ValueError(f"{name}: expected finite numbers in 3 or more columns")
    return numbers.reshape(rows, columns)
