from dataclasses import replace

import numpy as np
import pytest
import torch
from tolerances import assert_rounded

from appocc.camera import Camera, CameraRig
from appocc.ego_vehicle import EgoVehicle
from appocc.errors import ShapeError
from appocc.geometry import transform
from appocc.grid import BEVGrid
from appocc.models.base import DEPTH_BINS, DEPTH_STEP_M, FIRST_DEPTH_M
from appocc.models.view_transform.splatting import (
    SEEN_HEIGHTS_M,
    SplattingPlan,
    frustum_points,
    pack_cameras,
    plan_splatting,
    splat,
    unpack_cameras,
    visible_cells,
)

H, W, STRIDE = 3, 6, 16
GRID = BEVGrid(-20, 20, -20, 20, 0.8)


def camera(channel: str, yaw_rad: float, x_m: float = 1.0, y_m: float = 0.3) -> Camera:
    """A level camera 1.5 m above the ground; at yaw 0 it looks ahead."""
    c, s = np.cos(yaw_rad), np.sin(yaw_rad)
    ego_from_cam = transform(np.array([[s, 0, c], [-c, 0, s], [0, -1, 0.0]]), [x_m, y_m, 1.5])
    return Camera(channel, W * STRIDE, H * STRIDE, np.array([[70.0, 0, 40], [0, 70, 20], [0, 0, 1]]), ego_from_cam)


FRONT = camera("CAM_FRONT", 0.0)
RIG = CameraRig((FRONT, camera("CAM_BACK", np.pi, -1.0), camera("CAM_FRONT_LEFT", 1.0)))


def random_features(pictures: int, channels: int = 5) -> tuple[torch.Tensor, torch.Tensor]:
    generator = torch.Generator().manual_seed(7)
    context = torch.randn(pictures, H, W, channels, generator=generator, dtype=torch.float64)
    depth = torch.rand(pictures, DEPTH_BINS, H, W, generator=generator, dtype=torch.float64)
    return context, depth / depth.sum(dim=1, keepdim=True)


def by_loop(rigs: list[CameraRig], context: torch.Tensor, depth: torch.Tensor, bilinear: bool) -> torch.Tensor:
    """What `pool` should give, point by point; pictures are (B, N)."""
    out = torch.zeros(len(rigs), *GRID.shape, context.shape[-1], dtype=torch.float64)
    pictures = len(context) // len(rigs)
    for b, rig in enumerate(rigs):
        for n, points in enumerate(frustum_points(rig, H, W, STRIDE)):
            for d, v, u in np.ndindex(DEPTH_BINS, H, W):
                x, y, z = points[d, v, u]
                if not -10 <= z < 10:
                    continue
                value = context[b * pictures + n, v, u] * depth[b * pictures + n, d, v, u]
                a, c = (x - GRID.x_min_m) / GRID.cell_m, (y - GRID.y_min_m) / GRID.cell_m
                spots = [(np.floor(a), np.floor(c), 1.0)]
                if bilinear:
                    i, j = np.floor(a - 0.5), np.floor(c - 0.5)
                    p, q = a - 0.5 - i, c - 0.5 - j
                    spots = [
                        (i, j, (1 - p) * (1 - q)),
                        (i, j + 1, (1 - p) * q),
                        (i + 1, j, p * (1 - q)),
                        (i + 1, j + 1, p * q),
                    ]
                for i, j, share in spots:
                    if 0 <= i < GRID.shape[0] and 0 <= j < GRID.shape[1]:
                        out[b, int(i), int(j)] += share * value
    return out.permute(0, 3, 1, 2)


@pytest.mark.parametrize("bilinear", [False, True])
def test_both_ways_of_pooling_agree_with_a_plain_loop(bilinear: bool) -> None:
    rigs = [RIG, CameraRig(RIG.cameras[1:])]
    context, depth = random_features(2 * 3)
    plan = plan_splatting(rigs, GRID, H, W, STRIDE, bilinear)
    plan = replace(plan, weight=plan.weight.double())
    expected = by_loop(rigs, context, depth, bilinear)
    assert expected.abs().max() > 0.1
    # The plan's weights are float32; a cell sums a few points.
    assert_rounded(splat(context, depth, plan), expected, 8, float(context.abs().max()), torch.float32)
    assert_rounded(splat(context, depth, plan.for_export()), expected, 8, float(context.abs().max()), torch.float32)


