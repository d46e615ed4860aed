"""Images of flat ground with a painted line along x, seen from an ego that drives along it."""

from __future__ import annotations

import numpy as np
import torch
from made_street import YAW, camera
from torch import Tensor

from appocc.camera import Camera, CameraRig
from appocc.checks import BoolArray, FloatArray
from appocc.geometry import transform
from appocc.grid import BEVGrid
from appocc.inference.second_stage.ground_colours import GroundView

GRID = BEVGrid(-8.0, 8.0, -8.0, 8.0, 0.4)
RIG = CameraRig(tuple(camera(channel) for channel in YAW))
# The line is narrower than a cell and not in the middle of one.
LINE_Y_M, LINE_WIDTH_M = 1.05, 0.2
PAINT, ASPHALT = (0.9, 0.8, 0.2), (0.3, 0.3, 0.3)


def on_line(y_m: FloatArray) -> BoolArray:
    """Whether places are on the line."""
    return np.asarray(np.abs(y_m - LINE_Y_M) < LINE_WIDTH_M / 2)


def painted_image(one: Camera, paint: tuple[float, float, float] = PAINT) -> Tensor:
    """The image (3, H, W), 0..1, of the ground."""
    v, u = np.mgrid[: one.height_px, : one.width_px]
    rays = np.stack([u, v, np.ones_like(u)], axis=-1) @ np.linalg.inv(one.intrinsic).T @ one.ego_from_cam[:3, :3].T
    down = np.minimum(rays[..., 2], -1e-6)
    y_m = one.ego_from_cam[1, 3] - one.ego_from_cam[2, 3] / down * rays[..., 1]
    return torch.from_numpy(np.where(on_line(y_m)[..., None], paint, ASPHALT).transpose(2, 0, 1)).float()


def view_at(
    x_m: float, seconds: float = 0.0, rig: CameraRig = RIG, paint: tuple[float, float, float] = PAINT
) -> GroundView:
    """The view of the ego at a place along the line."""
    images = torch.stack([painted_image(one, paint) for one in rig])
    return GroundView(images, rig, GRID, transform(np.eye(3), [x_m, 0.0, 0.0]), round(seconds * 1e6))
