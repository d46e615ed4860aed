import pytest
import torch
from tolerances import assert_rounded

from appocc.camera import CameraRig
from appocc.grid import BEVGrid
from appocc.models.lss import LiftSplatShoot
from appocc.models.model_spec import ModelSpec
from appocc.models.rounding import count_terms
from appocc.rigs import read_rig

SMALL = ModelSpec("small", ("CAM_FRONT", "CAM_BACK"), BEVGrid(0, 16, -12, 12, 0.8), 96, 64)


@pytest.fixture(scope="module")
def network() -> LiftSplatShoot:
    torch.manual_seed(2)
    return LiftSplatShoot(SMALL).eval()


RIG = CameraRig(tuple(read_rig("paper")[each].resized(96, 64) for each in SMALL.channels))
IMAGES = torch.rand(2, 2, 3, 64, 96, generator=torch.Generator().manual_seed(2))


def test_it_answers_occupancy_alone(network: LiftSplatShoot) -> None:
    rigs = [RIG, CameraRig(RIG.cameras[:1])]
    with torch.no_grad():
        output = network(IMAGES, network.plan(rigs))
        alone = network(IMAGES[1:, :1], network.plan(rigs[1:]))
    assert output.occupancy.shape == (2, 3, 20, 30)
    assert output.appearance is None
    assert output.views is None
    assert_rounded(output.occupancy[1], alone.occupancy[0], count_terms(network))


def test_it_has_as_many_weights_as_the_original_less_the_dead_ones(network: LiftSplatShoot) -> None:
    # Public checkpoint: 14.29 M, 1.69 M of them the unused head of its EfficientNet; one class there, three here.
    live = sum(each.numel() for each in network.parameters())
    assert abs(live - (14.29e6 - 1.69e6)) < 0.02e6


def test_every_weight_has_a_gradient_in_training(network: LiftSplatShoot) -> None:
    torch.manual_seed(3)
    fresh = LiftSplatShoot(SMALL).train()
    output = fresh(IMAGES, fresh.plan([RIG, RIG]))
    output.occupancy.square().sum().backward()
    assert [name for name, each in fresh.named_parameters() if each.grad is None] == []
    assert output.views.depth.shape == (2, 2, 41, 4, 6)
