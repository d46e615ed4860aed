"""Depth sampling: each cell reads the probability of its own depth, and gradients are those of the dense formula."""

from __future__ import annotations

import numpy as np
import torch
from tolerances import assert_rounded

from appocc.camera import CameraRig
from appocc.grid import BEVGrid
from appocc.models.base import DEPTH_BINS, DEPTH_STEP_M, FIRST_DEPTH_M
from appocc.models.view_transform.planning import plan_sampling
from appocc.models.view_transform.sampling import sample_depth, sample_features
from appocc.rigs import read_rig

RIG = CameraRig(tuple(camera.resized(352, 128) for camera in read_rig("paper")))
GRID = BEVGrid(-12, 12, -12, 12, 1.0)
HEIGHTS = (0.0, 0.8)
SIZE = (16, 44)


def logits_of(depth_m: float, cameras: int = 6) -> torch.Tensor:
    """Distributions that are certain of one depth."""
    bins = torch.arange(DEPTH_BINS) * DEPTH_STEP_M + FIRST_DEPTH_M
    return (-1e3 * (bins - depth_m).abs())[None, :, None, None].expand(cameras, -1, *SIZE).contiguous()


def test_only_cells_at_the_depth_of_the_surface_read_it() -> None:
    rig = CameraRig((RIG["CAM_FRONT"],))
    plan = plan_sampling([rig], GRID, HEIGHTS, *SIZE, 8, depths=True)
    at, clear = sample_depth(logits_of(8.5, 1), plan).reshape(1, 2, 2, *GRID.shape)[0].unbind(1)
    camera_x = float(rig["CAM_FRONT"].ego_from_cam[0, 3])
    depth = torch.from_numpy(GRID.centres()[..., 0] - camera_x).float()
    seen = plan.seen[0]
    for height in range(2):
        hit, free = at[height][seen], clear[height][seen]
        far = depth[seen]
        near_surface = (far - 8.5).abs()
        assert_rounded(hit, (1 - near_surface).clamp(min=0), 60)
        # Nothing is nearer for the cells up to the surface, and the surface for those behind it.
        assert (free[far <= 8.5] > 0.999).all()
        assert (free[far >= 9.5] < 0.001).all()
    assert not at[:, ~seen].any()


def test_sums_and_gradients_are_those_of_the_dense_formula() -> None:
    torch.manual_seed(0)
    plan = plan_sampling([RIG, RIG], GRID, HEIGHTS, *SIZE, 8, depths=True)
    values = torch.randn(12, 16, 44 * DEPTH_BINS, 2, requires_grad=True)
    found = sample_features(values, plan)
    weight = torch.randn_like(found)
    (gradient,) = torch.autograd.grad((found * weight).sum(), values)
    ends = torch.cat([plan.read.offsets[1:], torch.tensor([len(plan.read.rows)], dtype=torch.int32)])
    bag = torch.repeat_interleave(torch.arange(len(ends)), (ends - plan.read.offsets).long())
    rows = values.flatten(0, 2)[plan.read.rows.long()] * plan.read.weights[:, None]
    dense = torch.zeros(len(ends), 2).index_add(0, bag, rows).reshape(2, *GRID.shape, -1).permute(0, 3, 1, 2)
    (expected,) = torch.autograd.grad((dense * weight).sum(), values)
    assert_rounded(found, dense, 100)
    assert_rounded(gradient, expected, 100)


def test_the_export_form_reads_the_same() -> None:
    torch.manual_seed(0)
    plan = plan_sampling([RIG], GRID, HEIGHTS, *SIZE, 8, depths=True)
    logits = torch.randn(6, DEPTH_BINS, *SIZE)
    assert_rounded(sample_depth(logits, plan.for_export()), sample_depth(logits, plan), 100)


def test_weights_of_a_point_are_shares() -> None:
    plan = plan_sampling([RIG], GRID, HEIGHTS, *SIZE, 8, depths=True)
    ones = sample_features(torch.ones(6, 16, 44 * DEPTH_BINS, 1), plan)[0, 0]
    assert_rounded(ones[plan.seen[0]], np.ones(int(plan.seen.sum())), 60)
