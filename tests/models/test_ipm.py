"""Inverse perspective mapping: flat ground comes back in its own colours."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from made_rays import ground_places

from appocc.camera import Camera, CameraRig
from appocc.errors import ShapeError
from appocc.grid import BEVGrid
from appocc.models.ipm import ipm
from appocc.rigs import read_rig

GRID = BEVGrid(-12.0, 12.0, -12.0, 12.0, 0.8)


def ground(camera: Camera) -> torch.Tensor:
    """(3, H, W) of a ground whose colours are smooth functions of x and y; black sky."""
    xy, below = ground_places(camera)
    return torch.from_numpy(np.where(below[..., None], colour(xy), 0.0)).float().permute(2, 0, 1)


def colour(xy_m: np.ndarray) -> np.ndarray:
    x, y = np.clip(xy_m / 24 + 0.5, 0, 1).transpose(2, 0, 1)
    return np.stack([x, y, np.full_like(x, 0.5)], axis=-1)


def test_flat_ground_comes_back() -> None:
    rig = read_rig("paper")
    appearance, valid = ipm(torch.stack([ground(camera) for camera in rig]), rig, GRID)
    expected = torch.from_numpy(colour(GRID.centres())).float().permute(2, 0, 1)
    assert valid.float().mean() > 0.8
    assert (appearance - expected).abs()[:, valid].max() < 0.02
    assert appearance[:, ~valid].abs().max() == 0


def test_a_camera_that_is_gone_leaves_its_cells_unknown() -> None:
    rig = CameraRig((read_rig("paper")["CAM_BACK"],))
    _, valid = ipm(ground(rig["CAM_BACK"])[None], rig, GRID)
    assert not valid[20:].any()
    assert valid[:8, 15].all()
    _, nothing = ipm(torch.zeros(0, 3, 128, 352), CameraRig(()), GRID)
    assert not nothing.any()


def test_images_must_fit_the_rig() -> None:
    rig = read_rig("paper")
    with pytest.raises(ShapeError, match="one per camera, got"):
        ipm(torch.zeros(5, 3, 128, 352), rig, GRID)
    with pytest.raises(ShapeError, match="CAM_FRONT_LEFT"):
        ipm(torch.zeros(6, 3, 64, 352), rig, GRID)
