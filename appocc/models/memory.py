"""Memory of earlier frames: features of the grid, moved by the ego motion to the present.

Compare BEVDet4D (Huang and Huang, 2022) and FIERY (Hu et al., ICCV 2021).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from appocc.checks import FloatArray
from appocc.geometry import inverse
from appocc.grid import BEVGrid
from appocc.typing import Transform


class Past(NamedTuple):
    """Links of T frames of each of B clips to the frames before them.

    Attributes:
        state: (B, C, X', Y') memory before the first frame; None: nothing is remembered.
        past_from_now: (T, B, 2, 3) ego motion on the ground: position in the frame before, metres.
        elapsed_s: (T, B) seconds since the frame before.
        linked: (T, B) 1 where the frame before belongs to the same drive, else 0: nothing is remembered.
    """

    state: Tensor | None
    past_from_now: Tensor
    elapsed_s: Tensor
    linked: Tensor

    def to(self, device: torch.device) -> Past:
        """Return a copy on a device."""
        return Past(*(None if each is None else each.to(device, non_blocking=True) for each in self))  # type: ignore[arg-type]


# Age of the memory that a frame uses: at least the second, and the first where there is one so old. Clips of the
# training have 0.5 s between frames; with more steps in the same time a network believes its own errors.
MEMORY_AGE_S, MIN_MEMORY_AGE_S = 0.9, 0.45
# Longer gaps and faster motion between frames are breaks of the recording or jumps of the pose.
_MAX_GAP_S, _MAX_SPEED_MPS = 3.0, 70.0


def ground_motion(world_from_past: Transform, world_from_now: Transform) -> FloatArray:
    """Return (2, 3) past_from_now on the ground, of two ego poses (4, 4)."""
    past_from_now = inverse(world_from_past) @ world_from_now
    return np.asarray(past_from_now[:2, [0, 1, 3]])


def is_linked(past_from_now: FloatArray, elapsed_s: float) -> bool:
    """Return whether the memory of the frame before can be used: no break in time, no jump of the pose."""
    if not 0 < elapsed_s <= _MAX_GAP_S:
        return False
    return bool(np.hypot(*past_from_now[:, 2]) <= _MAX_SPEED_MPS * elapsed_s)


def warp(state: Tensor, past_from_now: Tensor, grid: BEVGrid) -> Tensor:
    """Move features of an earlier frame to the present; 0 where the earlier grid does not reach.

    Args:
        state: (B, C, X, Y) features on the grid in the ego frame of the earlier time.
        past_from_now: (B, 2, 3) ego motion on the ground.
        grid: the grid.
    """
    return sample_earlier(state, torch.from_numpy(grid.centres()), past_from_now, grid)


def sample_earlier(state: Tensor, points_m: Tensor, past_from_now: Tensor, grid: BEVGrid) -> Tensor:
    """Return features (B, C, N, M) of an earlier frame at points, as `warp`.

    Args:
        state: (B, C, X, Y) features on the grid in the ego frame of the earlier time.
        points_m: (N, M, 2) points in the ego frame of now.
        past_from_now: (B, 2, 3) ego motion on the ground.
        grid: the grid.
    """
    # In float32 for any precision of the network: bfloat16 rounds positions to 0.25 m.
    motion = past_from_now.to(state.device, torch.float32)
    now = points_m.to(motion)
    then = now @ motion[:, None, :, :2].transpose(-1, -2) + motion[:, None, None, :, 2]
    low = motion.new_tensor([grid.x_min_m, grid.y_min_m])
    size = motion.new_tensor([grid.x_max_m - grid.x_min_m, grid.y_max_m - grid.y_min_m])
    at = (2 * (then - low) / size - 1).flip(-1)  # grid_sample expects the last axis first
    moved = functional.grid_sample(state.float(), at, mode="bilinear", padding_mode="zeros", align_corners=False)
    return moved.to(state.dtype)
