import numpy as np
import pytest
import torch
from tolerances import assert_rounded

from appocc.camera import CameraRig
from appocc.errors import ShapeError
from appocc.grid import BEVGrid
from appocc.models.base import DEPTH_BINS
from appocc.models.efficientnet import EfficientNetB0
from appocc.models.model_spec import MODEL_SPECS, ModelSpec
from appocc.models.neat import AttentionField
from appocc.models.paper import PaperNet
from appocc.models.rounding import count_terms
from appocc.rigs import read_rig

# A small world: pictures of 64x32 pixels, a grid whose sides cannot be halved three times.
SMALL = ModelSpec("small", ("CAM_FRONT", "CAM_BACK", "CAM_FRONT_LEFT"), BEVGrid(-10, 10, -12, 12, 0.8), 64, 32)


def rig_of(*channels: str, spec: ModelSpec = SMALL) -> CameraRig:
    whole = read_rig("paper")
    return CameraRig(tuple(whole[each].resized(spec.width_px, spec.height_px) for each in channels))


def pictures(batch: int, count: int) -> torch.Tensor:
    generator = torch.Generator().manual_seed(11)
    return torch.rand(batch, count, 3, SMALL.height_px, SMALL.width_px, generator=generator)


@pytest.fixture(scope="module")
def network() -> PaperNet:
    torch.manual_seed(1)
    return PaperNet(SMALL).eval()


RIG = rig_of(*SMALL.channels)


def test_occupancy_and_colours_of_every_cell(network: PaperNet) -> None:
    with torch.no_grad():
        output = network(pictures(2, 3), network.plan([RIG, RIG]))
    assert output.occupancy.shape == (2, 3, 25, 30)
    assert output.appearance.shape == (2, 3, 25, 30)
    assert output.appearance.min() >= 0
    assert output.appearance.max() <= 1
    assert output.views is None
    assert not torch.equal(output.occupancy[0], output.occupancy[1])


def test_a_sample_of_a_batch_is_answered_as_if_it_were_alone(network: PaperNet) -> None:
    rigs = [rig_of("CAM_BACK"), RIG]
    images = pictures(2, 4)
    images[0, 1:] = torch.nan  # what stands in for cameras that are not there is not looked at
    images[1, 3] = torch.nan
    with torch.no_grad():
        together = network(images, network.plan(rigs))
        for i, rig in enumerate(rigs):
            alone = network(images[i : i + 1, : len(rig)], network.plan([rig]))
            assert_rounded(together.occupancy[i], alone.occupancy[0], count_terms(network))
            assert_rounded(together.appearance[i], alone.appearance[0], count_terms(network))


def test_a_rig_whose_cameras_are_all_dead_gets_an_answer_and_sees_nothing(network: PaperNet) -> None:
    plan = network.plan([CameraRig(())])
    with torch.no_grad():
        output = network(pictures(1, 3), plan)
    assert output.occupancy.isfinite().all()
    assert not plan.seen.any()


def test_in_training_it_speaks_of_the_pictures_too() -> None:
    torch.manual_seed(1)
    network = PaperNet(SMALL, num_classes=5).train()
    views = network(pictures(2, 3), network.plan([rig_of("CAM_BACK", "CAM_FRONT"), RIG])).views
    assert views.depth.shape == (2, 3, DEPTH_BINS, 2, 4)
    assert views.kind.shape == (2, 3, 5, 2, 4)
    assert not views.depth[0, 2].any()
    assert views.depth[0, 1].any()


@pytest.mark.parametrize("num_classes", [0, 2])
def test_there_are_no_dead_weights(num_classes: int) -> None:
    torch.manual_seed(1)
    network = PaperNet(SMALL, num_classes=num_classes).train()
    output = network(pictures(1, 3), network.plan([RIG]))
    parts = [output.occupancy, output.appearance, output.views.kind]
    total = sum((part.square().sum() for part in parts if part is not None), torch.zeros(()))
    total.backward()
    assert [name for name, each in network.named_parameters() if each.grad is None] == []
    stem = network.encoder.get_parameter("features.0.0.weight").grad
    assert stem is not None
    assert stem.abs().sum() > 0


def test_without_appearance_there_is_one_trunk() -> None:
    alone, both = PaperNet(SMALL, appearance=False).eval(), PaperNet(SMALL)
    with torch.no_grad():
        assert alone(pictures(1, 3), alone.plan([RIG])).appearance is None
    trunk, more = ({n for n, _ in module.named_parameters()} for module in (both.occupancy, both))
    assert more - {n for n, _ in alone.named_parameters()} == {f"appearance.{name}" for name in trunk}


def test_the_grid_turns_with_the_cameras(network: PaperNet) -> None:
    """Splatted features of a front camera lie ahead, those of a rear camera behind."""
    for channel, ahead in (("CAM_FRONT", True), ("CAM_BACK", False)):
        plan = network.plan([rig_of(channel)])
        with torch.no_grad():
            grid, _ = network.lift_and_splat(pictures(1, 1), plan)
        rows = grid[0].abs().sum(dim=(0, 2)).nonzero().flatten().numpy()
        x_m = SMALL.grid.centre_of(np.stack([rows, rows], axis=-1))[:, 0]
        assert (x_m > 0).all() if ahead else (x_m < 0).all()


def test_a_feature_is_shared_among_depths_that_sum_to_one() -> None:
    network = PaperNet(SMALL, appearance=False).eval()
    with torch.no_grad():
        network.lift.conv.weight.zero_()
        network.lift.conv.get_parameter("bias").fill_(3.0)  # every depth alike, every context 3
        plan = network.plan([RIG])
        grid, _ = network.lift_and_splat(pictures(1, 3), plan)
    points = plan.offsets.diff().view(25, 30)
    assert points.max() > 1
    assert_rounded(grid[0, 0], 3.0 / DEPTH_BINS * points, int(points.max()))


@pytest.mark.parametrize("name", ["360", "180"])
def test_both_settings_of_the_paper_can_be_planned(name: str) -> None:
    spec = MODEL_SPECS[name]
    network = PaperNet(spec)
    plan = network.plan([rig_of(*spec.channels, spec=spec), rig_of("CAM_FRONT", spec=spec)])
    assert plan.seen.shape == (2, *spec.grid.shape)
    assert len(plan.offsets) == 2 * spec.grid.shape[0] * spec.grid.shape[1] + 1
    filled = plan.offsets.diff().view(2, -1)[0] > 0
    assert 0.08 < filled.float().mean() < 0.2  # the nearest cell alone: 11.4 % at 360 degrees


def test_plans_and_encoders_of_others_are_refused(network: PaperNet) -> None:
    with pytest.raises(ShapeError, match="FieldPlan"):
        network(pictures(1, 3), AttentionField(SMALL).plan([RIG]))
    with pytest.raises(ShapeError, match="1 x at least 3"):
        network(pictures(1, 2), network.plan([RIG]))
    with pytest.raises(ShapeError, match="CAM_FRONT"):
        network.plan([rig_of("CAM_FRONT", spec=MODEL_SPECS["360"])])
    with pytest.raises(ShapeError, match="stride 16, got 8"):
        PaperNet(SMALL, EfficientNetB0(8))


def test_the_seed_makes_the_weights() -> None:
    def weights(seed: int) -> torch.Tensor:
        torch.manual_seed(seed)
        return torch.cat([each.flatten() for each in PaperNet(SMALL).parameters()])

    assert torch.equal(weights(4), weights(4))
    assert not torch.equal(weights(4), weights(5))
