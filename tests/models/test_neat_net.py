import pytest
import torch
from tolerances import assert_rounded

from appocc.camera import CameraRig
from appocc.errors import ShapeError
from appocc.grid import BEVGrid
from appocc.models import neat
from appocc.models.model_spec import MODEL_SPECS, ModelSpec
from appocc.models.neat import AttentionField
from appocc.models.rounding import count_terms
from appocc.rigs import read_rig

SMALL = ModelSpec("small", ("CAM_FRONT", "CAM_FRONT_LEFT", "CAM_FRONT_RIGHT"), BEVGrid(0, 10, -12, 12, 1.0), 64, 32)
WHOLE = read_rig("paper")
RIG = CameraRig(tuple(WHOLE[each].resized(64, 32) for each in SMALL.channels))
IMAGES = torch.rand(2, 4, 3, 32, 64, generator=torch.Generator().manual_seed(2))


@pytest.fixture(scope="module")
def network() -> AttentionField:
    torch.manual_seed(2)
    network = AttentionField(SMALL).eval()
    with torch.no_grad():  # fresh weights attend to all patches alike; these choose
        network.query.get_parameter("2.weight").mul_(30)
    return network


def answer(network: AttentionField, images: torch.Tensor, *rigs: CameraRig) -> torch.Tensor:
    with torch.no_grad():
        occupancy: torch.Tensor = network(images, network.plan(rigs)).occupancy
    return occupancy


def test_every_cell_is_answered_however_many_are_asked_at_once(
    network: AttentionField, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = answer(network, IMAGES, RIG, RIG)
    assert whole.shape == (2, 3, 10, 24)
    assert whole[0, 0].std() > 0
    monkeypatch.setattr(neat, "_CHUNK", 37)
    assert_rounded(answer(network, IMAGES, RIG, RIG), whole, count_terms(network))


def test_rigs_of_a_batch_may_differ_and_dead_cameras_take_no_attention(network: AttentionField) -> None:
    images = IMAGES.clone()
    images[1, 1:] = torch.nan
    front = CameraRig(RIG.cameras[:1])
    together = answer(network, images, RIG, front)
    assert_rounded(together[1:], answer(network, images[1:, :1], front), count_terms(network))
    assert_rounded(together[:1], answer(network, images[:1], RIG), count_terms(network))
    assert answer(network, images[:1], CameraRig(())).isfinite().all()


def test_the_order_of_cameras_does_not_matter(network: AttentionField) -> None:
    order = [2, 0, 1]
    turned = CameraRig(tuple(RIG.cameras[i] for i in order))
    assert_rounded(
        answer(network, IMAGES[:1, order], turned), answer(network, IMAGES[:1, :3], RIG), count_terms(network)
    )


def test_where_a_camera_looks_matters(network: AttentionField) -> None:
    left, right = (CameraRig((RIG[channel],)) for channel in ("CAM_FRONT_LEFT", "CAM_FRONT_RIGHT"))
    one, other = (answer(network, IMAGES[:1, :1], rig) for rig in (left, right))
    assert (one - other).abs().max() > 1e-4


def test_rays_point_where_the_pictures_do(network: AttentionField) -> None:
    plan = network.plan([RIG])
    direction, place = plan.rays[0, ..., :3], plan.rays[0, ..., 3:]
    assert_rounded(direction.norm(dim=-1), torch.ones(3, 2, 4), 3)
    assert (direction[0, ..., 0] > 0.7).all()  # ahead
    assert (direction[1, ..., 1] > 0.3).all()  # to the left
    assert (direction[2, ..., 1] < -0.3).all()  # to the right
    assert (direction[:, 0, :, 2] > direction[:, 1, :, 2]).all()  # upper rows look higher
    assert_rounded(place[0, 0, 0], torch.tensor([1.7, 0.0, 1.51]))


def test_in_training_all_cells_reach_all_weights(monkeypatch: pytest.MonkeyPatch) -> None:
    def gradients(chunk: int) -> list[torch.Tensor | None]:
        monkeypatch.setattr(neat, "_CHUNK", chunk)
        torch.manual_seed(5)
        network = AttentionField(SMALL).train()
        network(IMAGES, network.plan([RIG, CameraRig(RIG.cameras[1:])])).occupancy.square().mean().backward()
        return [each.grad for each in network.parameters()]

    whole, parts = gradients(4096), gradients(50)
    for one, other in zip(whole, parts, strict=True):
        assert one is not None
        assert other is not None
        torch.testing.assert_close(one, other, rtol=1e-2, atol=1e-5)


@pytest.mark.parametrize("name", ["360", "180"])
def test_both_settings_can_be_planned(name: str) -> None:
    spec = MODEL_SPECS[name]
    plan = AttentionField(spec).plan([CameraRig(tuple(WHOLE[each] for each in spec.channels))])
    assert plan.rays.shape == (1, len(spec.channels), 8, 22, 6)
    assert plan.seen.shape == (1, *spec.grid.shape)


def test_pictures_of_another_size_are_refused(network: AttentionField) -> None:
    with pytest.raises(ShapeError, match="expected an image of 64x32, got 352x128"):
        network.plan([WHOLE])
    with pytest.raises(ShapeError, match="got none"):
        network.plan([])