def lit_cells(rig: CameraRig, depth_bin: int, row: int, column: int, picture: int = 0) -> list[tuple[int, int]]:
    """Cells that one feature reaches if its depth is certain."""
    context, depth = torch.zeros(len(rig), H, W, 1), torch.zeros(len(rig), DEPTH_BINS, H, W)
    context[picture, row, column] = 1.0
    depth[picture, depth_bin, row, column] = 1.0
    grid = splat(context, depth, plan_splatting([rig], GRID, H, W, STRIDE))[0, 0]
    return [(int(x), int(y)) for x, y in grid.nonzero()]


def test_a_feature_lands_where_its_pixel_and_depth_point_to() -> None:
    depth_bin, column = 6, 1
    ahead_m = FIRST_DEPTH_M + DEPTH_STEP_M * depth_bin  # 10.5 m before the camera
    left_m = (40 - 16 * column) / 70 * ahead_m  # pixels left of the middle are to the left: +y
    assert left_m > 3
    (cell,) = lit_cells(RIG, depth_bin, 1, column)
    assert cell == tuple(GRID.cell_of([1.0 + ahead_m, 0.3 + left_m]))


def test_a_feature_of_the_rear_camera_lands_behind_and_on_the_other_side() -> None:
    (cell,) = lit_cells(RIG, 6, 1, 1, picture=1)
    assert cell == tuple(GRID.cell_of([-1.0 - 10.5, 0.3 - (40 - 16) / 70 * 10.5]))


def test_points_outside_do_not_fold_into_the_first_row() -> None:
    # The camera stands at x = 1, its first points at 5.5: a quarter of a cell short of the grid, where truncation
    # towards zero would call them row 0; three quarters of a cell short of the first row's centres.
    grid = BEVGrid(5.7, 45.7, -20.1, 20.7, 0.8)
    rig = CameraRig((FRONT,))
    nearest, bilinear = (plan_splatting([rig], grid, H, W, STRIDE, each) for each in (False, True))
    first_bin = H * W
    assert (np.abs(frustum_points(rig, H, W, STRIDE)[0, 0, ..., 0] - 5.5) < 1e-9).all()
    assert not (nearest.depth < first_bin).any()
    of_first = bilinear.depth < first_bin
    assert (bilinear.cell[of_first] < grid.shape[1]).all()
    assert_rounded(bilinear.weight[of_first].sum(), torch.tensor(0.25 * first_bin), first_bin, size=GRID.shape[0])


def test_a_point_at_the_border_loses_the_share_that_lies_outside() -> None:
    rig = CameraRig((FRONT,))
    plan = plan_splatting([rig], GRID, H, W, STRIDE, bilinear=True)
    assert float(plan.weight.max()) <= 1 + 1e-6
    total = torch.zeros(DEPTH_BINS * H * W).index_add(0, plan.depth, plan.weight)
    points = frustum_points(rig, H, W, STRIDE)[0].reshape(-1, 3)
    within = (np.abs(points) < [19.6, 19.6, 10]).all(axis=1)
    beyond = (np.abs(points[:, :2]) > 20.4).any(axis=1) | (np.abs(points[:, 2]) > 10)
    assert_rounded(total[torch.from_numpy(within)], torch.ones(int(within.sum())), 4)
    assert not total[torch.from_numpy(beyond)].any()


@pytest.mark.parametrize("bilinear", [False, True])
def test_gradients_reach_context_and_depth(bilinear: bool) -> None:
    rig = CameraRig((FRONT,))
    small = BEVGrid(4, 12, -4, 4, 4.0)
    plan = plan_splatting([rig], small, H, W, STRIDE, bilinear)
    plan = replace(plan, weight=plan.weight.double())
    context, depth = random_features(1, 2)
    assert torch.autograd.gradcheck(
        lambda c, d: splat(c, d, plan), (context.requires_grad_(), depth.requires_grad_()), fast_mode=True
    )


