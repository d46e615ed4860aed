"""Checks of every importer: coloured balls in the world must appear at their place in the converted pictures."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from appocc.checks import FloatArray
from appocc.geometry import apply, inverse
from appocc.nuscenes import Dataset

# Places around the start of a drive along world x, and the red, green and blue of a ball there.
BALLS_M = np.array(
    [[14.0, 3, 1.2], [16, -4, 0.8], [12, 0.5, 1.6], [-12, 3, 1.0], [-14, -3, 1.4], [2, 12, 1], [3, -13, 1]]
)
COLOURS = np.array(
    [[230, 20, 20], [20, 200, 30], [30, 40, 230], [220, 210, 20], [210, 30, 220], [20, 210, 220], [240, 120, 20]]
)
RADIUS_PX = 9


def ball_jpeg(
    project: Callable[[FloatArray], FloatArray],
    size_px: tuple[int, int],
    world_from_cam: FloatArray,
    origin_m: FloatArray,
) -> bytes:
    """The JPEG of a camera (pixels of points in its frame by `project`) that sees the balls around an origin."""
    picture = np.full((size_px[1], size_px[0], 3), 70, np.uint8)
    points = apply(inverse(world_from_cam), BALLS_M + origin_m)
    for point, colour in zip(points, COLOURS.tolist(), strict=True):
        if point[2] < 0.5:
            continue
        u, v = project(point[None])[0]
        if np.isfinite([u, v]).all() and -50 < u < size_px[0] + 50 and -50 < v < size_px[1] + 50:
            cv2.circle(picture, (round(u), round(v)), RADIUS_PX, colour, -1)
    done, data = cv2.imencode(".jpg", picture[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, 95])
    assert done
    return bytes(data.tobytes())


def assert_balls_in_place(dataset: Dataset, origin_m: FloatArray, least: int) -> None:
    """Every ball that lies well inside a picture has its colour there; at least so many are seen."""
    seen = 0
    for scene in dataset.scenes:
        for sample in dataset.samples(scene):
            frame = dataset.frame(sample)
            balls = apply(inverse(frame.world_from_ego), BALLS_M + origin_m)
            for camera in frame.rig:
                if camera.channel not in frame.images:
                    continue
                uv, depth = camera.project_ego(balls)
                image = frame.images[camera.channel]
                margin = 2 * RADIUS_PX
                for (u, v), z, colour in zip(uv, depth, COLOURS, strict=True):
                    if z < 1 or not (
                        margin < u < camera.width_px - margin and margin < v < camera.height_px - margin
                    ):
                        continue
                    found = image[round(v), round(u)].astype(int)
                    assert np.abs(found - colour).max() < 60, (camera.channel, u, v, found, colour)
                    seen += 1
    assert seen >= least


def assert_devkit_loads(root: Path, version: str) -> Any:
    """nuscenes-devkit reads the tables and finds the files of every sample."""
    reason = "nuscenes-devkit is not installed (--no-deps)"
    kit = pytest.importorskip("nuscenes.nuscenes", reason=reason, exc_type=ImportError)
    loaded = kit.NuScenes(version, str(root), verbose=False)
    for sample in loaded.sample:
        for token in sample["data"].values():
            assert Path(loaded.get_sample_data(token)[0]).is_file()
    return loaded
