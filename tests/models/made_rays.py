"""Where the pixels of a camera meet the flat ground."""

from __future__ import annotations

import numpy as np

from appocc.camera import Camera
from appocc.checks import BoolArray, FloatArray
from appocc.geometry import apply


def ground_places(camera: Camera) -> tuple[FloatArray, BoolArray]:
    """(H, W, 2) place on the plane z = 0 that each pixel shows, ego frame, and (H, W) whether it shows any."""
    v, u = np.mgrid[: camera.height_px, : camera.width_px]
    rays = np.stack([u, v, np.ones_like(u)], axis=-1) @ np.linalg.inv(camera.intrinsic).T
    origin = camera.ego_from_cam[:3, 3]
    ways = apply(camera.ego_from_cam, rays) - origin
    with np.errstate(divide="ignore", invalid="ignore"):
        xy = origin[:2] + ways[..., :2] * (-origin[2] / ways[..., 2:])
    return xy, ways[..., 2] < -1e-3
