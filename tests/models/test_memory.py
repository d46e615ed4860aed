"""Memory: features move with the world, breaks are noticed, and clips are the same as frames one after the other."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from tolerances import assert_rounded

from appocc.camera import CameraRig
from appocc.geometry import quaternion_from_yaw, transform
from appocc.grid import BEVGrid
from appocc.models.memory import Past, ground_motion, is_linked, warp
from appocc.models.model_spec import ModelSpec, Parts
from appocc.models.network import AppoccNet
from appocc.models.rounding import count_terms
from appocc.rigs import read_rig

GRID = BEVGrid(-8, 8, -6, 6, 1.0)
TINY = ModelSpec("tiny", read_rig("paper").channels, BEVGrid(-9.6, 9.6, -9.6, 9.6, 0.8), 176, 64)
RIG = CameraRig(tuple(camera.resized(176, 64) for camera in read_rig("paper")))


@pytest.mark.parametrize("yaw", [0.0, 0.4, -2.0])
def test_a_place_stays_in_the_world(yaw: float) -> None:
    past = transform(quaternion_from_yaw(0.7), [3.0, -1.0, 0.0])
    now = past @ transform(quaternion_from_yaw(yaw), [1.6, 0.3, 0.0])
    fields = torch.from_numpy(_world_field(past)).float()[None]
    motion = torch.from_numpy(ground_motion(past, now)).float()[None]
    moved = warp(torch.cat([fields, torch.ones_like(fields[:, :1])], dim=1), motion, GRID)[0]
    inside = moved[2] > 0.9999
    assert inside.float().mean() > 0.4
    # The fields are linear, so that bilinear interpolation is exact.
    np.testing.assert_allclose(moved[:2, inside], _world_field(now)[:, inside], atol=1e-4)


def _world_field(world_from_ego: np.ndarray) -> np.ndarray:
    """World x and y of the cells, (2, X, Y)."""
    centres = GRID.centres()
    return np.moveaxis(centres @ world_from_ego[:2, :2].T + world_from_ego[:2, 3], -1, 0)


def test_features_from_outside_the_earlier_grid_are_zero() -> None:
    motion = torch.tensor([[[1.0, 0, 100], [0, 1, 0]]])
    assert not warp(torch.ones(1, 3, *GRID.shape), motion, GRID).any()


@pytest.mark.parametrize(
    ("metres", "elapsed_s", "linked"),
    [
        (5.0, 0.5, True),
        (0.0, 0.1, True),
        (0.0, 0.0, False),
        (1.0, -0.5, False),
        (1.0, 4.0, False),
        (60.0, 0.5, False),
    ],
)
def test_breaks_and_jumps_are_not_linked(metres: float, elapsed_s: float, linked: bool) -> None:
    assert is_linked(np.array([[1, 0, metres], [0, 1, 0]]), elapsed_s) is linked


def network() -> AppoccNet:
    torch.manual_seed(3)
    made = AppoccNet(TINY, parts=Parts(depth=True, memory=True, objects=True)).eval()
    with torch.no_grad():  # a new network ignores its memory
        recall = made.trunk.recall
        assert recall is not None
        recall.fused.weight.normal_(std=0.1)
    return made


def links(frames: int, clips: int) -> Past:
    motion = torch.eye(2, 3).expand(frames, clips, 2, 3).clone()
    motion[..., 0, 2] = 0.8
    return Past(None, motion, torch.full((frames, clips), 0.5), torch.ones(frames, clips))


def test_a_clip_is_the_same_as_its_frames_one_after_the_other() -> None:
    net, images, past = network(), torch.rand(6, 6, 3, 64, 176), links(3, 2)
    with torch.inference_mode():
        whole = net(images, net.plan([RIG] * 6), past)
        state = None
        for t in range(3):
            step = Past(state, past.past_from_now[t : t + 1], past.elapsed_s[t : t + 1], past.linked[t : t + 1])
            own = net(images[2 * t : 2 * t + 2], net.plan([RIG] * 2), step if t else None)
            state = own.memory
            assert_rounded(own.occupancy, whole.occupancy[2 * t : 2 * t + 2], count_terms(net))
    assert whole.memory is not None
    assert_rounded(state, whole.memory, count_terms(net))


def test_the_past_matters_only_where_linked() -> None:
    net, images, past = network(), torch.rand(2, 6, 3, 64, 176), links(2, 1)
    with torch.inference_mode():
        plan = net.plan([RIG] * 2)
        alone = net(images, plan).occupancy
        linked = net(images, plan, past).occupancy
        broken = net(images, plan, past._replace(linked=torch.zeros(2, 1))).occupancy
    assert (linked[1] - alone[1]).abs().max() > 1e-3
    assert_rounded(linked[0], alone[0], count_terms(net))
    assert_rounded(broken, alone, count_terms(net))