def test_a_sample_of_a_batch_is_as_it_is_alone() -> None:
    rigs = [CameraRig(RIG.cameras[:1]), RIG, CameraRig(())]
    context, depth = random_features(9)
    together = splat(context, depth, plan_splatting(rigs, GRID, H, W, STRIDE))
    for i, rig in enumerate(rigs[:2]):
        one = slice(3 * i, 3 * i + 3)  # there are more pictures than the first rig has cameras
        alone = splat(context[one], depth[one], plan_splatting([rig], GRID, H, W, STRIDE))
        assert torch.equal(together[i], alone[0])
    assert not together[2].any()
    packed = [0, 3, 4, 5]
    assert torch.equal(splat(context[packed], depth[packed], plan_splatting(rigs, GRID, H, W, STRIDE)), together)


def test_pictures_are_packed_and_unpacked_by_rig() -> None:
    given = torch.arange(1.0, 13.0).view(2, 3, 2)
    packed = pack_cameras(given, [1, 3])
    assert packed[:, 0].tolist() == [1, 7, 9, 11]
    back = unpack_cameras(packed, [1, 3], 3)
    assert back[..., 0].tolist() == [[1, 0, 0], [7, 9, 11]]
    assert torch.equal(unpack_cameras(pack_cameras(given, [3, 3]), [3, 3], 3), given)
    with pytest.raises(ShapeError, match="at least 4"):
        pack_cameras(given, [1, 4])


def test_seen_cells_are_those_before_the_cameras() -> None:
    seen = plan_splatting([CameraRig((FRONT,)), CameraRig(())], GRID, H, W, STRIDE).seen
    assert seen.shape == (2, *GRID.shape)
    assert seen[0][tuple(GRID.cell_of([12.0, 0.3]))]
    assert not seen[0][tuple(GRID.cell_of([-12.0, 0.3]))]
    assert not seen[1].any()


def test_a_cell_is_seen_if_a_camera_has_a_corner_of_it_in_the_picture_at_some_height() -> None:
    expected = np.zeros(GRID.shape, dtype=np.bool_)
    corners = GRID.centres()[..., None, :] + GRID.cell_m / 2 * np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]])
    for each in RIG:
        for height_m in SEEN_HEIGHTS_M:
            pixels, depth_m = each.project_ego(np.insert(corners.reshape(-1, 2), 2, height_m, axis=1))
            expected |= each.sees(pixels, depth_m).reshape(*GRID.shape, 4).any(axis=-1)
    assert 0.2 < expected.mean() < 0.9
    body = EgoVehicle().body_cells(GRID)
    assert (expected & body).any()
    assert np.array_equal(visible_cells(RIG, GRID), expected & ~body)
    bus = EgoVehicle(length_m=12.0, width_m=2.5, rear_overhang_m=3.0)
    assert np.array_equal(visible_cells(replace(RIG, ego_vehicle=bus), GRID), expected & ~bus.body_cells(GRID))


def test_a_plan_knows_the_size_of_the_ego_vehicle() -> None:
    bus = EgoVehicle(length_m=12.0, width_m=2.5, rear_overhang_m=3.0)
    cars, buses = (plan_splatting([rig], GRID, H, W, STRIDE).seen for rig in (RIG, replace(RIG, ego_vehicle=bus)))
    assert not torch.equal(cars, buses)


def test_a_plan_is_the_same_for_an_equal_rig_and_another_for_a_moved_one() -> None:
    def plan(rig: CameraRig) -> SplattingPlan:
        return plan_splatting([rig], GRID, H, W, STRIDE)

    again = CameraRig((camera("CAM_FRONT", 0.0),))
    first = plan(CameraRig((FRONT,)))
    assert torch.equal(first.cell, plan(again).cell)
    moved = plan(CameraRig((camera("CAM_FRONT", 0.0, y_m=3.0),)))
    assert not torch.equal(first.cell[:50], moved.cell[:50])
    first.cell.zero_()  # a plan's tensors are its own
    assert plan(again).cell.any()


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(ShapeError, match="CAM_FRONT: expected an image with 5x3 features"):
        plan_splatting([RIG], GRID, H, 5, STRIDE)
    with pytest.raises(ShapeError, match="got none"):
        plan_splatting([], GRID, H, W, STRIDE)
    context, depth = random_features(2)
    with pytest.raises(ShapeError, match="got 2"):
        splat(context, depth, plan_splatting([RIG], GRID, H, W, STRIDE))


def test_sums_are_kept_in_float32_when_features_are_not() -> None:
    context, depth = random_features(3)
    plan = plan_splatting([RIG], GRID, H, W, STRIDE)
    assert splat(context.bfloat16(), depth.bfloat16(), plan).dtype == torch.float32
