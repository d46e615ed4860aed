"""Networks by name: each can be made, and answers in the shapes that `Output` promises."""

from __future__ import annotations

import pytest
import torch

from appocc.camera import CameraRig
from appocc.errors import NotFoundError, ShapeError
from appocc.grid import BEVGrid
from appocc.models.model_spec import ModelSpec, Parts
from appocc.models.network import repeat_to
from appocc.models.registry import COLOURINGS, DEFAULT, NETWORKS, build
from appocc.rigs import read_rig

RIG = CameraRig(tuple(camera.resized(128, 64) for camera in read_rig("paper") if "FRONT" in camera.channel))
SETTING = ModelSpec("tiny", RIG.channels, BEVGrid(0.0, 19.2, -9.6, 9.6, 1.2), 128, 64)


@pytest.mark.parametrize("name", NETWORKS)
def test_every_network_answers(name: str) -> None:
    model = build(name, SETTING).eval()
    assert model.spec is SETTING
    plan = model.plan([RIG, CameraRig(RIG.cameras[:2])])
    with torch.inference_mode():
        output = model(torch.rand(2, 3, 3, 64, 128), plan)
    assert output.occupancy.shape == (2, 3, 16, 16)
    assert plan.seen.shape == (2, 16, 16)
    assert output.views is None
    assert (output.appearance is not None) == NETWORKS[name].appearance
    if output.appearance is not None:
        assert output.appearance.shape == (2, 3, 16, 16)


@pytest.mark.parametrize("name", [name for name, network in NETWORKS.items() if network.appearance])
def test_appearance_can_be_left_out_and_view_heads_put_in(name: str) -> None:
    whole, bare = (build(name, SETTING, appearance=appearance) for appearance in (True, False))
    assert sum(p.numel() for p in bare.parameters()) < sum(p.numel() for p in whole.parameters())
    model = build(name, SETTING, num_classes=9).train()
    views = model(torch.rand(1, 3, 3, 64, 128), model.plan([RIG])).views
    assert views is not None
    assert views.kind is not None
    assert views.kind.shape[:3] == (1, 3, 9)


def test_names() -> None:
    assert DEFAULT in NETWORKS
    assert "ipm" in COLOURINGS
    with pytest.raises(NotFoundError, match="no network 'ipm'; there are appocc, paper, lss, neat"):
        build("ipm", SETTING)
    with pytest.raises(ShapeError, match="expected 0 or more classes, got -1"):
        build(DEFAULT, SETTING, num_classes=-1)


def test_all_networks_agree_on_what_is_seen() -> None:
    seen = [build(name, SETTING).plan([RIG]).seen for name in NETWORKS]
    assert 0.3 < seen[0].float().mean() < 1
    assert all(torch.equal(each, seen[0]) for each in seen)


def test_parts_have_names() -> None:
    assert Parts.of([]) == Parts()
    assert Parts.of(["objects", "depth"]) == Parts(depth=True, objects=True)
    assert Parts.of(["objects", "depth"]).names == ("depth", "objects")
    with pytest.raises(NotFoundError, match="no part 'wheels' of a network; there are depth, memory, objects"):
        Parts.of(["depth", "wheels"])


@pytest.mark.parametrize("name", NETWORKS)
def test_networks_have_the_parts_that_they_can_have(name: str) -> None:
    assert build(name, SETTING).parts == Parts()
    for part in Parts(True, True, True).names:
        if part in NETWORKS[name].parts.names:
            assert build(name, SETTING, parts=Parts.of([part])).parts.names == (part,)
        else:
            with pytest.raises(NotFoundError, match=f"network {name}: has no part '{part}'"):
                build(name, SETTING, parts=Parts.of([part]))


@pytest.mark.parametrize(
    "parts", [Parts(depth=True), Parts(memory=True), Parts(objects=True), Parts(True, True, True)]
)
def test_outputs_follow_the_parts(parts: Parts) -> None:
    model = build(DEFAULT, SETTING, parts=parts).eval()
    with torch.inference_mode():
        output = model(torch.rand(2, 3, 3, 64, 128), model.plan([RIG, RIG]))
    assert output.occupancy.shape == (2, 3, 16, 16)
    assert (output.memory is not None) == parts.memory
    assert (output.objects is not None) == parts.objects
    if output.memory is not None:
        assert output.memory.shape[0] == 2
        assert output.memory.shape[2:] == (8, 8)
    if output.objects is not None:
        assert [each.shape for each in output.objects] == [(2, n, 8, 8) for n in (6, 2, 1, 3, 2, 2, 2)]


def test_batches_of_any_number_of_images_are_filled_to_the_same_shape() -> None:
    images = torch.arange(3.0).reshape(3, 1, 1, 1)
    assert repeat_to(images, 8).flatten().tolist() == [0, 1, 2, 0, 1, 2, 0, 1]
    assert torch.equal(repeat_to(images, 3), images)
