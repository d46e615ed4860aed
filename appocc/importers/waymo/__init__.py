"""Waymo Open Dataset, perception (Sun et al., CVPR 2020): v1's TFRecords and v2's parquet files."""

from __future__ import annotations

from appocc.importers.waymo.layouts import find_logs
from appocc.importers.waymo.log import WaymoLog

__all__ = ["WaymoLog", "find_logs"]
