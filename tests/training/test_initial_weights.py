from __future__ import annotations

import json
from pathlib import Path

import pytest
import torch
from tolerances import assert_rounded

from appocc.camera import CameraRig
from appocc.errors import DataError
from appocc.grid import BEVGrid
from appocc.models.base import BEVModel, ModelOutput
from appocc.models.model_spec import ModelSpec, Parts
from appocc.models.registry import build
from appocc.models.rounding import count_terms
from appocc.models.weights import save_weights
from appocc.probability_calibration import Calibration
from appocc.rigs import read_rig
from appocc.training.session import load_initial_weights

RIG = CameraRig(tuple(camera.resized(96, 64) for camera in read_rig("paper")))
SPEC = ModelSpec("seeing", RIG.channels, BEVGrid(-8.0, 8.0, -8.0, 8.0, 1.0), 96, 64)
PARTS = Parts(objects=True)
CLASSES = {"road": [0.8, 0.3], "vehicle": [1.1, -1.5], "lane": [1.0, 0.0]}


def made(seed: int) -> BEVModel:
    torch.manual_seed(seed)
    model = build("appocc", SPEC, parts=PARTS).eval()
    with torch.no_grad():
        model.get_parameter("heads.answer.weight").normal_(std=0.3)
        model.get_parameter("objects.centre.weight").normal_(std=0.3)
    return model


def answer(model: BEVModel) -> ModelOutput:
    images = torch.rand(1, 6, 3, 64, 96, generator=torch.Generator().manual_seed(5))
    with torch.inference_mode():
        output: ModelOutput = model.eval()(images, model.plan([RIG]))
    return output


def write(path: Path, model: BEVModel, validation: object) -> None:
    save_weights(path, model, {"network": "appocc", "validation": json.dumps(validation)})


def test_training_goes_on_from_the_logits_before_calibration(tmp_path: Path) -> None:
    raw = made(1)
    calibrated = raw.calibrated([Calibration(*each) for each in CLASSES.values()], Calibration(0.4, 2.2))
    assert calibrated is not None
    write(tmp_path / "w.safetensors", calibrated, {"calibration": CLASSES, "object_calibration": [0.4, 2.2]})
    loaded = load_initial_weights(made(2), tmp_path / "w.safetensors")
    found, expected, before = answer(loaded), answer(raw), answer(calibrated)
    assert found.objects is not None
    assert expected.objects is not None
    assert before.objects is not None
    assert (before.occupancy - expected.occupancy).abs().max() > 0.1
    assert (before.objects.centre - expected.objects.centre).abs().max() > 1
    # The calibration and its inverse round logits of up to some units twice.
    terms = count_terms(raw)
    assert_rounded(found.occupancy, expected.occupancy, terms)
    assert_rounded(found.objects.centre, expected.objects.centre, terms)


def test_weights_without_a_calibration_are_taken_as_they_are(tmp_path: Path) -> None:
    raw = made(1)
    for validation in ({}, {"calibration": CLASSES | {"road": [1, 0], "vehicle": [1, 0]}}):
        write(tmp_path / "w.safetensors", raw, validation)
        loaded = load_initial_weights(made(2), tmp_path / "w.safetensors")
        assert torch.equal(answer(loaded).occupancy, answer(raw).occupancy)


@pytest.mark.parametrize(
    "validation",
    [
        {"calibration": {"road": [1, 0]}},
        {"calibration": CLASSES | {"lane": [0, 0]}},
        {"object_calibration": [1]},
        {"object_calibration": ["much", 0]},
        {"object_calibration": [1, float("inf")]},
        [],
    ],
)
def test_invalid_calibrations_are_refused(tmp_path: Path, validation: object) -> None:
    write(tmp_path / "w.safetensors", made(1), validation)
    with pytest.raises(DataError, match="card: "):
        load_initial_weights(made(2), tmp_path / "w.safetensors")
