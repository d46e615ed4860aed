"""The project's own network: shapes, rigs of any kind, nothing looked at that is not there, geometry that holds."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from made_rays import ground_places
from tolerances import assert_rounded
from torch import Tensor
from torch.nn import functional

from appocc.camera import Camera, CameraRig
from appocc.checks import FloatArray
from appocc.errors import ShapeError
from appocc.grid import BEVGrid
from appocc.models.batch_norm_folding import fold_batch_norms
from appocc.models.heads import PRIORS, GridHeads
from appocc.models.lean_trunk import upsample_twice
from appocc.models.model_spec import MODEL_SPECS, ModelSpec
from appocc.models.network import AppoccNet, mean_colours
from appocc.models.rounding import count_terms
from appocc.models.view_transform.planning import HEIGHTS_M
from appocc.rigs import read_rig

AHEAD = ModelSpec("ahead", MODEL_SPECS["180"].channels, BEVGrid(0.0, 19.2, -9.6, 9.6, 0.8), 176, 64)
TINY = ModelSpec("tiny", read_rig("paper").channels, BEVGrid(-9.6, 9.6, -9.6, 9.6, 0.8), 176, 64)
GREY, RED = 0.45, (0.9, 0.1, 0.2)
STEPS = 28


def tiny_rig(*channels: str) -> CameraRig:
    return CameraRig(tuple(camera.resized(176, 64) for camera in read_rig("paper") if camera.channel in channels))


def network(**more: int) -> AppoccNet:
    torch.manual_seed(3)
    return AppoccNet(TINY, **more).eval()  # type: ignore[arg-type]


def pictures(batch: int, cameras: int) -> Tensor:
    return torch.rand(batch, cameras, 3, 64, 176, generator=torch.Generator().manual_seed(5))


@pytest.mark.parametrize("name", ["360", "180"])
def test_shapes_and_where_it_starts_in_both_settings(name: str) -> None:
    spec = MODEL_SPECS[name]
    rig = CameraRig(tuple(read_rig("paper")[channel] for channel in spec.channels))
    model = AppoccNet(spec, num_classes=7).eval()
    with torch.inference_mode():
        plan = model.plan([rig])
        output = model(torch.rand(1, len(rig), 3, 128, 352), plan)
    assert output.occupancy.shape == (1, 3, *spec.grid.shape)
    assert output.appearance is not None
    assert output.appearance.shape == (1, 3, *spec.grid.shape)
    assert 0 <= output.appearance.min() <= output.appearance.max() <= 1
    assert output.views is None
    assert plan.seen.shape == (1, *spec.grid.shape)
    shares = torch.sigmoid(output.occupancy).mean(dim=(0, 2, 3))
    assert shares.tolist() == pytest.approx(PRIORS, rel=0.3)
    assert 1e6 < sum(weights.numel() for weights in model.parameters()) < 8e6


def test_view_heads_speak_in_training_only_and_may_be_absent() -> None:
    rigs = [tiny_rig("CAM_FRONT", "CAM_BACK"), tiny_rig("CAM_BACK")]
    model = network(num_classes=7).train()
    views = model(pictures(2, 2), model.plan(rigs)).views
    assert views is not None
    assert views.depth.shape == (2, 2, 41, 8, 22)
    assert views.kind.shape == (2, 2, 7, 8, 22)
    assert views.depth[0, 1].abs().max() > 0
    assert views.depth[1, 1].abs().max() == 0
    bare = network().train()
    assert bare(pictures(2, 2), bare.plan(rigs)).views is None


def test_occupancy_alone() -> None:
    torch.manual_seed(0)
    model = AppoccNet(TINY, appearance=False).eval()
    output = model(pictures(1, 1), model.plan([tiny_rig("CAM_FRONT")]))
    assert output.appearance is None
    assert output.occupancy.shape == (1, 3, 24, 24)


def test_rigs_of_a_batch_do_not_touch_each_other_and_padding_is_not_looked_at() -> None:
    model = network()
    rigs = [tiny_rig("CAM_FRONT", "CAM_BACK"), tiny_rig("CAM_BACK_LEFT")]
    images = pictures(2, 3)
    images[0, 2:] = torch.nan
    images[1, 1:] = torch.nan
    with torch.inference_mode():
        together = model(images, model.plan(rigs))
        alone = [model(images[i : i + 1, : len(rig)], model.plan([rig])) for i, rig in enumerate(rigs)]
    for i, each in enumerate(alone):
        assert_rounded(together.occupancy[i : i + 1], each.occupancy, count_terms(model))
        assert_rounded(together.appearance[i : i + 1], each.appearance, count_terms(model))


def test_order_of_cameras_does_not_matter() -> None:
    model = network()
    rig = tiny_rig("CAM_FRONT", "CAM_FRONT_LEFT", "CAM_BACK")
    turned = CameraRig(rig.cameras[::-1])
    images = pictures(1, 3)
    with torch.inference_mode():
        one = model(images, model.plan([rig])).occupancy
        other = model(images.flip(1), model.plan([turned])).occupancy
    assert_rounded(one, other, count_terms(model))


def test_a_rig_without_cameras_still_gets_an_answer() -> None:
    model = network()
    plan = model.plan([CameraRig(())])
    assert not plan.seen.any()
    assert torch.isfinite(model(pictures(1, 1)[:, :0], plan).occupancy).all()


def test_too_few_images_and_wrong_sizes_are_refused() -> None:
    model = network()
    plan = model.plan([tiny_rig("CAM_FRONT", "CAM_BACK")])
    with pytest.raises(ShapeError, match="expected 1 x at least 2"):
        model(pictures(1, 1), plan)
    with pytest.raises(ShapeError, match="CAM_FRONT"):
        model.plan([CameraRig((read_rig("paper")["CAM_FRONT"],))])


def test_export_and_fused_paths_answer_the_same() -> None:
    model = network()
    for norm in (part for part in model.modules() if isinstance(part, torch.nn.BatchNorm2d)):
        norm.running_mean = torch.linspace(-0.1, 0.1, norm.num_features)
        norm.running_var = torch.linspace(0.5, 2.0, norm.num_features)
    plan = model.plan([tiny_rig("CAM_FRONT", "CAM_FRONT_LEFT")])
    images = pictures(1, 2)
    with torch.inference_mode():
        expected = model(images, plan).occupancy
        assert_rounded(model(images, plan.for_export()).occupancy, expected, count_terms(model))
        assert_rounded(fold_batch_norms(model)(images, plan).occupancy, expected, count_terms(model))
    assert any(isinstance(part, torch.nn.BatchNorm2d) for part in model.modules())


def test_doubling_keeps_places() -> None:
    coarse = torch.arange(5.0).expand(1, 1, 3, 5) * 2  # value = place of output j of a stride-2 convolution
    fine = upsample_twice(coarse, torch.zeros(1, 1, 5, 9))
    assert_rounded(fine[0, 0, 0], torch.arange(9.0), 4)
    assert fine.shape == (1, 1, 5, 9)


def test_a_cell_listens_to_the_pixels_that_show_its_ground() -> None:
    """Gradient centroids of what is pulled, in the picture, lie where the cell's centre is projected."""
    rig = CameraRig((read_rig("paper")["CAM_FRONT"],))
    model = AppoccNet(MODEL_SPECS["360"]).eval()
    plan = model.plan([rig])
    heard: list[Tensor] = []
    model.trunk.register_forward_pre_hook(lambda _, inputs: heard.append(inputs[3]))
    images = torch.rand(1, 1, 3, 128, 352).requires_grad_()
    model(images, plan)
    for cell in ((122, 101), (130, 92), (135, 112)):
        (ground,) = heard
        features = ground[0, : len(ground[0]) // len(HEIGHTS_M), cell[0], cell[1]]  # at height 0, the first
        (gradient,) = torch.autograd.grad(features.sum(), images, retain_graph=True)
        weight = gradient[0, 0].square().sum(dim=0).double()
        weight[weight < 1e-3 * weight.max()] = 0  # squeeze-excite listens to the whole picture, a little
        rows, columns = torch.meshgrid(torch.arange(128.0), torch.arange(352.0), indexing="ij")
        centroid = [float((axis * weight).sum() / weight.sum()) for axis in (columns, rows)]
        centre = np.append(MODEL_SPECS["360"].grid.centre_of(cell), 0.0)[None]
        assert rig["CAM_FRONT"].project_ego(centre)[0][0] == pytest.approx(centroid, abs=2.5)


def test_paint_is_the_mean_around_the_pixel_that_a_feature_looks_at() -> None:
    picture = torch.arange(18.0).expand(1, 3, 10, 18) / 18
    paint = mean_colours(picture)
    assert paint.shape == (1, 4, 3, 5)
    assert_rounded(paint[0, 0, 1, 1:4], torch.tensor([4.0, 8.0, 12.0]) / 18, 64)
    assert (paint[:, 3] == 1).all()
    assert_rounded(paint[0, 0, 1, 0], torch.tensor(1 / 18), 64)  # at the edge, of the pixels that there are


def test_a_cell_takes_an_offered_colour_if_there_is_one() -> None:
    heads = GridHeads(2, appearance=True, offers=2)
    with torch.no_grad():
        bias = heads.answer.bias
        assert bias is not None
        bias[6:] = torch.tensor([0.0, 30.0, 60.0])  # likes the second offer best
    offered = torch.zeros(1, 2, 4, 3, 3)
    offered[:, 0, :, :2] = torch.tensor([0.2, 0.4, 0.6, 1.0])[:, None, None]
    offered[:, 1, :, 0] = torch.tensor([0.9, 0.1, 0.3, 1.0])[:, None]
    _, colours = heads(torch.zeros(1, 2, 3, 3), offered)
    rows = colours[0, :, :, 0].T
    assert_rounded(rows, torch.tensor([[0.9, 0.1, 0.3], [0.2, 0.4, 0.6], [0.5, 0.5, 0.5]]), 4)


def rendered(camera: Camera, corner_m: FloatArray) -> Tensor:
    """(3, H, W) of grey ground with a red square of 5 m, blue sky above."""
    xy, below = ground_places(camera)
    inside = below & ((xy >= corner_m) & (xy < corner_m + 5)).all(axis=-1)
    picture = np.where(inside[..., None], RED, np.where(below[..., None], GREY, (0.5, 0.7, 1.0)))
    return torch.from_numpy(picture).float().permute(2, 0, 1)


def scenes(rig: CameraRig, random: np.random.Generator, batch: int) -> tuple[Tensor, Tensor]:
    """Images (B, N, 3, H, W) of squares at places of their own, and the cells (B, X, Y) that they cover."""
    corners = random.uniform((4, -8), (11, 3), size=(batch, 2))
    centres = AHEAD.grid.centres()
    cells = [((centres >= corner) & (centres < corner + 5)).all(axis=-1) for corner in corners]
    images = [torch.stack([rendered(camera, corner) for camera in rig]) for corner in corners]
    return torch.stack(images), torch.from_numpy(np.stack(cells))


def overlap(a: Tensor, b: Tensor) -> float:
    return float((a & b).sum() / (a | b).sum())


def test_it_learns_where_a_square_lies_and_what_colour_it_is() -> None:
    """Asked for other places than it was taught: a mirrored or shifted geometry could not answer."""
    rig = tiny_rig(*AHEAD.channels)
    torch.manual_seed(3)
    model = AppoccNet(AHEAD).train()
    random = np.random.default_rng(1)
    optimiser = torch.optim.AdamW(model.parameters(), 3e-3)
    plan = model.plan([rig] * 2)
    for _ in range(STEPS):
        images, cells = scenes(rig, random, 2)
        output = model(images, plan)
        colour = torch.where(cells[:, None], torch.tensor(RED)[:, None, None], GREY)
        loss = functional.binary_cross_entropy_with_logits(output.occupancy[:, 0], cells.float())
        loss = loss + (output.appearance - colour).abs().mean()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
    with torch.no_grad():
        images, cells = scenes(rig, random, 6)
        output = model(images, model.plan([rig] * 6))
    found = output.occupancy[:, 0] > 0
    for axis in (1, 2):
        assert overlap(found, cells) > 2 * overlap(found.flip(axis), cells)
    assert overlap(found, cells) > 0.6
    red = output.appearance.permute(0, 2, 3, 1)[cells].mean(dim=0)
    assert red.tolist() == pytest.approx(RED, abs=0.2)
