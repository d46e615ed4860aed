"""The ground of points that are in memory."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from appocc.checks import FloatArray
from appocc.groundtruth.colouring import ColouredPoints
from appocc.groundtruth.store import PointStore
from appocc.groundtruth.surface import ExposureGains, GroundSurface, build_surface


def surface_of(sweeps: Sequence[ColouredPoints], origin_m: FloatArray, gains: ExposureGains) -> GroundSurface:
    with TemporaryDirectory() as folder:
        store = PointStore(Path(folder))
        for points in sweeps:
            store.add(points)
        return build_surface(store, origin_m, gains)
