"""Inverse perspective mapping: the colour of the ground, as if everything lay flat on it; nothing is learnt.

Each camera sees the plane z = 0 through a homography. What stands up is smeared outward, away from the camera; so it
says nothing of occupancy, and is no `BEVModel`: a floor that learnt colours have to beat.
"""

from __future__ import annotations

from torch import Tensor

from appocc.camera import CameraRig
from appocc.errors import ShapeError
from appocc.grid import BEVGrid
from appocc.models.view_transform.sampling import plan_pull, pull


def ipm(images: Tensor, rig: CameraRig, grid: BEVGrid) -> tuple[Tensor, Tensor]:
    """The grid's colours by the ground homography: bilinear, mean over the cameras that see a cell's centre.

    Args:
        images: (N, 3, H, W) sRGB, 0..1, one per camera of the rig in its order.
        rig: that took them.
        grid: whose cells are asked for.

    Returns:
        Appearance (3, X, Y) float32 sRGB, 0..1, and (X, Y) bool where a camera sees the cell; 0 elsewhere.

    Raises:
        ShapeError: if images and cameras do not fit.
    """
    if images.ndim != 4 or len(images) != len(rig) or images.shape[1] != 3:
        raise ShapeError(f"images: expected ({len(rig)}, 3, H, W), one per camera, got {tuple(images.shape)}")
    high, wide = images.shape[2:]
    plan = plan_pull([rig], grid, (0.0,), high, wide, stride=1).to(images.device)
    return pull(images.permute(0, 2, 3, 1), plan)[0], plan.seen[0]
