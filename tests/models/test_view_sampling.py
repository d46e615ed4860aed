"""The planned pull: what cells read, against grid_sample, by every path, for any rig."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from tolerances import assert_rounded
from torch import Tensor
from torch.nn import functional

from appocc.camera import Camera, CameraRig
from appocc.errors import ShapeError
from appocc.geometry import transform
from appocc.grid import BEVGrid
from appocc.models.view_transform import planning, sampling
from appocc.models.view_transform.planning import plan_sampling
from appocc.models.view_transform.sampling import SamplingPlan, sample_features
from appocc.rigs import read_rig

GRID = BEVGrid(-16.0, 16.0, -12.0, 12.0, 0.8)
HEIGHTS_M = (0.0, 0.6, 1.3)
H, W, STRIDE = 16, 44, 8
READ = 2 * 4 * 6  # terms: products of four weights with features, of six cameras


def rig(*channels: str) -> CameraRig:
    return CameraRig(tuple(read_rig("paper")[channel] for channel in channels))


def features(cameras: int, channels: int = 5) -> Tensor:
    return torch.rand(cameras, H, W, channels, generator=torch.Generator().manual_seed(1))


def planned(*rigs: CameraRig, heights_m: tuple[float, ...] = HEIGHTS_M) -> SamplingPlan:
    return plan_sampling(rigs, GRID, heights_m, H, W, STRIDE)


def by_grid_sample(rows: Tensor, cameras: CameraRig, heights_m: tuple[float, ...]) -> Tensor:
    """(heights * C, X, Y): the same by projecting every point into every camera and reading bilinearly."""
    slices = []
    for height_m in heights_m:
        points = np.insert(GRID.centres().reshape(-1, 2), 2, height_m, axis=1)
        total, count = torch.zeros(len(points), rows.shape[-1]), torch.zeros(len(points))
        for camera, own in zip(cameras, rows, strict=True):
            uv, depth = camera.project_ego(points)
            sees = torch.from_numpy(camera.sees(uv, depth))
            place = torch.from_numpy(np.nan_to_num(uv) / STRIDE).float() / torch.tensor([W - 1, H - 1]) * 2 - 1
            read = functional.grid_sample(
                own.permute(2, 0, 1)[None], place[None, None], padding_mode="border", align_corners=True
            )[0, :, 0].T
            total[sees] += read[sees]
            count += sees
        slices.append((total / count.clamp(min=1)[:, None]).T)
    return torch.cat(slices).reshape(-1, *GRID.shape)


@pytest.mark.parametrize("channels", [("CAM_FRONT",), read_rig("paper").channels])
def test_it_reads_what_grid_sample_reads(channels: tuple[str, ...]) -> None:
    cameras, rows = rig(*channels), features(len(channels))
    expected = by_grid_sample(rows, cameras, HEIGHTS_M)
    assert_rounded(sample_features(rows, planned(cameras))[0], expected, READ, size=W)


def test_heights_other_than_the_usual() -> None:
    cameras, rows, heights_m = rig("CAM_BACK"), features(1), (-0.5, 2.2)
    plan = planned(cameras, heights_m=heights_m)
    expected = by_grid_sample(rows, cameras, heights_m)
    assert_rounded(sample_features(rows, plan)[0], expected, READ, size=W)


def test_both_paths_and_batches_of_unequal_rigs_agree() -> None:
    rigs = [rig("CAM_FRONT", "CAM_FRONT_LEFT"), CameraRig(()), rig("CAM_BACK")]
    rows = features(3)
    plan = planned(*rigs)
    together = sample_features(rows, plan)
    assert together.is_contiguous(memory_format=torch.channels_last)
    assert_rounded(together, sample_features(rows, plan.for_export()), READ, size=1.0)
    assert_rounded(together[:1], sample_features(rows[:2], planned(rigs[0])), READ, size=1.0)
    assert_rounded(together[2:], sample_features(rows[2:], planned(rigs[2])), READ, size=1.0)
    assert together[1].abs().max() == 0
    assert plan.cameras == (2, 0, 1)
    assert plan.seen.any(dim=(1, 2)).tolist() == [True, False, True]


def test_no_camera_at_all_by_both_paths() -> None:
    plan = planned(CameraRig(()))
    for each in (plan, plan.for_export()):
        assert sample_features(features(0), each).shape == (1, 15, *GRID.shape)


def test_gradients_are_those_of_plain_gathers() -> None:
    plan = planned(rig("CAM_FRONT", "CAM_FRONT_LEFT"), rig("CAM_BACK"))
    weight = torch.rand(2, 15, *GRID.shape, generator=torch.Generator().manual_seed(2))
    found: list[Tensor] = []
    for each in (plan, plan.for_export()):
        rows = features(3).requires_grad_()
        found += torch.autograd.grad((sample_features(rows, each) * weight).sum(), rows)
    # A feature is read at most by all cells, at every height.
    assert_rounded(found[0], found[1], len(HEIGHTS_M) * plan.seen[0].numel())


def test_a_cell_that_is_seen_reads_an_average() -> None:
    plan = planned(rig(*read_rig("paper").channels))
    ones = sample_features(torch.ones(6, H, W, 1), plan)[0, 0]
    assert_rounded(ones, plan.seen[0].float(), READ)
    assert plan.count.max() >= 2


def test_seen_is_what_cameras_see_of_the_ground() -> None:
    cameras = rig("CAM_FRONT", "CAM_BACK_LEFT")
    points = np.insert(GRID.centres().reshape(-1, 2), 2, 0.0, axis=1)
    expected = np.any([camera.sees(*camera.project_ego(points)) for camera in cameras], axis=0)
    plan = planned(cameras, heights_m=(0.6, 0.0))
    assert plan.seen[0].numpy().ravel().tolist() == expected.tolist()


def overhead(focal_px: float, height_m: float) -> CameraRig:
    """A camera of 8 x 8 pixels that looks straight down, its image's upper edge ahead."""
    pose = transform(np.array([[0.0, -1, 0], [-1, 0, 0], [0, 0, -1]]), [0.13, 0.17, height_m])
    intrinsic = np.array([[focal_px, 0, 3.5], [0, focal_px, 3.5], [0, 0, 1]])
    return CameraRig((Camera("CAM_DOWN", 8, 8, intrinsic, pose),))


