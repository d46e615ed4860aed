"""KITTI's three published folder layouts: raw recordings, the tracking benchmark, and KITTI-360.

Geiger et al., "Vision meets robotics: the KITTI dataset", IJRR 2013; Liao et al., "KITTI-360: a novel dataset and
benchmarks for urban scene understanding in 2D and 3D", PAMI 2022.
"""

from __future__ import annotations

from appocc.importers.kitti.layouts import find_logs
from appocc.importers.kitti.log import KittiLog

__all__ = ["KittiLog", "find_logs"]
