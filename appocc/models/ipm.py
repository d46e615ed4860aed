"""Inverse perspective mapping: ground colours by homography, without learning.

Each camera sees the plane z = 0 through a homography. Objects above the ground are smeared away from the camera. It
predicts no occupancy and is not a `BEVModel`: it is the baseline for learnt appearance.
"""

from __future__ import annotations

from torch import Tensor

from appocc.camera import CameraRig
from appocc.errors import ShapeError
from appocc.grid import BEVGrid
from appocc.models.view_transform.planning import plan_sampling
from appocc.models.view_transform.sampling import sample_features


def ipm(images: Tensor, rig: CameraRig, grid: BEVGrid) -> tuple[Tensor, Tensor]:
    """Colour a grid by the ground homography: bilinear, mean over the cameras that see the centre of a cell.

    Args:
        images: (N, 3, H, W) sRGB, 0..1, one per camera in the order of the rig.
        rig: cameras of the images.
        grid: cells to colour.

    Returns:
        Appearance (3, X, Y) float32 sRGB, 0..1, and (X, Y) bool where a camera sees the cell; 0 elsewhere.

    Raises:
        ShapeError: if images and cameras do not match.
    """
    if images.ndim != 4 or len(images) != len(rig) or images.shape[1] != 3:
        raise ShapeError(f"images: expected ({len(rig)}, 3, H, W), one per camera, got {tuple(images.shape)}")
    high, wide = images.shape[2:]
    plan = plan_sampling([rig], grid, (0.0,), high, wide, stride=1).to(images.device)
    return sample_features(images.permute(0, 2, 3, 1), plan)[0], plan.seen[0]
