"""Finds the segments in a folder of either layout."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from appocc.errors import DataError
from appocc.importers.waymo.components import POSE, ComponentSegment
from appocc.importers.waymo.log import WaymoLog
from appocc.importers.waymo.records import RecordSegment

_DEPTHS = ("", "*/", "*/*/")


def find_logs(src: Path, hz: float) -> list[WaymoLog]:
    """Return the logs in a folder, in order of name.

    Args:
        src: a TFRecord file, a folder of them or of such folders; or the folder of the components of version 2, or of
            splits of them.
        hz: key frames per second.

    Raises:
        DataError: if there is none.
    """
    files = [src] if src.is_file() else sorted(path for depth in _DEPTHS for path in src.glob(f"{depth}*.tfrecord"))
    poses = sorted(path for depth in _DEPTHS for path in src.glob(f"{depth}{POSE}/*.parquet"))
    logs = [WaymoLog(_name(path), path, partial(RecordSegment, path), hz) for path in files]
    logs += [WaymoLog(path.stem, path, partial(ComponentSegment, path.parents[1], path.stem), hz) for path in poses]
    if not logs:
        raise DataError(
            f"{src}: expected segments of Waymo: *.tfrecord (version 1) or {POSE}/*.parquet (version 2), got none"
        )
    return sorted(logs, key=lambda log: log.name)


def _name(path: Path) -> str:
    """Return the name of the segment in a TFRecord file."""
    return path.stem.removeprefix("segment-").removesuffix("_with_camera_labels")
