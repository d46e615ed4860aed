"""Weights on disk: they come back as they were, and what is no weights is refused in one line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import torch
from safetensors.torch import save_file
from tolerances import assert_rounded
from torch import Tensor

from appocc.camera import CameraRig
from appocc.errors import DataError, NotFoundError
from appocc.grid import BEVGrid
from appocc.models.base import BEVModel
from appocc.models.memory import Past
from appocc.models.model_spec import MODEL_SPECS, ModelSpec, Parts
from appocc.models.registry import build
from appocc.models.rounding import count_terms
from appocc.models.weights import load_model, load_weights_into, read_thresholds, save_weights
from appocc.rigs import read_rig

TINY = ModelSpec("own", ("CAM_A", "CAM_B"), BEVGrid(0.0, 8.0, -4.0, 4.0, 0.5), 96, 64)
CARD = {"network": "neat", "data": "a few towns"}


def network(name: str = "neat", **more: bool | int) -> BEVModel:
    torch.manual_seed(1)
    return build(name, TINY, **more)  # type: ignore[arg-type]


@pytest.fixture
def written(tmp_path: Path) -> Path:
    path = tmp_path / "w.safetensors"
    save_weights(path, network(), CARD)
    return path


def test_weights_and_card_come_back(written: Path) -> None:
    model, card = load_model(written)
    assert model.spec == TINY
    assert not model.training
    assert card["data"] == "a few towns"
    assert read_thresholds(card) == (0.5, 0.5, 0.5)
    for key, tensor in network().state_dict().items():
        assert torch.equal(model.state_dict()[key], tensor)


def test_heads_for_training_are_left_out_and_appearance_is_found_out(tmp_path: Path) -> None:
    path = tmp_path / "w.safetensors"
    for appearance in (True, False):
        model = network("appocc", appearance=appearance, num_classes=5)
        save_weights(path, model, {"network": "appocc", "thresholds": "[0.4, 0.3, 0.2]"}, half=True)
        loaded, card = load_model(path)
        assert card["appearance"] == json.dumps(appearance)
        assert read_thresholds(card) == (0.4, 0.3, 0.2)
        assert loaded.state_dict().keys() < model.state_dict().keys()
        for key, tensor in loaded.state_dict().items():
            assert tensor.dtype == model.state_dict()[key].dtype
            given = model.state_dict()[key]
            assert torch.equal(tensor, given.half().to(given.dtype) if given.ndim > 1 else given)


def test_half_the_size_and_the_same_bytes_each_time(tmp_path: Path, written: Path) -> None:
    again, half = tmp_path / "again.safetensors", tmp_path / "half.safetensors"
    save_weights(again, network(), dict(reversed(CARD.items())))
    save_weights(half, network(), CARD, half=True)
    assert again.read_bytes() == written.read_bytes()
    assert half.stat().st_size < 0.6 * written.stat().st_size


def test_random_numbers_of_the_caller_go_on(tmp_path: Path) -> None:
    model = network()
    torch.manual_seed(7)
    expected = torch.rand(3)
    torch.manual_seed(7)
    save_weights(tmp_path / "w.safetensors", model, CARD)
    load_model(tmp_path / "w.safetensors")
    assert torch.equal(torch.rand(3), expected)


def test_a_setting_of_the_paper_comes_back(tmp_path: Path) -> None:
    save_weights(tmp_path / "w.safetensors", build("neat", MODEL_SPECS["180"]), CARD)
    assert load_model(tmp_path / "w.safetensors")[0].spec == MODEL_SPECS["180"]


def test_what_cannot_be_saved(tmp_path: Path) -> None:
    path = tmp_path / "w.safetensors"
    with pytest.raises(NotFoundError, match="no network 'other'"):
        save_weights(path, network(), {"network": "other"})
    with pytest.raises(DataError, match="expected those of the network 'appocc'"):
        save_weights(path, network(), {"network": "appocc"})
    with pytest.raises(DataError, match="thresholds"):
        save_weights(path, network(), {"network": "neat", "thresholds": "[0.5]"})
    broken = network()
    with torch.no_grad():
        next(broken.parameters()).fill_(torch.nan)
    with pytest.raises(DataError, match="finite"):
        save_weights(path, broken, CARD)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("kept", [0, 5, 200, 100_000, -1])
def test_truncated_files(written: Path, kept: int) -> None:
    written.write_bytes(written.read_bytes()[:kept])
    assert_refused(written, "not a readable file of weights")


def test_foreign_files(tmp_path: Path) -> None:
    path = tmp_path / "w.safetensors"
    assert_refused(path, "no such file")
    assert_refused(tmp_path, "no such file")
    torch.save({"a": torch.zeros(3)}, path)
    assert_refused(path, "not a readable file of weights")
    path.write_text("weights\n" * 50)
    assert_refused(path, "not a readable file of weights")
    save_file({"a": torch.zeros(3)}, path)
    assert_refused(path, "there is no card")
    save_file({"a": torch.zeros(3)}, path, {"card": "[1]"})
    assert_refused(path, "there is no card")
    save_file({"a": torch.zeros(3)}, path, {"card": "{"})
    assert_refused(path, "not a readable file of weights")


@pytest.mark.parametrize(
    ("changed", "reason"),
    [
        ({"version": "2"}, "expected weights of version 1, got 2"),
        ({"network": "other"}, "no network 'other'"),
        ({"network": "appocc"}, "weights of "),
        ({"appearance": "maybe"}, "invalid model card"),
        ({"thresholds": "[0.5, 0.5]"}, "three thresholds"),
        ({"thresholds": "[0.5, 0.5, 2]"}, "thresholds of 0 .. 1"),
        ({"view": "[]"}, "invalid model card"),
        (
            {"view": json.dumps({"channels": ["CAM_A"], "grid": [0, 1e6, 0, 1e6, 0.5], "size_px": [96, 64]})},
            "a grid of",
        ),
        (
            {"view": json.dumps({"channels": ["CAM_A"], "grid": [0, 8, -4, 4, 0.3], "size_px": [96, 64]})},
            "whole number",
        ),
        ({"setting": "360"}, "expected the cameras, grid and size of setting 360, got"),
        ({"setting": None}, "the card lacks 'setting'"),
        ({"parts": '["wheels"]'}, "no part 'wheels' of a network"),
        ({"parts": '["memory"]'}, "network neat: has no part 'memory'"),
        ({"parts": "3"}, "invalid model card"),
        ({"parts": "depth"}, "invalid model card"),
    ],
)
def test_cards_that_cannot_be_true(written: Path, changed: dict[str, str | None], reason: str) -> None:
    model, card = load_model(written)
    new = {key: value for key, value in {**card, **changed}.items() if value is not None}
    save_file(model.state_dict(), written, {"card": json.dumps(new)})
    assert_refused(written, reason)


def test_the_card_of_a_setting_of_the_paper_with_other_cameras(tmp_path: Path) -> None:
    path = tmp_path / "w.safetensors"
    save_weights(path, build("neat", MODEL_SPECS["180"]), CARD)
    model, card = load_model(path)
    for key, value in (("view", card["view"].replace("CAM_FRONT_LEFT", "CAM_BACK")), ("setting", "360")):
        save_file(model.state_dict(), path, {"card": json.dumps({**card, key: value})})
        assert_refused(path, "expected the cameras, grid and size of setting")


def test_weights_that_lack_one_or_are_no_numbers(written: Path) -> None:
    model, card = load_model(written)
    state = model.state_dict()
    first = next(key for key in state if state[key].is_floating_point() and state[key].ndim > 1)
    save_file({key: tensor for key, tensor in state.items() if key != first}, written, {"card": json.dumps(card)})
    assert_refused(written, f"weights of '{first}': expected .* got None")
    save_file({**state, first: state[first] * torch.inf}, written, {"card": json.dumps(card)})
    assert_refused(written, "finite")


def assert_refused(path: Path, reason: str) -> None:
    with pytest.raises(DataError, match=reason) as caught:
        load_model(path)
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith(str(path))


def test_a_training_begins_with_weights(tmp_path: Path) -> None:
    path = tmp_path / "w.safetensors"
    save_weights(path, network("appocc"), {"network": "appocc"})
    torch.manual_seed(2)
    model = build("appocc", TINY, num_classes=3)
    before, given = (
        {key: value.clone() for key, value in model.state_dict().items()},
        load_model(path)[0].state_dict(),
    )
    load_weights_into(model, path)
    assert given.keys() < before.keys()
    for key, value in model.state_dict().items():
        assert torch.equal(value, given.get(key, before[key])), key


@pytest.mark.parametrize(
    "other", [network("lss"), network("appocc", appearance=False), build("appocc", MODEL_SPECS["180"])]
)
def test_weights_of_another_network_are_refused(tmp_path: Path, other: BEVModel) -> None:
    path = tmp_path / "w.safetensors"
    save_weights(path, network("appocc"), {"network": "appocc"})
    with pytest.raises(DataError, match="expected weights of the network to train, got those of appocc, own degrees"):
        load_weights_into(other, path)


@pytest.mark.parametrize("name", ["appocc", "paper", "lss", "neat"])
def test_what_was_trained_with_heads_for_training_can_be_kept(tmp_path: Path, name: str) -> None:
    path = tmp_path / "w.safetensors"
    model = network(name, appearance=name in ("appocc", "paper"), num_classes=4)
    save_weights(path, model, {"network": name})
    assert load_model(path)[0].state_dict().keys() <= model.state_dict().keys()


# Parts ------------------------------------------------------------------------------------------------------------

RIG = CameraRig(tuple(camera.resized(96, 64) for camera in read_rig("paper")))
SEEING = ModelSpec("seeing", RIG.channels, BEVGrid(-8.0, 8.0, -8.0, 8.0, 1.0), 96, 64)
ALL = Parts(depth=True, memory=True, objects=True)


def seeing(seed: int, parts: Parts, num_classes: int = 0) -> BEVModel:
    """A network whose answer depends on what it sees."""
    torch.manual_seed(seed)
    model = build("appocc", SEEING, parts=parts, num_classes=num_classes).eval()
    with torch.no_grad():
        model.get_parameter("heads.answer.weight").normal_(std=0.3)
        if parts.memory:
            model.get_parameter("trunk.recall.fused.weight").normal_(std=0.1)
    return model


def answers(model: BEVModel) -> tuple[Tensor, Tensor]:
    """Occupancy and colours of a clip of two frames."""
    motion = torch.eye(2, 3).expand(2, 1, 2, 3).clone()
    motion[1, 0, 0, 2] = 1.0
    past = Past(None, motion, torch.full((2, 1), 0.5), torch.tensor([[0.0], [1.0]]))
    images = torch.rand(2, 6, 3, 64, 96, generator=torch.Generator().manual_seed(5))
    with torch.inference_mode():
        output = model.eval()(images, model.plan([RIG, RIG]), past)
    assert output.appearance is not None
    return output.occupancy, output.appearance


def saved(path: Path, parts: Parts, seed: int = 1) -> BEVModel:
    model = seeing(seed, parts)
    save_weights(path, model, {"network": "appocc"})
    return model


@pytest.mark.parametrize("parts", [Parts(), Parts(depth=True), Parts(memory=True, objects=True), ALL])
def test_parts_come_back(tmp_path: Path, parts: Parts) -> None:
    path = tmp_path / "w.safetensors"
    model = seeing(1, parts, num_classes=4)
    save_weights(path, model, {"network": "appocc"})
    loaded, card = load_model(path)
    assert loaded.parts == parts
    assert json.loads(card["parts"]) == list(parts.names)
    left_out = model.state_dict().keys() - loaded.state_dict().keys()
    assert left_out
    assert all(key.startswith("views.") for key in left_out)  # the part depth is no head for training
    for found, expected in zip(answers(loaded), answers(model), strict=True):
        assert torch.equal(found, expected)


def test_cards_without_parts_are_of_a_network_without_them(tmp_path: Path) -> None:
    path = tmp_path / "w.safetensors"
    saved(path, Parts())
    model, card = load_model(path)
    older = {key: value for key, value in card.items() if key != "parts"}
    save_file(model.state_dict(), path, {"card": json.dumps(older)})
    assert load_model(path)[0].parts == Parts()
    saved(path, ALL)
    model, card = load_model(path)
    save_file(model.state_dict(), path, {"card": json.dumps({**card, "parts": "[]"})})
    assert_refused(path, "weights of ")


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (Parts(), Parts(memory=True, objects=True)),
        (Parts(), ALL),
        (Parts(), Parts(depth=True)),
        (Parts(depth=True), ALL),
        (Parts(memory=True), ALL),
        (ALL, ALL),
    ],
)
def test_a_network_with_more_parts_begins_with_the_same_answers(tmp_path: Path, old: Parts, new: Parts) -> None:
    path = tmp_path / "w.safetensors"
    given = saved(path, old)
    torch.manual_seed(2)
    model = build("appocc", SEEING, parts=new, num_classes=4)
    before = answers(model)[0]
    load_weights_into(model, path)
    (occupancy, colours), (expected, expected_colours) = answers(model), answers(given)
    assert (before - expected).abs().max() > 0.1
    assert_rounded(occupancy, expected, count_terms(model))
    if old.depth == new.depth:  # depths choose among the colours
        assert_rounded(colours, expected_colours, count_terms(model))


@pytest.mark.parametrize("new", [Parts(), Parts(depth=True, memory=True), Parts(objects=True)])
def test_weights_of_a_network_with_more_parts_are_refused(tmp_path: Path, new: Parts) -> None:
    path = tmp_path / "w.safetensors"
    saved(path, ALL)
    model = seeing(2, new)
    before = {key: value.clone() for key, value in model.state_dict().items()}
    with pytest.raises(DataError, match="expected weights of the network to train, got those of appocc"):
        load_weights_into(model, path)
    assert all(torch.equal(value, before[key]) for key, value in model.state_dict().items())