def test_half_a_pixel_beyond_the_middle_of_the_outer_ones_is_seen() -> None:
    """With pixels of 2 m on the ground there are cells whose places lie in that half."""
    cameras = overhead(5.0, 10.0)
    plan = plan_sampling([cameras], GRID, (0.0,), 1, 1, 8)
    uv, depth = cameras["CAM_DOWN"].project_ego(np.insert(GRID.centres().reshape(-1, 2), 2, 0.0, axis=1))
    sees = cameras["CAM_DOWN"].sees(uv, depth)
    assert (uv[sees] < 0).any()
    assert plan.seen[0].numpy().ravel().tolist() == sees.tolist()


def test_what_is_too_near_to_a_lens_is_not_seen() -> None:
    seen = [plan_sampling([overhead(0.01, height_m)], GRID, (0.0,), 1, 1, 8).seen.any() for height_m in (0.05, 0.2)]
    assert seen == [False, True]


def test_left_and_right_are_not_mixed_up() -> None:
    """CAM_FRONT_LEFT fills cells at y > 0 alone; in CAM_FRONT, what is left in the picture is left of the car."""
    seen = planned(rig("CAM_FRONT_LEFT")).seen[0]
    assert not seen[:, : GRID.shape[1] // 2 - 3].any()
    rows = torch.linspace(0, 1, W)[None, None, :, None].expand(1, H, W, 1)
    column = sample_features(rows, planned(rig("CAM_FRONT")))[0, 0, 35]  # x = 12.4 m
    cells = column[planned(rig("CAM_FRONT")).seen[0, 35]]
    assert (cells.diff() < 0).all()  # y grows to the left, columns to the right


def test_nearly_the_whole_grid_is_filled() -> None:
    plan = plan_sampling([read_rig("paper")], BEVGrid.surround(), HEIGHTS_M, H, W, STRIDE)
    assert plan.seen.float().mean() > 0.97


def test_an_equal_rig_gets_the_same_plan_and_another_does_not() -> None:
    assert planned(rig("CAM_BACK")).read.rows is planned(rig("CAM_BACK")).read.rows
    assert planned(rig("CAM_BACK")).read.rows is not planned(rig("CAM_FRONT")).read.rows


@pytest.mark.parametrize("depths", [False, True])
def test_several_rigs_planned_at_once_as_on_a_gpu_get_the_same_plan(
    depths: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Rigs with different numbers of cameras; a batch of clips, which repeats its rigs, and one of single frames."""
    groups_of = planning._groups
    two, one, all_six = rig("CAM_FRONT", "CAM_BACK"), rig("CAM_FRONT_LEFT"), read_rig("paper")
    for rigs, groups in (([two, one, two, one], 2), ([one, all_six, two], 1), ([one, one, two], 1)):
        expected = plan_sampling(rigs, GRID, HEIGHTS_M, H, W, STRIDE, depths)
        asked = tuple(map(planning._key, rigs))
        assert len(planning._groups(asked, torch.device("cuda"))) == groups
        with monkeypatch.context() as patched:
            patched.setattr(planning, "_groups", lambda keys, device: groups_of(keys, torch.device("cuda")))
            patched.setattr(sampling, "_by_counting", sampling._by_sorting)
            planning._plan_rigs.cache_clear()
            found = plan_sampling(rigs, GRID, HEIGHTS_M, H, W, STRIDE, depths)
            assert len(found.spread.offsets) == found.rows
        planning._plan_rigs.cache_clear()
        for one_table, other in ((found.read, expected.read), (found.spread, expected.spread)):
            assert all(torch.equal(a, b) for a, b in zip(one_table, other, strict=True))
        assert torch.equal(found.count, expected.count)
        assert found.cameras == expected.cameras


def test_plans_move_to_a_device() -> None:
    plan = planned(rig("CAM_BACK")).for_export().to(torch.device("meta"))
    assert plan.slots is not None
    assert {each.device.type for each in (*plan.read, plan.count, plan.seen, *plan.slots)} == {"meta"}


def test_features_of_another_size_are_refused() -> None:
    with pytest.raises(ShapeError, match="expected 704 places, as planned, got 1408"):
        sample_features(features(2), planned(rig("CAM_BACK")))
    with pytest.raises(ShapeError, match=r"CAM_BACK: expected features of \(8, 22\) at stride 16"):
        plan_sampling([rig("CAM_BACK")], GRID, HEIGHTS_M, H, W, 16)
    with pytest.raises(ShapeError, match="expected rigs and heights"):
        plan_sampling([], GRID, HEIGHTS_M, H, W, STRIDE)
