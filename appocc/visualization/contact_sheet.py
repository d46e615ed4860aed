"""Contact sheet of a dataset: one row per scene, with its cameras and its map."""

from __future__ import annotations

import numpy as np

from appocc.bevmap import load_map
from appocc.checks import ByteArray
from appocc.errors import DataError
from appocc.nuscenes.dataset import Dataset
from appocc.nuscenes.records import Scene
from appocc.visualization.cameras import camera_sheet
from appocc.visualization.canvas import PANEL_LEGEND, PANELS, BEVCanvas, put_text

_CAMERAS_PX, _BEV_SCALE, _MAX_ROWS, _GAP_PX = 1650, 2, 24, 8


def contact_sheet(dataset: Dataset, source: str) -> ByteArray:
    """Return a sheet (H, W, 3) of at most 24 scenes, evenly chosen: cameras, appearance and occupancy of a key frame.

    Raises:
        DataError: if there are no scenes with samples, or a file is missing or damaged.
    """
    scenes = [scene for scene in dataset.scenes if dataset.samples(scene)]
    if not scenes:
        raise DataError(f"{dataset.root}: no scenes with samples")
    chosen = np.unique(np.linspace(0, len(scenes) - 1, min(len(scenes), _MAX_ROWS)).round().astype(int))
    rows = [_row(dataset, scenes[i], source) for i in chosen]
    width = max(row.shape[1] for row in rows)
    padded = [np.pad(row, ((0, _GAP_PX), (0, width - row.shape[1]), (0, 0)), constant_values=24) for row in rows]
    return np.ascontiguousarray(np.vstack(padded))


def _row(dataset: Dataset, scene: Scene, source: str) -> ByteArray:
    samples = dataset.samples(scene)
    sample = samples[len(samples) // 2]
    frame = dataset.frame(sample)
    cameras = camera_sheet(frame.images, frame.rig.select(frame.images), _CAMERAS_PX)
    put_text(cameras, f"{scene.name}: {scene.description}", (6, cameras.shape[0] - 6), scale=0.5)
    bev = load_map(dataset.root, source, sample.token)
    maps = []
    for what, title in PANELS.items():
        canvas = BEVCanvas(bev.grid, _BEV_SCALE)
        getattr(canvas, what)(bev)
        canvas.ego(frame.rig.ego_vehicle)
        put_text(canvas.picture, title, (6, 16))
        put_text(canvas.picture, PANEL_LEGEND, (6, canvas.picture.shape[0] - 6))
        maps.append(canvas.picture)
    height = max(cameras.shape[0], *(picture.shape[0] for picture in maps))
    parts = [
        np.pad(p, ((0, height - p.shape[0]), (0, _GAP_PX), (0, 0)), constant_values=24) for p in (cameras, *maps)
    ]
    return np.hstack(parts)
