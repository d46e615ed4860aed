import pytest
import torch
from tolerances import assert_rounded

from appocc.errors import ShapeError
from appocc.models.efficientnet import EfficientNetB0, column_centres_px
from appocc.models.rounding import count_terms


@pytest.fixture
def images() -> torch.Tensor:
    return torch.rand(2, 3, 64, 96, generator=torch.Generator().manual_seed(3))


def test_features_come_by_stride_with_the_channels_that_are_promised(images: torch.Tensor) -> None:
    encoder = EfficientNetB0(32).eval()
    found = encoder(images)
    assert {stride: tuple(each.shape[1:]) for stride, each in found.items()} == {
        4: (24, 16, 24),
        8: (40, 8, 12),
        16: (112, 4, 6),
        32: (320, 2, 3),
    }
    assert dict(encoder.channels) == {4: 24, 8: 40, 16: 112, 32: 320}


def test_parameters_are_those_of_torchvision() -> None:
    # torchvision's efficientnet_b0 has 5,288,548; less its head (320x1280 + 2x1280), classifier (1280x1000 + 1000).
    whole = EfficientNetB0(32)
    assert sum(each.numel() for each in whole.parameters()) == 5_288_548 - 412_160 - 1_281_000
    names = whole.state_dict()
    shapes = {
        "features.0.0.weight": (32, 3, 3, 3),
        "features.1.0.block.0.0.weight": (32, 1, 3, 3),
        "features.1.0.block.1.fc1.weight": (8, 32, 1, 1),
        "features.2.0.block.0.0.weight": (96, 16, 1, 1),
        "features.3.1.block.2.fc2.bias": (240,),
        "features.6.3.block.1.0.weight": (1152, 1, 5, 5),
        "features.7.0.block.3.1.running_var": (320,),
    }
    assert {name: tuple(names[name].shape) for name in shapes} == shapes


def test_a_cut_encoder_has_no_dead_weights_and_takes_the_whole_ones_weights(images: torch.Tensor) -> None:
    whole, cut = EfficientNetB0(32).eval(), EfficientNetB0(8).eval()
    missing, unexpected = cut.load_state_dict(whole.state_dict(), strict=False)
    assert not missing
    assert all(name.startswith(("features.4", "features.5", "features.6", "features.7")) for name in unexpected)
    assert_rounded(cut(images)[8], whole(images)[8], count_terms(cut))
    cut(images)[8].square().sum().backward()
    assert all(each.grad is not None for each in cut.parameters())


@pytest.mark.parametrize(("stride", "column"), [(4, 40), (8, 20), (16, 10)])
def test_a_column_looks_at_the_centroid_of_its_gradient(stride: int, column: int) -> None:
    torch.manual_seed(5)
    encoder = EfficientNetB0(16).eval()
    wide = torch.rand(2, 3, 64, 336).requires_grad_()
    features = encoder(wide)[stride]
    (gradient,) = torch.autograd.grad(features[..., column].square().sum(), wide)
    sample_features = gradient.abs().sum(dim=(0, 1, 2))
    centroid = (sample_features * torch.arange(336)).sum() / sample_features.sum()
    expected = column_centres_px(stride, column + 1)[column]
    assert expected == 160
    # A stem that were padded on the right only would lie 1 px off at the first stride and 15 px at the last.
    assert abs(float(centroid) - expected) < 2.5


def test_rows_and_columns_start_at_the_first_pixel() -> None:
    assert column_centres_px(16, 22).tolist() == [16.0 * i for i in range(22)]


def test_blocks_are_skipped_in_training_only_and_by_the_seed(images: torch.Tensor) -> None:
    encoder = EfficientNetB0(16)
    for norm in encoder.modules():
        if isinstance(norm, torch.nn.BatchNorm2d):
            norm.momentum = 0.0

    def answer(seed: int) -> torch.Tensor:
        torch.manual_seed(seed)
        result: torch.Tensor = encoder(images)[16]
        return result

    assert torch.equal(answer(1), answer(1))
    assert any(not torch.equal(answer(1), answer(seed)) for seed in range(2, 6))
    encoder.eval()
    assert torch.equal(answer(1), answer(2))


def test_a_stride_without_features_is_refused() -> None:
    with pytest.raises(ShapeError, match="got 12"):
        EfficientNetB0(12)
    with pytest.raises(ShapeError, match="got 2"):
        column_centres_px(2, 4)
