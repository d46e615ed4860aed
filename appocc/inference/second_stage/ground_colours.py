"""Colours of the ground around the ego in the images of a drive."""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from appocc.camera import CameraRig
from appocc.checks import FloatArray
from appocc.grid import BEVGrid
from appocc.inference.second_stage.cell_network import PARTS
from appocc.models.memory import ground_motion, is_linked, sample_earlier
from appocc.models.view_transform.planning import plan_sampling
from appocc.models.view_transform.sampling import sample_features

# Number of earlier frames that are kept, and the distance that the ego drives between them.
_KEPT_FRAMES, _APART_M = 6, 2.0
# A place of an earlier frame is seen if all of what it is interpolated from is.
_ALL_SEEN = 0.999


class GroundView(NamedTuple):
    """Images of a frame, from which the ground around the ego is seen.

    Attributes:
        images: (V, 3, H, W) sRGB, 0..1.
        rig: their V cameras, in the frame of the grid.
        grid: cells around the ego.
        world_from_ego: (4, 4) ego pose.
        timestamp_us: time, microseconds.
    """

    images: Tensor
    rig: CameraRig
    grid: BEVGrid
    world_from_ego: FloatArray
    timestamp_us: int


class _Earlier(NamedTuple):
    """An earlier frame: its pose, and (1, 4, 3X, 3Y) colours of the parts of cells, and whether they are seen."""

    world_from_ego: FloatArray
    ground: Tensor


class GroundColours:
    """Colours of the ground at the parts of cells; where no camera sees it, those of earlier frames of the drive.

    The ground under and next to the ego is seen by no camera, but some frames before. A break in time or a jump of
    the pose begins another drive.
    """

    def __init__(self) -> None:
        """Begin a drive."""
        self._earlier: deque[_Earlier] = deque(maxlen=_KEPT_FRAMES)
        self._last: tuple[FloatArray, int] | None = None

    def reset(self) -> None:
        """Forget all frames: the next frame is the first of a drive."""
        self._earlier.clear()
        self._last = None

    def __call__(self, view: GroundView) -> tuple[Tensor, Tensor]:
        """Return the colours (1, 27, X, Y), 0..1, of the next frame, and the share (1, 1, X, Y) of seen parts."""
        if self._last is not None and not _is_next(view, *self._last):
            self._earlier.clear()
        self._last = view.world_from_ego, view.timestamp_us
        now = _seen_ground(view)
        ground = self._completed(now, view)
        if not self._earlier or _driven_m(self._earlier[-1].world_from_ego, view) >= _APART_M:
            self._earlier.append(_Earlier(view.world_from_ego, now))
        seen = (ground[:, 3:] > 0).float()
        return functional.pixel_unshuffle(ground[:, :3], PARTS), functional.avg_pool2d(seen, PARTS)

    def _completed(self, ground: Tensor, view: GroundView) -> Tensor:
        """Return the ground (1, 4, 3X, 3Y) of a view with the unseen parts of the latest frame that saw them."""
        parts, ground = _parts_of(view.grid), ground.clone()
        for earlier in reversed(self._earlier):
            x, y = (ground[0, 3] == 0).nonzero(as_tuple=True)
            points_m = torch.from_numpy(parts.centre_of(torch.stack([x, y], dim=-1).cpu().numpy()))
            motion = torch.from_numpy(ground_motion(earlier.world_from_ego, view.world_from_ego))
            there = sample_earlier(earlier.ground, points_m[None], motion[None], parts)[0, :, 0]  # 4 n
            seen = there[3] > _ALL_SEEN
            ground[0][:, x[seen], y[seen]] = there[:, seen]
        return ground


def _is_next(view: GroundView, world_from_last: FloatArray, last_us: int) -> bool:
    return is_linked(ground_motion(world_from_last, view.world_from_ego), (view.timestamp_us - last_us) / 1e6)


def _driven_m(world_from_past: FloatArray, view: GroundView) -> float:
    return float(np.hypot(*ground_motion(world_from_past, view.world_from_ego)[:, 2]))


def _parts_of(grid: BEVGrid) -> BEVGrid:
    """Return the grid of the parts of cells."""
    return replace(grid, cell_m=grid.cell_m / PARTS)


def _seen_ground(view: GroundView) -> Tensor:
    """Return (1, 4, 3X, 3Y): colours, 0..1, of the ground in the images of a view, and 1 where a camera sees it."""
    high, wide = view.images.shape[2:]
    plan = plan_sampling([view.rig], _parts_of(view.grid), (0.0,), high, wide, 1, device=view.images.device)
    rgb = sample_features(view.images.permute(0, 2, 3, 1), plan)
    return torch.cat([rgb, plan.seen[:, None].float()], dim=1)
